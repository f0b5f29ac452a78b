"""`Biped`: of a robot what the step teleoperator looks up once, and not every tick."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from poise.balance.cart_table import GRAVITY
from poise.errors import ConfigurationError
from poise.robots.robot import Robot
from poise.teleop.parameters import TeleopParameters, knee_limits, leg_joints


@dataclass(frozen=True, kw_only=True, eq=False)
class Biped:
    """Two feet, the joints of two legs, and a torso.

    Attributes:
        robot: all of it.
        soles: names of the left and the right sole.
        frames: their frames.
        sizes: their lengths and widths [m].
        torso: its frame.
        weight: m g [N].
        legs: the legs' joints among the robot's, the left leg's first.
        q_min: lower limits of these, knees kept from being straight [rad].
        q_max: upper limits [rad].
        v_max: velocity limits [rad/s].
    """

    robot: Robot
    soles: tuple[str, str]
    frames: tuple[int, int]
    sizes: tuple[tuple[float, float], tuple[float, float]]
    torso: int
    weight: float
    legs: Int64[np.ndarray, " n"]
    q_min: Float64[np.ndarray, " n"]
    q_max: Float64[np.ndarray, " n"]
    v_max: Float64[np.ndarray, " n"]


def two_soles(robot: Robot) -> tuple[str, str]:
    """Names of the left and the right sole.

    Args:
        robot: any.

    Raises:
        ConfigurationError: no floating base, or no two soles.
    """
    if not robot.floating_base or len(robot.soles) < 2:
        raise ConfigurationError(
            f"robot {robot.name!r} cannot be walked",
            got=f"soles {list(robot.soles)}",
            wanted="a floating base and two soles",
        )
    left, right, *_ = robot.soles
    return left, right


def biped_of(robot: Robot, parameters: TeleopParameters) -> Biped:
    """Looks up what a robot walks with.

    Args:
        robot: a biped.
        parameters: for the robot.

    Raises:
        ConfigurationError: soles too small for `r_lift`, or legs of too few joints.
    """
    left, right = soles = two_soles(robot)
    _check_soles(robot, soles, parameters.r_lift)
    both = [leg_joints(robot, sole) for sole in soles]
    q_min, q_max = knee_limits(robot, both, parameters.knee_min)
    legs = [joint for leg in both for joint in leg]
    return Biped(
        robot=robot,
        soles=soles,
        frames=(robot.frame_id(left), robot.frame_id(right)),
        sizes=(_size(robot, left), _size(robot, right)),
        torso=robot.frame_id(robot.torso),
        weight=robot.mass * GRAVITY,
        legs=np.array(legs),
        q_min=q_min,
        q_max=q_max,
        v_max=robot.v_max[legs],
    )


def _size(robot: Robot, name: str) -> tuple[float, float]:
    return robot.soles[name].length, robot.soles[name].width


def _check_soles(robot: Robot, names: tuple[str, str], r_lift: float) -> None:
    narrowest = 0.5 * min(min(_size(robot, name)) for name in names)
    if r_lift > narrowest + 1e-9:
        raise ConfigurationError(
            "r_lift is larger than half a sole: the ZMP might be outside the other foot at a lift",
            got=r_lift,
            wanted=f"at most {narrowest:.4g} m",
        )
