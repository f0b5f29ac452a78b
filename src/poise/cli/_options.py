"""Options that several verbs share, and the checks of their values."""

import argparse
from pathlib import Path


def add_output_options(parser: argparse.ArgumentParser, default: str) -> None:
    """Adds `--out` and `--json`.

    Args:
        parser: the verb's parser.
        default: what the help calls the folder that is used without `--out`.
    """
    parser.add_argument("--out", metavar="DIR", help=f"folder to write into (default: {default})")
    parser.add_argument("--json", action="store_true", help="print the figures as JSON")


def make_folder(given: str | None, default: str) -> Path:
    """The folder to write into, made if it is not there."""
    folder = Path(given or default)
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def whole_number(text: str) -> int:
    """A whole number >= 0 of the command line.

    Raises:
        argparse.ArgumentTypeError: it is something else.
    """
    if not (text.isascii() and text.isdigit()):
        raise argparse.ArgumentTypeError(f"got {text!r}, wanted 0, 1, 2, ...")
    return int(text)
