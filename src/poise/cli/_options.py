"""Options that several verbs share, and the checks of their values."""

import argparse
from pathlib import Path

from poise.errors import ConfigurationError


def add_output_options(parser: argparse.ArgumentParser, default: str) -> None:
    """Adds `--out` and `--json`.

    Args:
        parser: the verb's parser.
        default: what the help calls the folder that is used without `--out`.
    """
    parser.add_argument("--out", metavar="DIR", help=f"folder to write into (default: {default})")
    parser.add_argument("--json", action="store_true", help="print the figures as JSON")


def make_folder(wanted: str | None, default: str) -> Path:
    """The folder to write into, made if it is not there.

    Raises:
        ConfigurationError: it cannot be made.
    """
    folder = Path(wanted or default)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigurationError(
            f"cannot make the folder ({error.strerror})", got=str(folder), wanted="a writable place"
        ) from None
    return folder


def words_of(text: str) -> tuple[str, ...]:
    """Reads `a,b,c`: words with commas between them."""
    return tuple(word.strip() for word in text.split(",") if word.strip())


def whole_number(text: str) -> int:
    """A whole number >= 0 of the command line.

    Raises:
        argparse.ArgumentTypeError: it is something else.
    """
    if not (text.isascii() and text.isdigit()):
        raise argparse.ArgumentTypeError(f"got {text!r}, wanted 0, 1, 2, ...")
    return int(text)
