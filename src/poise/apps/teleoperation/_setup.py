"""`TeleopSetup`: settings of a recorded run. `recorded_robot`: its robot, by name."""

import hashlib
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float64

from poise._schema import Positive, checked, read
from poise.errors import PoiseError, RobotError, UnknownNameError
from poise.locomotion import StepTeleoperator, TeleopParameters
from poise.robots import Robot, find_entry, load_robot
from poise.sim import PlantConfig


class RecordingError(PoiseError):
    """A recording that cannot be read or does not belong to this robot."""


@checked(RecordingError)
@dataclass(frozen=True, kw_only=True)
class TeleopSetup:
    """Settings of a run beside its robot."""

    parameters: TeleopParameters  # of the teleoperator
    plant: PlantConfig  # of the run
    seed: int  # of the sensor noise
    dt: Positive  # length of a tick [s]
    rotator: bool = True  # whether the body rotator acts
    q_start: tuple[float, ...] | None = None  # configuration at the start
    solved_by: str | None = None  # name of the controller that solves the stack
    digest: str | None = None  # of the robot, see `robot_digest`
    height: Positive | None = None  # of the COM over the soles at the start [m]

    @classmethod
    def of(
        cls,
        teleoperator: StepTeleoperator,
        plant: PlantConfig,
        *,
        seed: int,
        rotator: bool = True,
        q_start: Float64[np.ndarray, " nq"] | None = None,
    ) -> "TeleopSetup":
        return cls(
            parameters=teleoperator.parameters,
            plant=plant,
            seed=seed,
            dt=plant.control_dt,
            rotator=rotator,
            q_start=None if q_start is None else tuple(np.asarray(q_start).tolist()),
            solved_by=teleoperator.solved_by,
            digest=robot_digest(teleoperator.robot),
            height=com_height(teleoperator),
        )


def plant_from_json(data: dict[str, Any]) -> PlantConfig:
    """The plant of which a record has the fields."""
    return read(PlantConfig, data, "the plant of the recording", error=RecordingError)


def com_height(teleoperator: StepTeleoperator) -> float:
    """Height of the COM over the soles at the start [m]."""
    estimator = teleoperator.estimator
    return float(estimator.dynamics.com[2] - np.mean([sole[2] for sole in estimator.anchors]))


def recorded_robot(name: str, what: str, *, option: str = "") -> Robot:
    """The robot of a record, from the catalog alone: a stranger's record opens no file."""
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


def robot_digest(robot: Robot) -> str:
    """The first letters of a digest of joints, masses, limits, soles and home of a robot."""
    model = robot.model
    numbers = [model.armature, robot.q_home, robot.q_min, robot.q_max, robot.v_max, robot.tau_max]
    numbers += [inertia.toDynamicParameters() for inertia in model.inertias]
    for placement in model.jointPlacements:
        numbers += [placement.translation, placement.rotation.ravel()]
    numbers += [[sole.length, sole.width] for sole in robot.soles.values()]
    # Six digits: another machine may read the last ones otherwise. Zeros have no sign.
    text = " ".join(f"{float(x) + 0.0:.6g}" for row in numbers for x in row)
    names = " ".join((*model.names, *robot.soles, *robot.hands))
    return hashlib.sha256(f"{names} {text}".encode()).hexdigest()[:16]
