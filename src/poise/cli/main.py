"""The `poise` command: few verbs, each with `--help` and an example in it."""

import argparse
import os
import sys
from collections.abc import Sequence

from poise.cli import bench, robots, run, study, teleop
from poise.errors import PoiseError

OK, FAILED, BAD_INPUT = 0, 1, 2
"""Exit status: all checks hold; a check failed or the robot fell; bad input."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one verb.

    Args:
        arguments: the command line without the program's name; the process's own when None.

    Returns:
        The exit status; bad input gives one line on stderr and no traceback.
    """
    parser = argparse.ArgumentParser(
        prog="poise",
        description="Whole-body control for humanoid robots.",
        epilog="example: poise run squat --out runs/squat",
    )
    verbs = parser.add_subparsers(metavar="VERB", required=True)
    for verb in (run, robots, teleop, bench, study):
        verb.add_parser(verbs)
    options = parser.parse_args(arguments)
    try:
        status = options.act(options)
        # Here, not at exit, where a reader of a pipe that has gone would be an error.
        sys.stdout.flush()
    except PoiseError as error:
        # One line, whatever a name in a file or a library's message has in it.
        print("poise:", *str(error).split(), file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("poise: interrupted", file=sys.stderr)
        return FAILED
    except BrokenPipeError:
        # The reader of a pipe, such as `head`, has gone; what is left to say is for nobody.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return OK
    except OSError as error:
        # A full disk, or a folder where a file should be written.
        print(f"poise: {error}", file=sys.stderr)
        return BAD_INPUT
    return status


if __name__ == "__main__":
    sys.exit(main())
