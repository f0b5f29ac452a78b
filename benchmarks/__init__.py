"""Benchmarks: timings of Poise beside other methods and other packages, interleaved in one run."""

from benchmarks.bias import BiasBench, BiasResult, bench_bias, format_bias_table
from benchmarks.dof import JOINTS, DofBench, bench_dof, format_dof_table
from benchmarks.figure import write_figure
from benchmarks.peers.process import PEERS
from benchmarks.peers_bench import how_to_install, peers_bench
from benchmarks.result import PHASES, TickResult, format_table
from benchmarks.stances import STACKS, STANCES, bench_stack
from benchmarks.targets import Target, speed_targets
from benchmarks.teleop import TeleopBench, TeleopResult, bench_teleop
from benchmarks.teleop_table import format_teleop_table
from benchmarks.tick import TickBench, bench_tick

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
