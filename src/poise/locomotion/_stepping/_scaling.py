"""`teleop_parameters`: settings of the step teleoperator, scaled to a robot."""

import math
from dataclasses import replace

import numpy as np
from jaxtyping import Float64

from poise.dynamics import Dynamics, RobotState
from poise.errors import ConfigurationError
from poise.locomotion._pendulum import natural_frequency
from poise.locomotion._single_support import single_support_region
from poise.locomotion._stepping._stance import (
    RobotSize,
    TeleopParameters,
    mean_angle,
    yaw_of,
)
from poise.locomotion._stepping._teleop_checks import checked_actuation, checked_start
from poise.locomotion._support import two_soles
from poise.robots import Robot

_TORQUE_DT = 0.002
"""Length of a tick where torques are commanded [s]."""

_NARROW_STEP, _NARROW_LIFT = 0.75, 0.5
"""How far ahead and how high a foot may be led there beside one too narrow for a push, over
`step_max` and `lift_max`: from farther away it does not come down in time to catch the robot."""


def teleop_parameters(
    robot: Robot,
    actuation: str = "torque",
    *,
    q_start: Float64[np.ndarray, " nq"] | None = None,
) -> TeleopParameters:
    """Scale the settings of a `StepTeleoperator` to a robot.

    - `kp` keeps its ratio to omega^2, so that the poles keep theirs to the robot's own time.
    - `press_depth`, `lower_speed`, `step_max` and `lift_max` keep their ratio to the COM's height.
      By torques a foot beside a narrow sole goes less far and high.
    - Half of `stoop_max` goes with half a sole where velocities are commanded: that sole brakes
      the body above it.

    Args:
        robot: a biped.
        actuation: what is commanded: "torque", or "velocity".
        q_start: configuration at the start [m, rad]; the robot's home when None.

    Raises:
        ConfigurationError: no two feet, soles that are too close; no such start.
        UnknownNameError: no such actuation.
    """
    checked_actuation(actuation)
    return scaled_parameters(size_of(robot, checked_start(robot, q_start)), actuation)


def scaled_parameters(size: RobotSize, actuation: str) -> TeleopParameters:
    """Scale the paper's settings, as `teleop_parameters` says."""
    paper = TeleopParameters()
    scaled = replace(
        paper,
        kp=size.by_stiffness(paper.kp),
        press_depth=paper.press_depth * size.tall,
        lower_speed=paper.lower_speed * size.tall,
        stoop_max=0.5 * (1.0 + size.wide) * paper.stoop_max,
        step_max=paper.step_max * size.tall,
        lift_max=paper.lift_max * size.tall,
    )
    if actuation == "velocity":
        return scaled
    farthest, highest = (_NARROW_STEP, _NARROW_LIFT) if size.narrow else (1.0, 1.0)
    return replace(
        scaled,
        dt=_TORQUE_DT,
        stoop_max=paper.stoop_max,
        step_max=farthest * scaled.step_max,
        lift_max=highest * scaled.lift_max,
    )


def size_of(robot: Robot, q: Float64[np.ndarray, " nq"]) -> RobotSize:
    """Measure a robot that stands in a configuration."""
    soles, dynamics = two_soles(robot), Dynamics(robot)
    dynamics.update(RobotState(q, np.zeros(robot.nv)))
    (left, left_R), (right, right_R) = (dynamics.placement(robot.frame_id(s)) for s in soles)
    ahead = mean_angle(yaw_of(left_R), yaw_of(right_R))
    apart_x, apart_y, _ = (left - right).tolist()
    apart = abs(math.cos(ahead) * apart_y - math.sin(ahead) * apart_x)
    if not apart > 0.0:
        raise ConfigurationError(
            "the feet stand too close for step teleoperation", got=apart, wanted="> 0 m apart"
        )
    height = float(dynamics.com[2] - 0.5 * (left[2] + right[2]))
    half = 0.5 * min(min(s.length, s.width) for s in robot.soles.values())
    region = single_support_region(robot, natural_frequency(height), min(0.02, 0.25 * half))
    return RobotSize(
        mass=robot.mass,
        height=height,
        apart=apart,
        half_sole=half,
        margin=region.margin,
        narrow=region.narrow,
    )
