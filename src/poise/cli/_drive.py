"""`poise drive`: a person drives the simulated robot by velocities, live, in a browser."""

import argparse
import sys
from pathlib import Path
from typing import Any

from poise.cli._live import add_live_options, check_seconds, run_live


def add_parser(verbs: Any) -> None:
    """Adds the verb to the command line."""
    parser = verbs.add_parser(
        "drive",
        help="a person drives the robot by velocities, in a browser",
        description="Starts a simulated humanoid in real time and a page on 127.0.0.1 to drive it "
        "from: open the address that is printed; arrow keys or W, A, S, D walk, Q and E turn, and "
        "a gamepad's sticks do both. The robot makes its own steps, and stops when nobody drives. "
        "Whoever has the address without its token can watch. Ctrl-C ends; every run is logged.",
        epilog="example: poise drive --robot g1",
    )
    parser.add_argument(
        "--robot",
        metavar="R",
        default="humanoid33",
        help="a humanoid: a name that `poise robots` lists, or a file (default: %(default)s)",
    )
    parser.add_argument(
        "--device",
        choices=("browser", "gamepad"),
        default="browser",
        help="what drives it: browser (its keys, or a gamepad at its computer), or gamepad (one at "
        "this machine) (default: %(default)s)",
    )
    add_live_options(parser, "drive")
    parser.set_defaults(act=act, simulates=True)


def act(options: argparse.Namespace) -> int:
    """Runs until somebody ends it."""
    check_seconds(options)
    from poise.apps.live import WALK_PLANT, LiveSession
    from poise.robots import load_robot

    robot = load_robot(options.robot)
    folder = Path(options.out or f"runs/drive-{Path(robot.name).stem}")
    session = LiveSession(
        robot,
        folder,
        by="velocity",
        port=options.port,
        gamepad=options.device == "gamepad",
        plant=WALK_PLANT.with_noise() if options.noise else WALK_PLANT,
        seed=options.seed,
    )
    before = set(folder.glob("*.mcap"))
    run_live(session, robot.name, "To walk: arrow keys; to turn: Q and E.", options)
    logs = sorted(path.name for path in set(folder.glob("*.mcap")) - before)
    print(f"logs in {folder}: {', '.join(logs) if logs else 'none'}")
    if session.takes.is_full:
        print(f"poise: {session.takes.name}", file=sys.stderr)
    return 0
