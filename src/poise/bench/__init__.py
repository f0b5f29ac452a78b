"""Benchmarks: timings of Poise beside other methods and other packages, interleaved in one run."""

from poise.bench.bias import BiasBench, BiasResult, bench_bias
from poise.bench.bias_table import format_bias_table
from poise.bench.dof import JOINTS, DofBench, bench_dof
from poise.bench.dof_table import format_dof_table
from poise.bench.figure import write_figure
from poise.bench.peers import PEERS
from poise.bench.peers_bench import how_to_install, peers_bench
from poise.bench.result import PHASES, TickResult
from poise.bench.stances import STACKS, STANCES, bench_stack
from poise.bench.table import format_table
from poise.bench.targets import Target, speed_targets
from poise.bench.teleop import TeleopBench, TeleopResult, bench_teleop
from poise.bench.teleop_table import format_teleop_table
from poise.bench.tick import TickBench, bench_tick

__all__ = [
    "JOINTS",
    "PEERS",
    "PHASES",
    "STACKS",
    "STANCES",
    "BiasBench",
    "BiasResult",
    "DofBench",
    "Target",
    "TeleopBench",
    "TeleopResult",
    "TickBench",
    "TickResult",
    "bench_bias",
    "bench_dof",
    "bench_stack",
    "bench_teleop",
    "bench_tick",
    "format_bias_table",
    "format_dof_table",
    "format_table",
    "format_teleop_table",
    "how_to_install",
    "peers_bench",
    "speed_targets",
    "write_figure",
]
