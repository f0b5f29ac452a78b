"""`record_walk`: a walk by scripted hands, recorded once: what the step teleoperator was told."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from benchmarks.recording import Progress
from poise.apps.teleoperation import SCRIPTS, TELEOP_PLANT, Script
from poise.dynamics import RobotState
from poise.errors import PoiseError
from poise.locomotion import DeviceSample, StepTeleoperator
from poise.robots import Robot
from poise.sim import Plant, PlantConfig, rollout

SCENARIO = "over_an_obstacle"
"""The script that is walked: both feet stand, shift, swing and land in it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Walk:
    """A scripted scenario on a robot, before anything moves.

    Attributes:
        robot: a biped with legs of six joints.
        script: way-points of the hands.
        q_start: where the robot starts.
        plant: with the script's blocks.
    """

    robot: Robot
    script: Script
    q_start: Float64[np.ndarray, " nq"]
    plant: PlantConfig

    @classmethod
    def over_an_obstacle(cls, robot: Robot) -> "Walk":
        """Scenario 1 of Zhang and Kikuuwe, scaled to the robot.

        Args:
            robot: a biped with legs of six joints.

        Raises:
            ConfigurationError: the robot cannot be walked.
        """
        # Says what is wrong with a robot that is no biped, before a script is made for it.
        StepTeleoperator(robot)
        script = SCRIPTS[SCENARIO](robot)
        return cls(
            robot=robot,
            script=script,
            q_start=script.posture(robot),
            plant=replace(TELEOP_PLANT, blocks=script.blocks),
        )

    @property
    def ticks(self) -> int:
        """Control periods in the whole script."""
        return round(self.script.duration / self.plant.control_dt)

    def teleoperator(self) -> StepTeleoperator:
        """A teleoperator that has not begun."""
        return StepTeleoperator(self.robot, q_start=self.q_start)


@dataclass(frozen=True, slots=True, eq=False)
class WalkTick:
    """What the teleoperator was told at a tick.

    Attributes:
        state: as measured, contacts and time included.
        sample: of the operator's devices.
    """

    state: RobotState
    sample: DeviceSample | None


def record_walk(walk: Walk, ticks: int, progress: Progress | None = None) -> tuple[WalkTick, ...]:
    """Walks a simulated robot and records the first ticks.

    Args:
        walk: what to walk.
        ticks: how many to record, from the start.
        progress: told how many of all ticks are done.

    Raises:
        PoiseError: the robot fell.
    """
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
