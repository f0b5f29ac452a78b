"""`RecordedSetup`: what a recording was made with, beside its robot, so that it can run again.

`recorded_robot`: the robot, where it is known by name alone.
"""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from jaxtyping import Float64

from poise._schema import read
from poise.apps.teleoperation._digest import robot_digest
from poise.apps.teleoperation._recording import Recording, RecordingError
from poise.errors import RobotError, UnknownNameError
from poise.locomotion import StepTeleoperator, TeleopParameters
from poise.robots import Robot, find_entry, load_robot
from poise.sim import PlantConfig


def plant_to_json(config: PlantConfig) -> dict[str, Any]:
    """A plant as plain numbers and texts, for a recording."""
    return asdict(config)


def plant_from_json(data: dict[str, Any]) -> PlantConfig:
    """The plant that `plant_to_json` wrote.

    Raises:
        RecordingError: it is none: a key is unknown, or a value cannot be.
    """
    return read(PlantConfig, data, "the plant of the recording", error=RecordingError)


def recorded_robot(name: str, what: str, *, option: str = "") -> Robot:
    """The robot with which something was recorded, from the catalog.

    No file is opened by its name: what was recorded may come from a stranger.

    Args:
        name: that was recorded.
        what: was recorded with it, for the message.
        option: of the command line that gives another robot; "" for none.

    Raises:
        UnknownNameError: it is not in the catalog; the message says how to give it.
        MissingExtraError: its files come with an extra that is not installed.
    """
    try:
        known = find_entry(name) is not None
    except RobotError:
        known = False
    if not known:
        by_option = f", or {option} on the command line" if option else ""
        raise UnknownNameError(
            f"{what} was made with a robot that is not in the catalog",
            got=name,
            wanted=f'its file, by robot=load_robot("FILE"){by_option}',
        )
    return load_robot(name)


@dataclass(frozen=True, kw_only=True, eq=False)
class RecordedSetup:
    """Set-up of a recorded run, beside its robot.

    Attributes:
        parameters: of the teleoperator.
        rotator: whether the body rotator acts.
        plant: of the run.
        seed: of the sensor noise.
        duration: of the run [s].
        q_start: configuration at the start; None for the robot's home.
        solved_by: name of the controller that solved the stack; None for the usual one.
        digest: of the robot, see `robot_digest`; None where the recording does not say.
    """

    parameters: TeleopParameters
    rotator: bool
    plant: PlantConfig
    seed: int
    duration: float
    q_start: Float64[np.ndarray, " nq"] | None
    solved_by: str | None
    digest: str | None


def recorded_setup(recording: Recording, robot: Robot) -> RecordedSetup:
    """Set-up of a recorded run.

    Args:
        recording: of `run_teleop` or of a live run.
        robot: that shall do the same again.

    Raises:
        RecordingError: it does not say, or the robot has the same name and is another one.
    """
    made = _read_setup(recording)
    same_name = recording.robot == robot.name
    if same_name and made.digest not in (None, robot_digest(robot)):
        raise RecordingError(
            f"the recording {recording.path.name} is from another {robot.name}: masses, limits or "
            "soles differ, and commands would",
            wanted="the robot that it was made with, as `robot`",
        )
    return made


def _read_setup(recording: Recording) -> RecordedSetup:
    setup = recording.setup
    try:
        return RecordedSetup(
            parameters=TeleopParameters(**setup["parameters"]),
            rotator=setup["rotator"],
            plant=plant_from_json(setup["plant"]),
            seed=setup["seed"],
            duration=recording.duration,
            q_start=None if setup["q_start"] is None else np.array(setup["q_start"]),
            # The first recordings do not say.
            solved_by=setup.get("solved_by"),
            digest=setup.get("digest"),
        )
    except (KeyError, TypeError) as error:
        raise RecordingError(
            f"the recording {recording.path.name} lacks the set-up of a run",
            got=f"{type(error).__name__}: {error}",
            wanted="one that run_teleop has written",
        ) from None


def teleop_setup(
    teleoperator: StepTeleoperator,
    plant: PlantConfig,
    *,
    seed: int,
    rotator: bool = True,
    q_start: Float64[np.ndarray, " nq"] | None = None,
) -> dict[str, Any]:
    """Set-up of a run as JSON, from which `replay_teleop` repeats it.

    Args:
        teleoperator: that walks the robot.
        plant: of the run.
        seed: of the sensor noise.
        rotator: whether the body rotator acts.
        q_start: configuration at the start; None for the robot's home.
    """
    return {
        "parameters": asdict(teleoperator.parameters),
        "rotator": rotator,
        "plant": plant_to_json(plant),
        "seed": seed,
        "dt": plant.control_dt,
        "q_start": None if q_start is None else np.asarray(q_start).tolist(),
        "solved_by": teleoperator.solved_by,
        "digest": robot_digest(teleoperator.robot),
    }
