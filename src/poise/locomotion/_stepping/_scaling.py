"""`teleop_parameters`: the numbers of the step teleoperator, scaled to a robot."""

import math
from dataclasses import replace

import numpy as np
from jaxtyping import Float64

from poise.dynamics import Dynamics, RobotState
from poise.errors import ConfigurationError
from poise.locomotion._pendulum import natural_frequency
from poise.locomotion._single_support import single_support_region
from poise.locomotion._stepping._stance import TeleopParameters, mean_angle, yaw_of
from poise.locomotion._stepping._teleop_checks import checked_actuation, checked_start
from poise.locomotion._support import two_soles
from poise.robots import Robot

_PAPER_MASS = 65.0
"""Of the paper's robot [kg]."""

_PAPER_HEIGHT, _PAPER_STANCE, _PAPER_HALF_SOLE = 0.765, 0.42, 0.12
"""Height of the COM, distance of the feet and half the width of a sole of the paper's robot [m]."""

_MARGIN_RATIO = 0.25
"""Part of half a sole that the CT-ZMP stays away from its edge."""

_TORQUE_DT = 0.002
"""Length of a tick where torques are commanded [s]."""

_TORQUE_FOLD = 0.78
"""Least distance of hip and ankle there, over a leg's length: the stack's balance limit keeps 0.75,
and brakes before it. Asked for less, a robot that comes down would be thrown up by that."""

_NARROW_STEP, _NARROW_LIFT = 0.75, 0.5
"""How far ahead and how high a foot may be led there beside one too narrow for a push, over
`step_max` and `lift_max`: from farther away it does not come down in time to catch the robot."""

_NARROW_GAP = 0.09
"""Least distance of such soles' edges there, over the COM's height: one behind the other, as on a
rope, they hold no push aside."""


def teleop_parameters(
    robot: Robot,
    actuation: str = "torque",
    *,
    q_start: Float64[np.ndarray, " nq"] | None = None,
) -> TeleopParameters:
    """Those of a robot, which a `StepTeleoperator` has that is told of no others.

    `dataclasses.replace` changes some of them.

    Args:
        robot: a biped.
        actuation: what is commanded: "torque", or "velocity".
        q_start: configuration at the start [m, rad]; the robot's home when None.

    Raises:
        ConfigurationError: no two feet, soles that are too small or too close; no such start.
        UnknownNameError: no such actuation.
    """
    checked_actuation(actuation)
    soles, dynamics = two_soles(robot), Dynamics(robot)
    dynamics.update(RobotState(checked_start(robot, q_start), np.zeros(robot.nv)))
    (left, left_R), (right, right_R) = (dynamics.placement(robot.frame_id(s)) for s in soles)
    ahead = mean_angle(yaw_of(left_R), yaw_of(right_R))
    apart_x, apart_y, _ = (left - right).tolist()
    stance = abs(math.cos(ahead) * apart_y - math.sin(ahead) * apart_x)
    height = float(dynamics.com[2] - 0.5 * (left[2] + right[2]))
    parameters = scaled_parameters(robot, height, stance)
    return for_torques(robot, parameters, height) if actuation == "torque" else parameters


def scaled_parameters(robot: Robot, height: float, stance: float) -> TeleopParameters:
    """Parameters for a robot, from the paper's by stated rules.

    - `kp` keeps its ratio to omega^2, so that the poles keep theirs to the robot's own time.
    - `acceleration_max` keeps the first swing of the ZMP, a_lim / omega^2, in its ratio to the
      COM's height: that swing goes towards the foot that is about to be unloaded, where
      there is room.
    - `r_lift` keeps its ratio to the distance of the feet (with 0.27 m between them it is 0.077 m),
      and is no more than half the narrower side of a sole, which it is in the paper.
    - `capture_max` and `ct_zmp_max` keep their ratio to half a sole; so do `touch_speed`
      and `press_speed`: what a landing foot kicks the COM by has to stay within it.
    - `stoop_max` is half the paper's, and the other half goes with half a sole: a body that comes
      down over one foot is braked by what that sole gives.
    - `support_margin` is a quarter of half a sole, and no more than the paper's: what the ZMP
      strays by does not shrink with the soles.
    - `w_L` goes with 1 / (m h)^2, so that angular momentum weighs as much as before beside the
      swing foot's velocity.
    - `v_lim`, `press_depth`, `clear_height`, `step_max` and `lift_max` keep their ratio to the
      COM's height; so do `lift_speed`, `lift_acceleration` and `lower_speed`, by which body and
      feet go up and down in the time that an operator gives them on any robot.
    """
    if len(robot.soles) < 2:
        raise ConfigurationError(
            "step teleoperation needs two feet", got=list(robot.soles), wanted="two soles"
        )
    half = 0.5 * min(min(s.length, s.width) for s in robot.soles.values())
    paper, size = TeleopParameters(), height / _PAPER_HEIGHT
    square = natural_frequency(height) ** 2
    paper_square = natural_frequency(_PAPER_HEIGHT) ** 2
    r_lift = min(0.12 * stance / _PAPER_STANCE, half)
    if not 0.0 < r_lift < stance:
        raise ConfigurationError(
            "the feet stand too close for step teleoperation", got=stance, wanted="> 0 m apart"
        )
    near = min(1.0, half / _PAPER_HALF_SOLE)
    return replace(
        paper,
        kp=paper.kp * square / paper_square,
        acceleration_max=paper.acceleration_max * size * square / paper_square,
        r_lift=r_lift,
        capture_max=paper.capture_max * near,
        ct_zmp_max=paper.ct_zmp_max * near,
        v_lim=paper.v_lim * size,
        press_depth=paper.press_depth * size,
        clear_height=paper.clear_height * size,
        step_max=paper.step_max * size,
        lift_max=paper.lift_max * size,
        stoop_max=0.5 * (1.0 + near) * paper.stoop_max,
        support_margin=min(paper.support_margin, _MARGIN_RATIO * half),
        lift_speed=paper.lift_speed * size,
        lift_acceleration=paper.lift_acceleration * size,
        lower_speed=paper.lower_speed * size,
        touch_speed=paper.touch_speed * near,
        press_speed=paper.press_speed * near,
        w_L=paper.w_L * (_PAPER_MASS / robot.mass / size) ** 2,
    )


def for_torques(robot: Robot, parameters: TeleopParameters, height: float) -> TeleopParameters:
    """The same parameters where torques are commanded."""
    omega, margin = natural_frequency(height), parameters.support_margin
    narrow = single_support_region(robot, omega, margin).narrow
    farthest, highest = (_NARROW_STEP, _NARROW_LIFT) if narrow else (1.0, 1.0)
    gap = _NARROW_GAP if narrow else 0.0
    return replace(
        parameters,
        dt=_TORQUE_DT,
        stoop_max=TeleopParameters().stoop_max,
        fold_min=_TORQUE_FOLD,
        step_max=farthest * parameters.step_max,
        lift_max=highest * parameters.lift_max,
        feet_gap=max(parameters.feet_gap, gap * height),
    )
