"""`poise convert`: a log of a recording that an earlier version wrote."""

import argparse
import sys
from pathlib import Path
from typing import Any

from poise.errors import ConfigurationError


def add_parser(verbs: Any) -> None:
    """Adds the verb to the command line."""
    parser = verbs.add_parser(
        "convert",
        help="make a log of a .teleop file of an earlier version",
        description="Writes an MCAP log beside the file, which plays as it did.",
        epilog="example: poise convert runs/teleop-g1/take-001.teleop",
    )
    parser.add_argument("file", metavar="FILE", help="a .teleop file")
    parser.add_argument("--out", metavar="FILE", help="the log (default: FILE with .mcap)")
    parser.set_defaults(act=act, simulates=True)


def act(options: argparse.Namespace) -> int:
    """Converts."""
    from poise.apps.teleoperation import convert_recording

    path = Path(options.file)
    target = Path(options.out) if options.out else path.with_suffix(".mcap")
    if target.exists():
        raise ConfigurationError("the log is there already", got=str(target), wanted="--out FILE")
    if not convert_recording(path, target):
        print(f"poise: {path.name} was not finished; converted what there is", file=sys.stderr)
    print(target)
    return 0
