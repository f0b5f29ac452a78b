"""What `poise teleop` and `poise drive` have in common: options, the greeting, the end."""

import argparse
import math
import signal
import sys
import threading
import webbrowser
from typing import Any

from poise.cli._options import whole_number
from poise.errors import ConfigurationError

_PORT = 8080

_SEEDS = {
    "teleop": "seed of where bumps lie, and of --noise (that of a recording is its own)",
    "drive": "seed of --noise",
}
"""What `--seed` is for, by the verb."""


def add_live_options(parser: argparse.ArgumentParser, verb: str) -> None:
    """Adds port, noise, seed, seconds, and where to write."""
    parser.add_argument(
        "--port",
        metavar="N",
        type=whole_number,
        default=_PORT,
        help="port of the page, 0 for any that is free (default: %(default)s)",
    )
    parser.add_argument(
        "--noise", action="store_true", help="sensors have the noise of usual ones (default: none)"
    )
    parser.add_argument(
        "--seed",
        metavar="N",
        type=whole_number,
        default=0,
        help=f"{_SEEDS[verb]} (default: %(default)s)",
    )
    parser.add_argument(
        "--seconds",
        metavar="S",
        type=float,
        default=math.inf,
        help="end by itself after so many seconds (default: never)",
    )
    parser.add_argument("--no-open", action="store_true", help="do not open the page in a browser")
    parser.add_argument(
        "--out", metavar="DIR", help=f"folder to write into (default: runs/{verb}-ROBOT)"
    )


def check_seconds(options: argparse.Namespace) -> None:
    """Refuses a run that ends before it begins."""
    if not options.seconds > 0.0:
        raise ConfigurationError("--seconds is out of range", got=options.seconds, wanted="> 0")


def run_live(session: Any, robot: str, hint: str, options: argparse.Namespace) -> None:
    """Run a session until its time is up or it is ended."""
    # Whoever ends the process ends it as Ctrl-C does: what is recorded is finished first.
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        with session:
            _greet(session, robot, hint, options)
            session.wait(options.seconds)
    except KeyboardInterrupt:
        pass
    finally:
        signal.signal(signal.SIGTERM, before)


def _greet(session: Any, robot: str, hint: str, options: argparse.Namespace) -> None:
    """Says where the page is; flushed, so that it is there when the output is a pipe."""
    print(f"{robot} is running.")
    print(f"  drive: {session.front.drive_url}")
    print(f"  watch: {session.front.watch_url}")
    print(hint)
    print("Ctrl-C ends.", flush=True)
    if not options.no_open:
        # Some browsers, those of a terminal above all, return only when they end.
        threading.Thread(target=_open, args=(session.front.drive_url,), daemon=True).start()


def _open(address: str) -> None:
    if not webbrowser.open(address):
        print("no browser could be opened here: open the first address yourself", file=sys.stderr)
