"""`Biped`: of a robot what the step teleoperator looks up once, and not every tick.

`LegGeometry`: a leg as hip, knee and ankle, with what limits where its sole can be.
"""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from poise.dynamics import Dynamics, RobotState
from poise.errors import ConfigurationError
from poise.locomotion._stepping._parameters import TeleopParameters
from poise.locomotion._support import two_soles
from poise.robots import Robot
from poise.stack import JointLimit

_HIP_JOINTS = 3
"""The first three joints of a leg are the hip's, in any order."""

KNEE = 3
"""Place of the knee among the joints of a leg: behind the hip's three."""

_BASE_JOINT = 1
"""Pinocchio's index of the floating base; joint 0 is the world."""

_PITCH, _ROLL = 1, 0
"""Axes of the ankle in the body: across the leg and along the foot."""


def leg_joints(robot: Robot, sole: str) -> list[int]:
    """Joints from the base to a sole, as indices among the robot's joints.

    Raises:
        ConfigurationError: fewer than six joints: the foot cannot be placed and turned freely.
    """
    model = robot.model
    parent = model.frames[robot.frame_id(sole)].parentJoint
    # Joint 0 is the world, joint 1 the floating base.
    joints = [int(j) - 2 for j in model.supports[parent] if j > 1]
    if len(joints) < 6:
        raise ConfigurationError(
            f"the leg of {sole} has too few joints for step teleoperation",
            got=[robot.joint_names[j] for j in joints],
            wanted="six joints or more",
        )
    return joints


@dataclass(frozen=True, kw_only=True, eq=False)
class LegGeometry:
    """A leg seen as a chain of thigh and shank between hip and ankle.

    The hip is the point nearest to the axes of its three joints, where they meet if they do.

    Attributes:
        hip: in the pelvis's frame [m].
        ankle: origin of the last joint, in the sole's frame [m].
        length: from hip to ankle with the knee as straight as it may be [m].
        thigh: from hip to knee [m].
        shank: from knee to ankle [m].
        lean_max: how far the shank can lean forward over a level sole [rad].
        roll_max: how far it can lean to either side [rad].
    """

    hip: Float64[np.ndarray, "3"]
    ankle: Float64[np.ndarray, "3"]
    length: float
    thigh: float
    shank: float
    lean_max: float
    roll_max: float


def leg_geometry(robot: Robot, sole: str, knee_min: float) -> LegGeometry:
    """Measures a leg, with its joints as near to zero as they go.

    Args:
        robot: a biped.
        sole: of the leg.
        knee_min: least angle of the knee [rad].

    Raises:
        ConfigurationError: the leg has too few joints.
    """
    joints = leg_joints(robot, sole)
    lower, upper = robot.q_min[joints], robot.q_max[joints]
    lower[KNEE] = max(lower[KNEE], knee_min)
    q = robot.q_home.copy()
    q[7 + np.array(joints)] = np.clip(0.0, lower, upper)
    dynamics = Dynamics(robot)
    dynamics.update(RobotState(q, np.zeros(robot.nv)))
    # Pinocchio counts the world and the floating base before the joints.
    origins = np.array([dynamics.joint_position(j + 2) for j in joints])
    foot, pelvis = (
        dynamics.frame(robot.frame_id(sole)),
        dynamics.frame(robot.frame_id(robot.pelvis)),
    )
    axes = foot.jacobian[3:, robot.base_dofs + np.array(joints)].T
    hip = _nearest_to_lines(origins[:_HIP_JOINTS], axes[:_HIP_JOINTS])
    knee, ankle = origins[_HIP_JOINTS], origins[-1]
    return LegGeometry(
        hip=pelvis.rotation.T @ (hip - pelvis.position),
        ankle=foot.rotation.T @ (ankle - foot.position),
        length=float(np.linalg.norm(ankle - hip)),
        thigh=float(np.linalg.norm(knee - hip)),
        shank=float(np.linalg.norm(ankle - knee)),
        lean_max=_range_about(axes @ foot.rotation, _PITCH, lower, upper)[0],
        roll_max=min(_range_about(axes @ foot.rotation, _ROLL, lower, upper)),
    )


def _nearest_to_lines(
    points: Float64[np.ndarray, "k 3"], directions: Float64[np.ndarray, "k 3"]
) -> Float64[np.ndarray, "3"]:
    """The point with the least sum of squared distances from lines."""
    across = np.eye(3) - directions[:, :, None] * directions[:, None, :]
    return np.linalg.solve(across.sum(axis=0), np.einsum("kij,kj->i", across, points))


def _range_about(
    axes: Float64[np.ndarray, "n 3"],
    axis: int,
    lower: Float64[np.ndarray, " n"],
    upper: Float64[np.ndarray, " n"],
) -> tuple[float, float]:
    """How far the leg can turn over the sole about an axis of it, one way and the other [rad].

    It is the last joint about that axis, in front of the sole, that decides: what it turns the sole
    by, the leg turns back by.
    """
    joint = max(range(_HIP_JOINTS + 1, len(axes)), key=lambda j: abs(float(axes[j, axis])))
    forward, back = -float(lower[joint]), float(upper[joint])
    if axes[joint, axis] < 0.0:
        forward, back = back, forward
    return max(forward, 0.0), max(back, 0.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Biped:
    """Two feet, the joints of two legs, and a torso.

    Attributes:
        robot: all of it.
        soles: names of the left and the right sole.
        frames: their frames.
        sizes: their lengths and widths [m].
        base: frame of the floating base.
        torso: its frame.
        weight: m g [N].
        legs: names of the legs' joints, the left leg's first.
        knees: names of the knees.
    """

    robot: Robot
    soles: tuple[str, str]
    frames: tuple[int, int]
    sizes: tuple[tuple[float, float], tuple[float, float]]
    base: int
    torso: int
    weight: float
    legs: tuple[str, ...]
    knees: tuple[str, str]


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
    left_leg, right_leg = (
        [robot.joint_names[joint] for joint in leg_joints(robot, sole)] for sole in soles
    )
    return Biped(
        robot=robot,
        soles=soles,
        frames=(robot.frame_id(left), robot.frame_id(right)),
        sizes=(_size(robot, left), _size(robot, right)),
        base=robot.model.getFrameId(robot.model.names[_BASE_JOINT]),
        torso=robot.frame_id(robot.torso),
        weight=robot.weight,
        legs=(*left_leg, *right_leg),
        knees=(left_leg[KNEE], right_leg[KNEE]),
    )


def bent_knees(
    biped: Biped, parameters: TeleopParameters, margin: float | None = None
) -> JointLimit:
    """Limits that keep the knees from getting straight, where a leg is singular.

    A leg that is straight gets no shorter whatever its knee does: the trunk would bow in its place.

    Args:
        biped: the robot.
        parameters: the straightest knee.
        margin: of all joints to their limits [rad]; that of other controllers when None.
    """
    knees = dict.fromkeys(biped.knees, (parameters.knee_min, math.inf))
    if margin is None:
        return JointLimit(position_range=knees)
    return JointLimit(position_margin=margin, position_range=knees)


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
