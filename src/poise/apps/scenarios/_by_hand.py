"""`ByHand`: a robot that scripted hands walk, as one of a scenario's controllers."""

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter

import numpy as np
from jaxtyping import Float64

from poise._schema import checked
from poise.apps.teleoperation import (
    Script,
    lift_one_foot,
    over_an_obstacle,
    swing_fast,
    switch_feet,
)
from poise.control import Command, ControllerStatus
from poise.dynamics import RobotState
from poise.errors import ScenarioError, UnknownNameError
from poise.locomotion import ScriptedDevice, StepTeleoperator, TeleopStatus, WayPoint
from poise.robots import Robot, standing_posture
from poise.sim import Block
from poise.stack import Stack, Task

NAME = "step_teleoperation"
"""What scenario files call the controller."""

SCRIPTS: dict[str, Callable[[Robot], Script]] = {
    "over_an_obstacle": over_an_obstacle,
    "lift_one_foot": lift_one_foot,
    "switch_feet": lambda robot: switch_feet(robot, 0.6),
    "swing_fast": lambda robot: swing_fast(robot, "forward"),
}
"""The paper's scenarios 1 to 4, in the size of the robot."""


@checked(ScenarioError)
@dataclass(frozen=True, kw_only=True)
class HandsPlan:
    """What the operator's hands do: one of the scripts, or way-points.

    Attributes:
        script: one of `SCRIPTS`, which also has the blocks and the posture at the start; empty
            where there are points.
        points: in order of time, as offsets from where each foot stood at the start.
    """

    script: str = ""
    points: tuple[WayPoint, ...] = ()

    def __post_init__(self) -> None:
        if self.script and self.script not in SCRIPTS:
            raise UnknownNameError("no such script of hands", got=self.script, choices=SCRIPTS)
        if bool(self.script) == bool(self.points):
            raise ScenarioError(
                "hands need either a script or points",
                got=f"script {self.script!r} and {len(self.points)} points",
                wanted="one of the two",
            )


class ByHand:
    """The step teleoperator with hands of its own; a `poise.control.Controller`.

    Args:
        robot: a biped.
        hands: what the operator does.
        dt: control period of the plant [s].

    Attributes:
        timings: how long the last tick took [s].
        q_start: configuration at the start.
        blocks: what stands on the floor.

    Raises:
        PoiseError: the robot cannot be walked, or the period is not the controller's.
    """

    def __init__(self, robot: Robot, hands: HandsPlan, dt: float) -> None:
        self._robot = robot
        self._script = SCRIPTS[hands.script](robot) if hands.script else None
        self._points = hands.points if self._script is None else self._script.points
        self.q_start = (
            robot.q_home
            if self._script is None
            else standing_posture(
                robot, feet_apart=self._script.feet_apart, com_height=self._script.com_height
            )
        )
        self.blocks: tuple[Block, ...] = () if self._script is None else self._script.blocks
        self._teleoperator = StepTeleoperator(robot, q_start=self.q_start)
        self._solver = self._teleoperator.controller()
        self.reset()
        if dt != self._teleoperator.parameters.dt:
            raise ScenarioError(
                f"controller {NAME} has another control period than the plant",
                got=f"plant: control_dt: {dt:g}",
                wanted=f"control_dt: {self._teleoperator.parameters.dt:g}",
            )

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self._robot

    @property
    def stack(self) -> Stack:
        """What the teleoperator leads."""
        return self._teleoperator.stack

    @property
    def suspended(self) -> tuple[Task, ...]:
        """Tasks on the foot that is at rest."""
        return self._solver.suspended

    @property
    def size(self) -> tuple[int, int]:
        """Variables and rows of the differential inverse kinematics (19)."""
        return self._solver.size

    def step(self, state: RobotState) -> Command:
        """One tick; never raises."""
        begin = perf_counter()
        state = self._teleoperator.estimator.update(state)
        self._teleoperator.lead(state)
        command = self._solver.step(state)
        self.timings = {"command": perf_counter() - begin}
        return command

    def reset(self) -> None:
        """Forgets the past."""
        self._teleoperator.reset()
        self._solver.reset()
        start = self._teleoperator.resting_sample
        self._teleoperator.device = ScriptedDevice(self._points, start.left, start.right)
        self.timings: dict[str, float] = {"command": 0.0}

    def status(self) -> ControllerStatus:
        """How the last tick came out."""
        return self._solver.status()

    @property
    def mode(self) -> str:
        """Which feet carry the robot, see `poise.locomotion.Mode`."""
        return self._teleoperator.mode.name

    def signals(self) -> dict[str, float | Float64[np.ndarray, "..."]]:
        """What a recorder should know of the last tick besides the plant."""
        status: TeleopStatus | None = self._teleoperator.status
        if status is None:
            return {}
        support = status.mode.support if status.mode.single else None
        nowhere, sample = np.full(3, np.nan), status.sample
        return {
            "zmp_reference": status.zmp_reference,
            "target/left device": nowhere if sample is None else sample.left,
            "target/right device": nowhere if sample is None else sample.right,
            **{
                f"planned/{sole}": float(support is None or support == i)
                for i, sole in enumerate(self._teleoperator.soles)
            },
        }
