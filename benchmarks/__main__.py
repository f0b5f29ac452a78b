"""`python -m benchmarks`: timings, interleaved in one run."""

import argparse
import sys
from collections.abc import Sequence

from benchmarks.commands.runs import (
    add_bias,
    add_first,
    add_keys,
    add_latency,
    add_run,
    add_teleop,
    add_worst,
)
from benchmarks.commands.ticks import add_batch, add_dof, add_growth, add_ik, add_peers, add_tick
from benchmarks.hqp.command import add_hqp
from poise.cli import run_command

BENCHMARKS = (
    add_tick,
    add_growth,
    add_dof,
    add_peers,
    add_batch,
    add_ik,
    add_first,
    add_teleop,
    add_latency,
    add_keys,
    add_run,
    add_worst,
    add_bias,
    add_hqp,
)
"""What adds each to the command line, in the order of the documentation's page."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one benchmark.

    Args:
        arguments: the command line without the program's name; the process's own when None.

    Returns:
        The exit status: 0 done, 2 bad input.
    """
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description="Times controllers, solvers and whole runs. Whatever is compared is timed in "
        "turn, on the same states, in one process.",
        epilog="example: python -m benchmarks tick --controller reduced; each has a --help",
    )
    commands = parser.add_subparsers(metavar="NAME", required=True)
    for add in BENCHMARKS:
        add(commands)
    return run_command(parser, arguments)


if __name__ == "__main__":
    sys.exit(main())
