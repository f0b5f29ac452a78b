"""`LegGeometry`: a leg as hip, knee and ankle, with what limits where its sole can be."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from poise.dynamics.dynamics import Dynamics
from poise.dynamics.state import RobotState
from poise.robots.robot import Robot
from poise.teleop.parameters import knee_limits, leg_joints

_HIP_JOINTS = 3
"""The first three joints of a leg are the hip's, in any order."""

_PITCH, _ROLL = 1, 0
"""Axes of the ankle in the body: across the leg and along the foot."""


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
    lower, upper = knee_limits(robot, [joints], knee_min)
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
