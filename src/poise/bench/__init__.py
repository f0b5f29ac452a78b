"""Benchmarks: timings of Poise beside other methods and other packages, interleaved in one run."""

from poise.bench.figure import write_figure
from poise.bench.methods import DEFAULT_METHODS, METHODS
from poise.bench.peers import PEERS
from poise.bench.result import PHASES, TickResult
from poise.bench.stances import STACKS, STANCES, bench_stack
from poise.bench.table import format_table
from poise.bench.tick import TickBench, bench_tick

__all__ = [
    "DEFAULT_METHODS",
    "METHODS",
    "PEERS",
    "PHASES",
    "STACKS",
    "STANCES",
    "TickBench",
    "TickResult",
    "bench_stack",
    "bench_tick",
    "format_table",
    "write_figure",
]
