"""The paper's scenarios as scripts: way-points that a careful operator would take."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.locomotion import ScriptedDevice, StepTeleoperator, WayPoint
from poise.robots import Robot, standing_posture
from poise.sim import Block

LIFT_EVENT = 0.565
"""When the right device is lifted in scenarios 2 and 3, as the paper has it [s]."""

_PAPER_ROBOT = "biped20"
_PAPER_STANCE, _PAPER_HEIGHT = 0.42, 0.765


@dataclass(frozen=True, kw_only=True)
class Script:
    """A scenario without a person.

    Attributes:
        name: of the scenario.
        points: of the devices.
        duration: [s].
        feet_apart: at the start [m].
        com_height: at the start [m].
        blocks: on the floor.
    """

    name: str
    points: tuple[WayPoint, ...]
    duration: float
    feet_apart: float
    com_height: float
    blocks: tuple[Block, ...] = ()

    def device(self, teleoperator: StepTeleoperator) -> ScriptedDevice:
        """The operator's foot devices, on the feet where they stand."""
        return ScriptedDevice(self.points, *teleoperator.estimator.anchors)

    def posture(self, robot: Robot) -> Float64[np.ndarray, " nq"]:
        """Where the robot starts."""
        return standing_posture(robot, feet_apart=self.feet_apart, com_height=self.com_height)


def over_an_obstacle(robot: Robot, aside: float = 0.0) -> Script:
    """Scenario 1: right foot, then left foot over two blocks that lie across its path.

    The step is as long as a sole, both blocks and room before and behind them; heights go with the
    size of the robot.

    Args:
        robot: a biped.
        aside: how far the right foot goes outwards besides, in the size of the robot [m]: the paper
            has it go “right-forward” without a number.
    """
    size, sole = _size(robot), _sole_length(robot)
    depth, gap, low, high = 0.02 * size, 0.045 * size, 0.05 * size, 0.08 * size
    front = 0.5 * sole + gap
    step, up = sole + 2.0 * depth + 2.0 * gap, high + 0.09 * size
    width = 4.0 * _stance(robot)
    blocks = (
        Block(center=(front + 0.5 * depth, 0.0), size=(depth, width, low)),
        Block(center=(front + 1.5 * depth, 0.0), size=(depth, width, high)),
    )
    points = (
        *_careful_step("right", 0.5, (step, -aside * size), up),
        *_careful_step("left", 7.0, (step, 0.0), up),
    )
    return Script(
        name="scenario 1",
        points=points,
        duration=14.0,
        feet_apart=_home_stance(robot),
        com_height=_home_height(robot),
        blocks=blocks,
    )


def lift_one_foot(robot: Robot) -> Script:
    """Scenario 2: the right device is lifted at 0.565 s; the foot stays up."""
    up, quick = 0.1 * _size(robot), 0.02
    points = (
        WayPoint(at=LIFT_EVENT - quick, right=(0.0, 0.0, 0.0)),
        WayPoint(at=LIFT_EVENT, right=(0.0, 0.0, 0.021)),
        WayPoint(at=LIFT_EVENT + 0.7, right=(0.0, 0.0, up)),
    )
    return Script(
        name="scenario 2",
        points=points,
        duration=4.5,
        feet_apart=_stance(robot),
        com_height=_home_height(robot),
    )


def switch_feet(robot: Robot, after: float = 0.6) -> Script:
    """Scenario 3: down with the right foot, up with the left one.

    Args:
        robot: a biped.
        after: time from the right device's touching the ground to the lift of the left one [s].
    """
    size = _size(robot)
    up, ground = 0.06 * size, 3.2
    points = (
        WayPoint(at=0.5, right=(0.0, 0.0, 0.0)),
        WayPoint(at=0.8, right=(0.0, 0.0, 0.03)),
        WayPoint(at=1.8, right=(0.0, 0.0, up)),
        WayPoint(at=2.6, left=(0.0, 0.0, 0.0), right=(0.0, 0.0, up)),
        WayPoint(at=ground, right=(0.0, 0.0, -0.02)),
        WayPoint(at=ground + after, left=(0.0, 0.0, 0.0), right=(0.0, 0.0, -0.02)),
        WayPoint(at=ground + after + 0.05, left=(0.0, 0.0, 0.025)),
        WayPoint(at=ground + after + 1.0, left=(0.0, 0.0, up)),
    )
    return Script(
        name=f"scenario 3, {after:.2f} s",
        points=points,
        duration=ground + after + 3.0,
        feet_apart=_stance(robot),
        com_height=_home_height(robot),
    )


def swing_fast(
    robot: Robot, direction: Literal["forward", "sideways"] = "forward", times: int = 3
) -> Script:
    """Scenario 4: the foot in the air is swung out in 0.3 s, and back in 0.3 s.

    Args:
        robot: a biped.
        direction: by 0.3 m forward, or by 0.15 m outward, in the size of the robot.
        times: how often.
    """
    size = _size(robot)
    up = 0.1 * size
    out = (0.3 * size, 0.0, up) if direction == "forward" else (0.0, -0.15 * size, up)
    home = (0.0, 0.0, up)
    points = [WayPoint(at=0.5, right=(0.0, 0.0, 0.0)), WayPoint(at=1.3, right=home)]
    start = SWING_START
    for _ in range(times):
        points += [
            WayPoint(at=start, right=home),
            WayPoint(at=start + 0.3, right=out),
            WayPoint(at=start + 1.0, right=out),
            WayPoint(at=start + 1.3, right=home),
        ]
        start += 2.0
    return Script(
        name=f"scenario 4, {direction}",
        points=tuple(points),
        duration=start,
        feet_apart=_home_stance(robot),
        com_height=_home_height(robot),
    )


SWING_START = 3.0
"""When the first swing of scenario 4 begins [s]."""

SCRIPTS: Mapping[str, Callable[..., Script]] = {
    "over_an_obstacle": over_an_obstacle,
    "lift_one_foot": lift_one_foot,
    "switch_feet": switch_feet,
    "swing_fast": swing_fast,
}
"""The paper's scenarios 1 to 4 by name: each makes a script in the size of the robot it is given.

`switch_feet` also takes the time between the feet, `swing_fast` the direction and how often."""


def _careful_step(
    foot: Literal["left", "right"], begin: float, step: tuple[float, float], up: float
) -> list[WayPoint]:
    """Lift, wait for the weight to shift, up, along the ground, down."""
    places = (
        (0.0, (0.0, 0.0, 0.0)),
        (0.3, (0.0, 0.0, 0.03)),
        (1.0, (0.0, 0.0, 0.03)),
        (2.0, (0.0, 0.0, up)),
        (3.6, (*step, up)),
        (4.2, (*step, up)),
        (5.2, (*step, -0.03)),
        (5.6, (*step, -0.03)),
        (6.0, (*step, 0.0)),
    )
    return [WayPoint(at=begin + t, **{foot: place}) for t, place in places]


def _size(robot: Robot) -> float:
    return _home_height(robot) / _PAPER_HEIGHT


def _home_height(robot: Robot) -> float:
    return float(pin.centerOfMass(robot.model, robot.model.createData(), robot.q_home)[2])


def _sole_length(robot: Robot) -> float:
    return max(sole.length for sole in robot.soles.values())


def _stance(robot: Robot) -> float:
    """The paper's distance of the feet; other robots, whose ankles roll less, as at home."""
    return _PAPER_STANCE if robot.name == _PAPER_ROBOT else _home_stance(robot)


def _home_stance(robot: Robot) -> float:
    """Distance of the feet at home [m]; in scenarios 1 and 4, where legs reach farthest."""
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, robot.q_home)
    left, right = (data.oMf[robot.frame_id(n)].translation for n in list(robot.soles)[:2])
    return float(left[1] - right[1])
