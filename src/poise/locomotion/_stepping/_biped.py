"""A robot that is stepped, `Biped`, and settings scaled to it: `TeleopParameters`."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float64

from poise._schema import Positive, checked
from poise.control import fault_of
from poise.dynamics import Dynamics, RobotState
from poise.errors import ConfigurationError, UnknownNameError
from poise.locomotion._pendulum import natural_frequency
from poise.locomotion._support import Point, single_support_region, two_soles
from poise.locomotion._walking import (
    CLEARANCE,
    KNEE,
    FootRange,
    Leg,
    mean_angle,
    measure_leg,
    yaw_of,
)
from poise.robots import Robot

_HEIGHT, _HALF_SOLE = 0.765, 0.12
"""Height of the CoM and half the width of a sole of the paper's robot [m]."""

_NARROW_GAP = 0.09
"""Least distance of narrow soles' edges by torques, over the CoM's height, to hold a push aside."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Biped:
    """Two feet, two legs and a torso, and ratios of dimensions to those of the paper's robot."""

    robot: Robot
    soles: tuple[str, str]  # names of the left and the right sole
    legs: tuple[Leg, Leg]
    frames: tuple[int, int]  # of the soles
    torso: int  # frame
    height: float  # of the CoM over the soles at the start [m]
    apart: float  # distance of the soles' centres across the heading at the start [m]
    half_sole: float  # half the narrower side of the smaller sole [m]
    margin: float  # distance of the CT-ZMP from the soles' edges, at most the paper's [m]
    narrow: bool  # soles are too narrow for a push outwards, see `SingleSupportRegion`

    @property
    def pelvis(self) -> int:
        """Frame of the body from which the legs hang."""
        return self.legs[0].pelvis

    @cached_property
    def weight(self) -> float:
        """M g [N]."""
        return self.robot.weight

    @cached_property
    def sizes(self) -> tuple[Point, Point]:
        """Lengths and widths of the soles [m]."""
        return self.legs[0].size, self.legs[1].size

    @property
    def knees(self) -> Mapping[str, Point]:
        """Angles that leave a knee bent, by its name [rad]."""
        return {self.robot.joint_names[leg.joints[KNEE]]: leg.knee_range for leg in self.legs}

    @property
    def relief(self) -> tuple[float, float]:
        """Lean over the left and the right foot to stand on it [rad]."""
        return self.legs[0].relief, self.legs[1].relief

    @cached_property
    def tall(self) -> float:
        """Ratio of the CoM's heights."""
        return self.height / _HEIGHT

    @cached_property
    def wide(self) -> float:
        """Ratio of the soles' widths, at most 1: the kick of a landing has to stay within it."""
        return min(1.0, self.half_sole / _HALF_SOLE)

    def foot_range(self, parameters: "TeleopParameters", *, servos: bool) -> FootRange:
        """Return the workspace of its feet."""
        narrow = self.narrow and not servos
        return FootRange(
            self.legs,
            step_max=parameters.step_max,
            lift_max=parameters.lift_max,
            gap=max(CLEARANCE, _NARROW_GAP * self.height if narrow else 0.0),
            servos=servos,
        )


def biped_of(robot: Robot, q: Float64[np.ndarray, " nq"]) -> Biped:
    """Measure a robot that stands in a configuration."""
    soles, dynamics = two_soles(robot), Dynamics(robot)
    dynamics.update(RobotState(q, np.zeros(robot.nv)))
    left_frame, right_frame = (robot.frame_id(sole) for sole in soles)
    (left, left_R), (right, right_R) = map(dynamics.placement, (left_frame, right_frame))
    ahead = mean_angle(yaw_of(left_R), yaw_of(right_R))
    apart_x, apart_y, _ = (left - right).tolist()
    apart = abs(math.cos(ahead) * apart_y - math.sin(ahead) * apart_x)
    if not apart > 0.0:
        raise ConfigurationError(
            "the feet stand too close for step teleoperation", got=apart, wanted="> 0 m apart"
        )
    height = float(dynamics.com[2] - 0.5 * (left[2] + right[2]))
    left_leg, right_leg = legs = tuple(measure_leg(dynamics, sole, q) for sole in soles)
    for sole, leg in zip(soles, legs, strict=True):
        if len(leg.joints) < 6:
            raise ConfigurationError(
                f"the leg of {sole} has too few joints for step teleoperation",
                got=[robot.joint_names[j] for j in leg.joints],
                wanted="six joints or more",
            )
    half = 0.5 * min(*left_leg.size, *right_leg.size)
    region = single_support_region(robot, natural_frequency(height), min(0.02, 0.25 * half))
    return Biped(
        robot=robot,
        soles=soles,
        legs=(left_leg, right_leg),
        frames=(left_frame, right_frame),
        torso=robot.frame_id(robot.torso),
        height=height,
        apart=apart,
        half_sole=half,
        margin=region.margin,
        narrow=region.narrow,
    )


@checked()
@dataclass(frozen=True, kw_only=True)
class TeleopParameters:
    """Settings of the step teleoperator; the defaults are for `biped20`, at velocity level.

    `teleop_parameters` makes those of another robot, or of one that is commanded torques;
    `dataclasses.replace` changes some of them.

    Attributes:
        dt: T, length of a tick [s].
        kp: k_p of the CoM shifter; by torques, the gain kp / omega of the DCM feedback [1/s^2].
        lift_height: height of a device above its foot that lifts the foot [m].
        lower_height: height below which a device counts as lowered again [m].
        press_depth: greatest depth below the ground to which a foot can be commanded [m].
        lower_speed: largest speed of a foot downwards [m/s].
        stoop_max: largest descent of the CoM for the legs to reach, over its height.
        step_max: largest distance of the feet forward or sideways that can be commanded [m].
        lift_max: largest height of a foot above the other that can be commanded [m].
        hand_scale: motion of a hand over that of its device.
    """

    dt: Positive = 0.005
    kp: Positive = 40.0
    lift_height: Positive = 0.02
    lower_height: Positive = 0.01
    press_depth: Positive = 0.08
    lower_speed: Positive = 0.3
    stoop_max: Positive = 0.2
    step_max: Positive = 0.46
    lift_max: Positive = 0.46
    hand_scale: Positive = 1.0

    def __post_init__(self) -> None:
        if not self.lower_height < self.lift_height:
            raise ConfigurationError(
                "a device counts as lowered higher up than as lifted",
                got=(self.lower_height, self.lift_height),
                wanted="lower_height < lift_height",
            )


_NARROW_STEP, _NARROW_LIFT = 0.75, 0.5
"""Limits ahead and upwards of a foot beside a sole too narrow for a push, over
`step_max` and `lift_max`: from farther away it does not come down in time to catch the robot."""


def checked_start(robot: Robot, q_start: Any) -> Float64[np.ndarray, " nq"]:
    """A configuration to start in."""
    if q_start is None:
        return robot.q_home
    what, wanted = f"the start is no configuration of {robot.name}", "one like Robot.q_home"
    try:
        q = np.array(q_start, dtype=np.float64)
    except (TypeError, ValueError):
        raise ConfigurationError(what, got=q_start, wanted=wanted) from None
    fault = fault_of(RobotState(q, np.zeros(robot.nv)), robot)
    if fault:
        raise ConfigurationError(f"{what}: {fault}", wanted=wanted)
    return q


def checked_actuation(actuation: str) -> str:
    """Return a known actuation."""
    choices = ("velocity", "torque")
    if actuation not in choices:
        what = "no such actuation of step teleoperation"
        raise UnknownNameError(what, got=actuation, choices=choices)
    return actuation


def teleop_parameters(
    robot: Robot,
    actuation: str = "torque",
    *,
    q_start: Float64[np.ndarray, " nq"] | None = None,
) -> TeleopParameters:
    """Scale the settings of a `StepTeleoperator` to a robot.

    - `kp` keeps its ratio to omega^2, so that the poles keep theirs to the robot's own time.
    - `press_depth`, `lower_speed`, `step_max` and `lift_max` keep their ratio to the CoM's height.
      By torques a foot beside a narrow sole goes less far and high.
    - Half of `stoop_max` goes with half a sole where velocities are commanded: that sole brakes
      the body above it.

    Args:
        robot: a biped.
        actuation: what is commanded: "torque", or "velocity".
        q_start: configuration at the start [m, rad]; the robot's home when None.

    Raises:
        ConfigurationError: no two feet, legs of too few joints, soles that are too close; no such
            start.
        UnknownNameError: no such actuation.
    """
    checked_actuation(actuation)
    return scaled_parameters(biped_of(robot, checked_start(robot, q_start)), actuation)


def scaled_parameters(biped: Biped, actuation: str) -> TeleopParameters:
    """Scale the paper's settings, see `teleop_parameters`."""
    paper = TeleopParameters()
    scaled = replace(
        paper,
        kp=paper.kp / biped.tall,
        press_depth=paper.press_depth * biped.tall,
        lower_speed=paper.lower_speed * biped.tall,
        stoop_max=0.5 * (1.0 + biped.wide) * paper.stoop_max,
        step_max=paper.step_max * biped.tall,
        lift_max=paper.lift_max * biped.tall,
    )
    if actuation == "velocity":
        return scaled
    farthest, highest = (_NARROW_STEP, _NARROW_LIFT) if biped.narrow else (1.0, 1.0)
    return replace(
        scaled,
        dt=0.002,
        stoop_max=paper.stoop_max,
        step_max=farthest * scaled.step_max,
        lift_max=highest * scaled.lift_max,
    )
