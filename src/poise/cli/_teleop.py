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
        "came from a file)",
    )
    parser.add_argument(
        "--device",
        metavar="D",
        default="browser",
        help="where the feet are led from: browser (its mouse, keys, or a gamepad at its "
        "computer), gamepad (one at this machine), or the file of a recording "
        "(default: %(default)s)",
    )
    parser.add_argument(
        "--actuation",
        choices=("torque", "velocity"),
        help="what the robot is commanded: torques, so that its feet lie as the ground does, or "
        "velocities of its joints, as in the paper and for robots that take nothing else "
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
    plant = _plant(options, robot, recording)
    if recording is not None and robot.name != recording.robot:
        _check_made_with("robot", options.robot, recording.robot)
    folder = Path(options.out or f"runs/teleop-{Path(robot.name).stem}")
    session = LiveSession(
        robot,
        folder,
        port=options.port,
        gamepad=options.device == "gamepad",
        recording=recording,
        plant=plant,
        seed=options.seed,
        parameters=_parameters(options, robot, plant, recording),
        solved_by=options.controller,
    )
    before = set(session.takes.files)
    hint = "To step: hold Q or E in the page, or drag a foot's handle up; let go to step down."
    run_live(session, robot.name, hint, options)
    found = [name for name in session.takes.files if name not in before]
    room = session.takes.room
    none = "none" if room.is_full else "none, nobody drove"
    print(f"recordings in {folder}: {', '.join(found) if found else none}")
    if room.is_full:
        print(f"poise: {room.notice}", file=sys.stderr)
    return 0


def _plant(options: argparse.Namespace, robot: Any, recording: Any) -> Any:
    """That of the recording if one is played, else one whose links touch; terrain lies on it."""
    from poise.apps.teleoperation import (
        TORQUE_TELEOP_PLANT,
        VELOCITY_TELEOP_PLANT,
        recorded_setup,
        terrain_blocks,
    )

    plant = VELOCITY_TELEOP_PLANT if options.actuation == "velocity" else TORQUE_TELEOP_PLANT
    # A person may lead hands and feet into the robot.
    plant = replace(plant, self_contact=True)
    if recording is not None and recording.setup:
        setup, noisy = recorded_setup(recording, robot), plant.with_noise().sensors
        plant = setup.plant
        if options.noise and plant.sensors != noisy:
            raise ConfigurationError(
                "a recording is played with the sensors that it was made with",
                got="--noise",
                wanted="no --noise",
            )
        _check_made_with("actuation", options.actuation, plant.actuation)
        _check_made_with("controller", options.controller, setup.solved_by)
    elif options.noise:
        plant = plant.with_noise()
    if options.terrain is None:
        return plant
    return replace(plant, blocks=terrain_blocks(options.terrain, robot, seed=options.seed))


def _parameters(options: argparse.Namespace, robot: Any, plant: Any, recording: Any) -> Any:
    """Those of the robot, with the scale that is asked for; None for all as usual."""
    scale = options.hand_scale
    if scale is None:
        return None
    if not 0.0 < scale < math.inf:
        raise ConfigurationError("--hand-scale is out of range", got=scale, wanted="> 0")
    from poise.apps.teleoperation import recorded_setup
    from poise.locomotion import teleop_parameters

    if recording is not None and recording.setup:
        made = recorded_setup(recording, robot)
        _check_made_with("hand-scale", scale, made.parameters.hand_scale)
    return replace(teleop_parameters(robot, plant.actuation), hand_scale=scale)


def _check_made_with(option: str, asked: Any, made: Any) -> None:
    if asked not in (None, made):
        usual = f"no --{option}: it was made with the usual one"
        raise ConfigurationError(
            "a recording is played with what it was made with",
            got=f"--{option} {asked}",
            wanted=usual if made is None else str(made),
        )


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
