"""`Biped`: of a robot what the step teleoperator looks up once, and not every tick.

`LegGeometry`: a leg as hip, knee and ankle, with what limits where its sole can be.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from poise.dynamics import Dynamics, RobotState
from poise.errors import ConfigurationError
from poise.locomotion._stepping._stance._size import RobotSize
from poise.locomotion._support import two_soles
from poise.robots import GRAVITY, Robot

_HIP_JOINTS = 3
"""The first three joints of a leg are the hip's, in any order."""

KNEE = _HIP_JOINTS
"""Place of the knee among the joints of a leg: behind the hip's three."""

_BASE_JOINT = 1
"""Pinocchio's index of the floating base; joint 0 is the world."""

_KNEE_MIN = 0.08
"""Least bend of a knee: straighter the leg is singular [rad]."""

_PITCH, _ROLL = 1, 0
"""Axes of the ankle in the body: across the leg and along the foot."""


def leg_joints(robot: Robot, sole: str) -> list[int]:
    """Joints from the hip to a sole, as indices among the robot's joints; a waist is no part."""
    # Joint 0 is the world, joint 1 the floating base.
    joints = [j - 2 for j in robot.leg_joints(sole)]
    if len(joints) < 6:
        raise ConfigurationError(
            f"the leg of {sole} has too few joints for step teleoperation",
            got=[robot.joint_names[j] for j in joints],
            wanted="six joints or more",
        )
    return joints


@dataclass(frozen=True, kw_only=True, eq=False)
class LegGeometry:
    """Thigh and shank between ankle and hip, the point nearest to the axes of the hip's joints."""

    hip: Float64[np.ndarray, "3"]  # in the pelvis's frame [m]
    ankle: Float64[np.ndarray, "3"]  # origin of the last joint, in the sole's frame [m]
    length: float  # from hip to ankle with the knee as straight as it may be [m]
    thigh: float  # from hip to knee [m]
    shank: float  # from knee to ankle [m]
    knee_range: tuple[float, float]  # angles of the knee that leave it bent [rad]
    lean_max: float  # largest lean of the shank forward over a level sole [rad]
    roll_max: float  # largest lean to either side [rad]
    knee_lever: float  # distance of the knee from the line of the weight at which it holds all [m]
    relief: float  # lean of the body over the stance foot that a weak hip needs [rad]


def leg_geometry(robot: Robot, sole: str) -> LegGeometry:
    """Measures a leg, with its knee as straight as it may be and the others near to zero."""
    joints = leg_joints(robot, sole)
    lower, upper = robot.q_min[joints].copy(), robot.q_max[joints].copy()
    dynamics = Dynamics(robot)
    knee_range = _knee_range(dynamics, sole)
    relief = _hip_relief(dynamics, sole)
    lower[KNEE], upper[KNEE] = max(lower[KNEE], knee_range[0]), min(upper[KNEE], knee_range[1])
    angles = np.clip(0.0, lower, upper)
    hip, axes = _leg_at(dynamics, sole, angles)
    origins = np.array([dynamics.joint_position(j + 2) for j in joints])
    foot, pelvis = (
        dynamics.frame(robot.frame_id(sole)),
        dynamics.frame(robot.frame_id(robot.pelvis)),
    )
    knee, ankle = origins[KNEE], origins[-1]
    return LegGeometry(
        hip=pelvis.rotation.T @ (hip - pelvis.position),
        ankle=foot.rotation.T @ (ankle - foot.position),
        length=float(np.linalg.norm(ankle - hip)),
        thigh=float(np.linalg.norm(knee - hip)),
        shank=float(np.linalg.norm(ankle - knee)),
        knee_range=knee_range,
        lean_max=_range_about(axes @ foot.rotation, _PITCH, lower, upper)[0],
        roll_max=min(_range_about(axes @ foot.rotation, _ROLL, lower, upper)),
        knee_lever=_knee_lever(robot, joints),
        relief=relief,
    )


_KNEE_LOAD = 0.7
"""Part of the knee's torque to stand with on one leg: the body is raised again by the rest, and the
other leg swung. `human` with 0.75 came down on a knee at its torque, and went on down; with 0.6 the
paper's robot came 1.5 mm near the blocks of scenario 1 by velocities, in place of 13.6."""


def _knee_lever(robot: Robot, joints: list[int]) -> float:
    """Lever at which a knee holds all that is above it, by what of its torque it may [m]."""
    below = sum(float(robot.model.inertias[j + 2].mass) for j in joints[KNEE:])
    torque = float(robot.tau_max[joints[KNEE]])
    return _KNEE_LOAD * torque / (GRAVITY * (robot.mass - below))


_HIP_LOAD, _HIP_TURN = 0.75, 0.8
"""Parts of the hip's torque about the forward axis, and of its range inwards, to stand with."""

_RELIEF_MAX = 0.2
"""The body leans over the foot that carries by no more [rad]."""


def _hip_relief(dynamics: Dynamics, sole: str) -> float:
    """How far the body has to lean over a foot to stand on it alone, within its hip's limits [rad].

    Upright with the COM over the foot the hip is beside it by its offset y from the middle: the leg
    of length l is turned in by y / l, and the hip holds the body's weight at that lever. Leaning by
    phi takes both back: the turn by phi, the moment by the weight of the body times its height over
    the hip times phi.
    """
    robot = dynamics.robot
    joints = leg_joints(robot, sole)
    hip, axes = _leg_at(dynamics, sole, robot.q_home[7 + np.array(joints)])
    roll = max(range(_HIP_JOINTS), key=lambda j: abs(float(axes[j, _ROLL])))
    joint = joints[roll]
    pelvis, _ = dynamics.placement(robot.frame_id(robot.pelvis))
    ankle = dynamics.joint_position(joints[-1] + 2)
    model = robot.model
    leg = sum(float(model.inertias[j + 2].mass) for j in joints)
    carried = robot.mass - leg
    levers = [model.inertias[j + 2].mass * dynamics.joint_position(j + 2) for j in joints]
    middle = (robot.mass * dynamics.com - np.sum(levers, axis=0)) / carried
    offset = abs(float(hip[1] - pelvis[1]))
    # The leg's own weight, half way, has to be balanced by the body's.
    moment = GRAVITY * (carried + 0.5 * leg) * offset
    height = max(float(middle[2] - hip[2]), 0.1 * float(hip[2]))
    lacking = moment - _HIP_LOAD * float(robot.tau_max[joint]) * abs(float(axes[roll, _ROLL]))
    inwards = float(axes[roll, _ROLL]) * (1.0 if hip[1] < pelvis[1] else -1.0) > 0.0
    home = float(robot.q_home[7 + joint])
    limit = robot.q_max[joint] - home if inwards else home - robot.q_min[joint]
    turn = offset / float(hip[2] - ankle[2]) - _HIP_TURN * float(limit)
    return min(max(lacking / (GRAVITY * carried * height), turn, 0.0), _RELIEF_MAX)


def _leg_at(
    dynamics: Dynamics, sole: str, angles: Float64[np.ndarray, " n"]
) -> tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "n 3"]]:
    """Takes a leg's joints to some angles [rad]; its hip [m], and the axes of its joints."""
    robot = dynamics.robot
    joints = np.array(leg_joints(robot, sole))
    q = robot.q_home.copy()
    q[7 + joints] = angles
    dynamics.update(RobotState(q, np.zeros(robot.nv)))
    axes = dynamics.frame(robot.frame_id(sole)).jacobian[3:, robot.base_dofs + joints].T
    # Pinocchio counts the world and the floating base before the joints.
    origins = np.array([dynamics.joint_position(int(j) + 2) for j in joints[:_HIP_JOINTS]])
    return _nearest_to_lines(origins, axes[:_HIP_JOINTS]), axes


def _knee_range(dynamics: Dynamics, sole: str) -> tuple[float, float]:
    """Angles at which the knee is bent enough, on the side to which it is bent at home [rad].

    Where a model counts the angle from is its own affair, and so is the direction.
    """
    robot = dynamics.robot
    joints = leg_joints(robot, sole)
    home = robot.q_home[7 + np.array(joints)]
    hip, axes = _leg_at(dynamics, sole, home)
    axis = axes[KNEE]
    knee, ankle = (dynamics.joint_position(joints[i] + 2) for i in (KNEE, -1))
    thigh, shank = (link - axis * (axis @ link) for link in (knee - hip, ankle - knee))
    bend = math.atan2(float(axis @ np.cross(thigh, shank)), float(thigh @ shank))
    # What is left of rounding would move the limits of knees that are straight at zero.
    straight = round(float(home[KNEE]) - bend, 6)
    if bend < 0.0:
        return -math.inf, straight - _KNEE_MIN
    return straight + _KNEE_MIN, math.inf


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
    """Two feet, the joints of two legs, and a torso."""

    robot: Robot
    soles: tuple[str, str]  # names of the left and the right sole
    frames: tuple[int, int]  # of the soles
    sizes: tuple[tuple[float, float], tuple[float, float]]  # lengths and widths of the soles [m]
    base: int  # frame of the floating base
    pelvis: int  # frame of the body from which the legs hang
    torso: int  # frame
    weight: float  # m g [N]
    size: RobotSize  # at the start
    legs: tuple[str, ...]  # names of the legs' joints, the left leg's first
    knees: Mapping[str, tuple[float, float]]  # angles that leave a knee bent, by its name [rad]
    relief: tuple[float, float]  # lean over the left and the right foot to stand on it [rad]


def biped_of(robot: Robot, size: RobotSize) -> Biped:
    """Looks up what a robot walks with."""
    left, right = soles = two_soles(robot)
    left_leg, right_leg = (
        [robot.joint_names[joint] for joint in leg_joints(robot, sole)] for sole in soles
    )
    left_geometry, right_geometry = (leg_geometry(robot, sole) for sole in soles)
    return Biped(
        robot=robot,
        soles=soles,
        frames=(robot.frame_id(left), robot.frame_id(right)),
        sizes=(_size(robot, left), _size(robot, right)),
        base=robot.model.getFrameId(robot.model.names[_BASE_JOINT]),
        pelvis=robot.frame_id(robot.pelvis),
        torso=robot.frame_id(robot.torso),
        weight=robot.weight,
        size=size,
        legs=(*left_leg, *right_leg),
        knees={
            left_leg[KNEE]: left_geometry.knee_range,
            right_leg[KNEE]: right_geometry.knee_range,
        },
        relief=(left_geometry.relief, right_geometry.relief),
    )


def _size(robot: Robot, name: str) -> tuple[float, float]:
    return robot.soles[name].length, robot.soles[name].width
