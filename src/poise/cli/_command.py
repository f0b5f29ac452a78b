"""`run_command`: a command line carried out, with an exit status and no traceback for bad input."""

import argparse
import io
import os
import sys
from collections.abc import Sequence
from importlib.util import find_spec

from poise.errors import PoiseError

OK, FAILED, BAD_INPUT = 0, 1, 2
"""Exit status: all checks hold; a check failed or the robot fell; bad input."""


def run_command(parser: argparse.ArgumentParser, arguments: Sequence[str] | None) -> int:
    """Parses a command line and does what it asks for.

    Args:
        parser: sets `act`, a function of the options that returns the exit status, and
            `simulates` where that uses MuJoCo.
        arguments: the command line without the program's name; the process's own when None.

    Returns:
        The exit status; bad input gives one line on stderr and no traceback.
    """
    for stream in (sys.stdout, sys.stderr):
        # Not every terminal has all letters that names and figures are written with.
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    options = parser.parse_args(arguments)
    program = parser.prog.split()[-1]
    try:
        if getattr(options, "simulates", False):
            _prepare_simulator()
        status = options.act(options)
        # Here, not at exit, where a reader of a pipe that has gone would be an error.
        sys.stdout.flush()
    except PoiseError as error:
        # One line, whatever a name in a file or a library's message has in it.
        print(f"{program}:", *str(error).split(), file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print(f"{program}: interrupted", file=sys.stderr)
        return FAILED
    except BrokenPipeError:
        # The reader of a pipe, such as `head`, has gone; what is left to say is for nobody.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return OK
    except OSError as error:
        # A full disk, or a folder where a file should be written; the former names no file.
        place = "" if error.filename is None else f"; got {str(error.filename)!r}"
        print(
            f"{program}: cannot write ({error.strerror}){place}, wanted a writable place",
            file=sys.stderr,
        )
        return BAD_INPUT
    return status


def _prepare_simulator() -> None:
    """Import MuJoCo, where it is installed, and keep its own warnings off the screen."""
    if find_spec("mujoco") is not None:
        from poise.sim import silence

        silence()
