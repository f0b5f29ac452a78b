"""The `poise` command: few verbs, each with `--help` and an example in it."""

import argparse
from collections.abc import Sequence

from poise import __version__
from poise.cli import (
    _campaign,
    _convert,
    _describe,
    _drive,
    _robots,
    _run,
    _scorecard,
    _teleop,
    _warmup,
)
from poise.cli._command import run_command

_VERBS = (
    _run, _scorecard, _campaign, _robots, _describe, _teleop, _drive, _convert, _warmup,
)  # fmt: skip


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one verb."""
    parser = argparse.ArgumentParser(
        prog="poise",
        description="Whole-body control for humanoid robots.",
        epilog="example: poise run squat --out runs/squat",
    )
    parser.add_argument("--version", action="version", version=f"poise {__version__}")
    verbs = parser.add_subparsers(metavar="VERB", required=True)
    for verb in (
        _run,
        _scorecard,
        _campaign,
        _robots,
        _describe,
        _teleop,
        _drive,
        _convert,
        _warmup,
    ):
        verb.add_parser(verbs)
    return run_command(parser, arguments)
