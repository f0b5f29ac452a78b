"""`record_walk`: a walk by scripted hands, recorded once, and `Replayed`, its devices again."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from benchmarks.recording import Progress
from poise.apps.teleoperation import (
    SCRIPTS,
    TORQUE_TELEOP_PLANT,
    VELOCITY_TELEOP_PLANT,
    Script,
)
from poise.dynamics import RobotState
from poise.errors import PoiseError
from poise.locomotion import OperatorSample, StepTeleoperator
from poise.robots import Robot
from poise.sim import Plant, PlantConfig, rollout

SCENARIO = "over_an_obstacle"
"""The script that is walked: both feet stand, shift, swing and land in it."""

PLANTS = {"torque": TORQUE_TELEOP_PLANT, "velocity": VELOCITY_TELEOP_PLANT}
"""By what is commanded."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Walk:
    """A scripted scenario on a robot, before anything moves."""

    robot: Robot  # a biped with legs of six joints
    script: Script  # way-points of the hands
    q_start: Float64[np.ndarray, " nq"]  # where the robot starts
    plant: PlantConfig  # with the script's blocks

    @classmethod
    def over_an_obstacle(cls, robot: Robot, actuation: str = "velocity") -> "Walk":
        """Scenario 1 of Zhang and Kikuuwe, scaled to the robot."""
        # Says what is wrong with a robot that is no biped, before a script is made for it.
        StepTeleoperator(robot, actuation=actuation)
        script = SCRIPTS[SCENARIO](robot)
        return cls(
            robot=robot,
            script=script,
            q_start=script.posture(robot),
            plant=replace(PLANTS[actuation], blocks=script.blocks),
        )

    @property
    def ticks(self) -> int:
        """Control periods in the whole script."""
        return round(self.script.duration / self.plant.control_dt)

    def teleoperator(self) -> StepTeleoperator:
        """A teleoperator that has not begun."""
        return StepTeleoperator(self.robot, q_start=self.q_start, actuation=self.plant.actuation)


@dataclass(frozen=True, slots=True, eq=False)
class WalkTick:
    """Input of the teleoperator at a tick."""

    state: RobotState  # as measured, contacts and time included
    sample: OperatorSample | None  # of the operator's devices


def record_walk(walk: Walk, ticks: int, progress: Progress | None = None) -> tuple[WalkTick, ...]:
    """Walks a simulated robot and records the first ticks."""
    teleoperator = walk.teleoperator()
    controller = teleoperator.controller()
    plant = Plant(walk.robot, walk.plant)
    plant.reset(walk.q_start)
    device = walk.script.device(teleoperator)
    teleoperator.device = device
    recorded: list[WalkTick] = []
    ticking = rollout(
        plant,
        controller,
        teleoperator,
        estimator=teleoperator.estimator,
        duration=ticks * plant.control_dt,
    )
    for tick in ticking:
        # The script always says something.
        assert teleoperator.status is not None
        assert teleoperator.status.sample is not None
        recorded.append(WalkTick(tick.state, teleoperator.status.sample))
        if plant.fallen:
            raise PoiseError(f"{walk.robot.name} fell at {plant.time:.3f} s while being recorded")
        if progress is not None and len(recorded) % 50 == 0:
            progress(float(len(recorded)), float(ticks))
    return tuple(recorded)


class Replayed:
    """A device that says again what another said, tick by tick."""

    def __init__(self, samples: Iterator[OperatorSample | None]) -> None:
        self._samples = samples

    def sample(self, time: float) -> OperatorSample | None:
        """The next one, whatever the time."""
        del time
        return next(self._samples)
