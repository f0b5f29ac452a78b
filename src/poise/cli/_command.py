"""Command lines: read, carried out, and refused in one line without a traceback."""

import io
import json
import os
import sys
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass, fields
from itertools import takewhile
from pathlib import Path
from shutil import get_terminal_size
from textwrap import fill
from typing import Annotated, Any

import tyro

from poise.errors import ConfigurationError, PoiseError

OK, FAILED, BAD_INPUT = 0, 1, 2
"""Exit status: all checks hold; a check failed or the robot fell; bad input."""


@dataclass(frozen=True, kw_only=True)
class Figures:
    """Option of verbs that print figures.

    Attributes:
        json: print the figures as JSON.
    """

    json: bool = False

    def show(self, figures: Any, *rows: str) -> int:
        """Print figures as JSON with --json, else rows of text."""
        for row in (json.dumps(figures),) if self.json else rows:
            print(row)
        return OK


@dataclass(frozen=True, kw_only=True)
class Output(Figures):
    """Options of verbs that write files, too.

    Attributes:
        out: folder to write into.
    """

    out: Annotated[str | None, tyro.conf.arg(metavar="DIR")] = None


def run_command(program: str, kind: Any, words: Sequence[str]) -> int:
    """Make a dataclass of options from a command line and carry it out.

    Args:
        program: the command as a user types it, such as `python -m benchmarks tick`.
        kind: the dataclass; its docstring is the help, its method `act` returns the exit status.
        words: the command line without the program.

    Returns:
        The exit status; bad input gives one line on stderr and no traceback.
    """

    def act() -> int:
        options = parse(kind, program, words)
        return OK if options is None else options.act()

    return carry_out(program.removeprefix("python -m ").split()[0], act)


def carry_out(program: str, act: Callable[[], int]) -> int:
    """Exit status of an action; bad input is reported in one line on stderr."""
    for stream in (sys.stdout, sys.stderr):
        # Not every terminal has all letters that names and figures are written with.
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    try:
        status = act()
        # Here, not at exit, where a reader of a pipe that has gone would be an error.
        sys.stdout.flush()
        return status
    except PoiseError as error:
        status, refused = BAD_INPUT, str(error)
    except KeyboardInterrupt:
        status, refused = FAILED, "interrupted"
    except BrokenPipeError:
        # The reader of a pipe, such as `head`, has closed it; the rest is discarded.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return OK
    except OSError as error:
        # A full disk, or a folder where a file should be written; the former names no file.
        place = "" if error.filename is None else f"; got {str(error.filename)!r}"
        refused = f"cannot write ({error.strerror}){place}, wanted a writable place"
        status = BAD_INPUT
    # One line, whatever a name in a file or a library's message has in it.
    print(f"{program}:", *refused.split(), file=sys.stderr)
    return status


def parse(kind: Any, program: str, words: Sequence[str]) -> Any:
    """Make a dataclass of options from a command line; None where its help was printed."""
    text = io.StringIO()
    try:
        with redirect_stdout(text), redirect_stderr(text):
            options, unknown = tyro.cli(
                kind,
                prog=program,
                args=words,
                return_unknown_args=True,
                config=(tyro.conf.DisallowNone, tyro.conf.FlagCreatePairsOff),
            )
    except SystemExit as end:
        rows = text.getvalue().splitlines()
        if not end.code:
            width = get_terminal_size().columns
            print("\n".join(fill(row, width) if len(row) > width else row for row in rows))
            return None
        # Below a title and a rule: what is wrong, and after an empty row or a rule the help.
        what = "".join(takewhile(lambda row: row.strip(" -"), rows[2:]))
        raise ConfigurationError(what) from None
    if unknown:
        choices = [f"--{field.name.replace('_', '-')}" for field in fields(kind)]
        raise ConfigurationError("no such option", got=unknown[0], choices=choices)
    return options


@contextmanager
def output_folder(given: Path | str | None, default: Path | str) -> Generator[Path]:
    """Folder to write into, made if it is not there, and removed again if it stays empty."""
    folder = Path(given or default)
    made = [place for place in (folder, *folder.parents) if not place.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield folder
    finally:
        for place in made:
            with suppress(OSError):  # One that holds something stays.
                place.rmdir()
