"""`python -m benchmarks`: timings, interleaved in one run."""

import argparse
import sys
from collections.abc import Sequence

from benchmarks.commands import COMMANDS
from benchmarks.hqp.command import add_hqp
from poise.cli import run_command


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one benchmark."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description="Times controllers, solvers and whole runs. Whatever is compared is timed in "
        "turn, on the same states, in one process.",
        epilog="example: python -m benchmarks tick --controller reduced; each has a --help",
    )
    commands = parser.add_subparsers(metavar="NAME", required=True)
    for command in COMMANDS:
        command.add(commands)
    add_hqp(commands)
    return run_command(parser, arguments)


if __name__ == "__main__":
    sys.exit(main())
