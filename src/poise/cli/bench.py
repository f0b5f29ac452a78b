"""`poise bench`: timings, interleaved in one run."""

import argparse
from typing import Any


def add_parser(verbs: Any) -> None:
    """Adds the verb to the command line."""
    parser = verbs.add_parser("bench", help="timings, interleaved in one run")
    parser.set_defaults(act=act)


def act(options: argparse.Namespace) -> int:
    """Runs a benchmark."""
    return 0
