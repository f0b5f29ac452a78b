"""`poise teleop`: a person walks the simulated robot, live, in a browser."""

import argparse
import math
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

from poise.cli._live import add_live_options, check_seconds, run_live
from poise.errors import ConfigurationError

_ROBOT = "biped20"
"""The robot where nobody names one."""


def add_parser(verbs: Any) -> None:
    """Adds the verb to the command line."""
    parser = verbs.add_parser(
        "teleop",
        help="a person walks the robot step by step, in a browser",
        description="Starts a simulated biped in real time and a page on 127.0.0.1 to drive it "
        "from. To step: open the address that is printed, hold key Q (left foot) or E (right "
        "foot), or drag the vertical arrow of a foot's handle up; the robot shifts its weight and "
        "lifts the foot; move it with the arrow keys; let go, and the foot comes down. Whoever has "
        "the address without its token can watch. Ctrl-C ends; every run is recorded.",
        epilog="example: poise teleop --robot biped20 --terrain steps",
    )
    parser.add_argument(
        "--robot",
        metavar="R",
        help=f"a biped, by name or file (default: {_ROBOT}; with a recording, its own, unless that "
        "came from a file; any other is led by its samples, too)",
    )
    parser.add_argument(
        "--device",
        metavar="D",
        default="browser",
        help="where the feet are led from: browser (its mouse, keys, or a gamepad at its "
        "computer), gamepad (one at this machine), or the file of a recording, which is repeated "
        "bit for bit unless other options ask for another robot or run "
        "(default: %(default)s)",
    )
    parser.add_argument(
        "--actuation",
        choices=("torque", "position", "velocity"),
        help="what the joints are sent: torques, so that the feet lie as the ground does, "
        "positions of servos that pull with these torques, or velocities, as in the paper "
        "(default: torque; with a recording, what it was made with)",
    )
    parser.add_argument(
        "--controller",
        choices=("whole_body", "reduced", "osf"),
        help="what finds the torques (default: whole_body; with a recording, its own)",
    )
    parser.add_argument(
        "--hand-scale",
        metavar="K",
        type=float,
        help="the robot's hands move K times as far as the operator's (default: 1; with a "
        "recording, what it was made with)",
    )
    parser.add_argument(
        "--terrain",
        metavar="T",
        help="what lies on the floor: flat, obstacle, steps, or bumps, whose places the seed draws "
        "(default: flat; with a recording, what it was made on)",
    )
    add_live_options(parser, "teleop")
    parser.set_defaults(act=act, simulates=True)


def act(options: argparse.Namespace) -> int:
    """Runs until somebody ends it."""
    check_seconds(options)
    from poise.apps.live import LiveSession
    from poise.apps.teleoperation import recorded_robot
    from poise.robots import load_robot

    recording = _recording(options.device)
    if recording is None or options.robot is not None:
        robot = load_robot(options.robot or _ROBOT)
    else:
        what = f"the recording {recording.path.name}"
        robot = recorded_robot(recording.robot, what, option="--robot FILE")
    known = None if recording is None or "parameters" not in recording.settings else recording.setup
    actuation = options.actuation or ("torque" if known is None else known.plant.actuation)
    made = None if recording is None else recording.setup_for(robot, actuation)
    plant = _plant(options, robot, actuation, known, made)
    parameters = _parameters(options, robot, plant.commanded, made)
    folder = Path(options.out or f"runs/teleop-{Path(robot.name).stem}")
    session = LiveSession(
        robot,
        folder,
        port=options.port,
        gamepad=options.device == "gamepad",
        recording=recording,
        plant=plant,
        seed=options.seed,
        parameters=parameters,
        solved_by=options.controller,
    )
    if recording is not None:
        of_it = made and (made.plant, made.parameters, made.solved_by)
        asked = made and (
            plant, parameters or made.parameters, options.controller or made.solved_by,
        )  # fmt: skip
        if of_it != asked or (made is None and not (known is None and recording.is_of(robot))):
            commanded = "" if known is None else f", {known.plant.actuation} commanded"
            print(
                f"poise: the samples of {recording.path.name} were recorded with robot "
                f"{recording.robot}{commanded}; this is no replay of that run",
                file=sys.stderr,
            )
    before = set(session.takes.files)
    hint = "To step: hold Q or E in the page, or drag a foot's handle up; let go to step down."
    run_live(session, robot.name, hint, options)
    found = [name for name in session.takes.files if name not in before]
    takes = session.takes
    none = "none" if takes.is_full else "none, nobody drove"
    print(f"recordings in {folder}: {', '.join(found) if found else none}")
    if takes.is_full:
        print(f"poise: {takes.name}", file=sys.stderr)
    return 0


def _plant(options: argparse.Namespace, robot: Any, actuation: str, known: Any, made: Any) -> Any:
    """That of a recording that is repeated, else one whose links touch; terrain lies on it."""
    from poise.apps.teleoperation import (
        TORQUE_TELEOP_PLANT,
        VELOCITY_TELEOP_PLANT,
        terrain_blocks,
    )

    if made is None:
        plant = VELOCITY_TELEOP_PLANT if actuation == "velocity" else TORQUE_TELEOP_PLANT
        plant = replace(plant, actuation=actuation)
        # A person may lead hands and feet into the robot.
        blocks = () if known is None else known.plant.blocks
        plant = replace(plant, self_contact=True, blocks=blocks)
    else:
        plant = made.plant
    if options.noise:
        plant = plant.with_noise()
    if options.terrain is None:
        return plant
    return replace(plant, blocks=terrain_blocks(options.terrain, robot, seed=options.seed))


def _parameters(options: argparse.Namespace, robot: Any, actuation: str, made: Any) -> Any:
    """Those of recording or robot, with the scale of the command line; None for all as usual."""
    scale = options.hand_scale
    if scale is None:
        return None
    if not 0.0 < scale < math.inf:
        raise ConfigurationError("--hand-scale is out of range", got=scale, wanted="> 0")
    from poise.locomotion import teleop_parameters

    usual = teleop_parameters(robot, actuation) if made is None else made.parameters
    return replace(usual, hand_scale=scale)


def _recording(device: str) -> Any:
    """The recording that a device names, None for a person."""
    if device in ("browser", "gamepad"):
        return None
    from poise.apps.teleoperation import RecordingError, read_recording

    path = Path(device)
    if not path.is_file():
        raise ConfigurationError(
            "no such device", got=device, wanted="browser, gamepad, or the file of a recording"
        )
    try:
        return read_recording(path)
    except RecordingError as error:
        # What a run that was killed has left can be played as far as it goes.
        recording = read_recording(path, allow_partial=True)
        print(f"poise: {error.what}; playing what there is", file=sys.stderr)
        return recording
