"""Arms that touch a singularity of wrist, elbow or shoulder while the hand wants through it."""

from collections.abc import Generator
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from jaxtyping import Float64

from benchmarks.hqp.source import Progress, Source
from benchmarks.hqp.velocity_problem import equalities, velocity_bounds, velocity_problem
from poise.dynamics import Dynamics, RobotState
from poise.hqp import HierarchicalProblem, Level
from poise.robots import Robot, load_robot
from poise.stack import JointLimit

_DT = 0.005
"""Time between two problems [s]."""

_RATE = 1.0
"""How fast the joint at the singularity moves [rad/s]."""

_SPEED = 0.5
"""Speed of each hand, in the direction that the singularity takes away [m/s and rad/s]."""

_POSTURE_GAIN = 1.0
"""Gain by which the joints are drawn to where the singularity is [1/s]."""

_LOST = 1e-9
"""Share of the largest singular value below which a direction is lost."""

_LIMIT_TIME = 0.1
"""Time in which no joint may go farther than its limit [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Singularity:
    """A posture in which a hand loses a direction.

    Attributes:
        robot: name of a robot with a fixed base.
        posture: joint angles there, those not named as at home [rad].
        leaves: signs by which joints leave it.
        trunk: a frame that is held above the hands; None for none.
    """

    robot: str
    posture: dict[str, float]
    leaves: dict[str, float] = field(default_factory=dict[str, float])
    trunk: str | None = None


def singular_problems(
    singularity: Singularity, count: int, progress: Progress | None = None
) -> Generator[HierarchicalProblem]:
    """Poses of all hands within joint limits, then posture; a trunk that is held comes first.

    The joints come, at problem number `count // 2` they are at the singularity, and go again.

    Args:
        singularity: where to.
        count: how many ticks.
        progress: told how many are done.

    Raises:
        PoiseError: the robot is not installed.
    """
    robot = load_robot(singularity.robot)
    dynamics = Dynamics(robot)
    there, way = robot.q_home.copy(), np.zeros(robot.nj)
    for joint, angle in singularity.posture.items():
        there[robot.joint_index(joint)] = angle
    for joint, sign in singularity.leaves.items():
        way[robot.joint_index(joint)] = sign
    dynamics.update(RobotState(there, np.zeros(robot.nv)))
    still = _kept_still(robot, dynamics, singularity.trunk)
    wanted = np.concatenate([_SPEED * _lost(J @ still) for J in hand_jacobians(robot, dynamics)])
    for tick in range(count):
        q = there + _RATE * _DT * abs(tick - count // 2) * way
        dynamics.update(RobotState(q, np.zeros(robot.nv)))
        levels: list[Level] = []
        if singularity.trunk is not None:
            J = dynamics.frame(robot.frame_id(singularity.trunk)).jacobian
            levels.append(equalities("trunk", J, np.zeros(6)))
        hands = np.vstack(hand_jacobians(robot, dynamics))
        levels.append(equalities("hands", hands, wanted))
        levels.append(equalities("posture", np.eye(robot.nj), _POSTURE_GAIN * (there - q)))
        yield velocity_problem(levels, *velocity_bounds(robot, q, JointLimit(), _LIMIT_TIME))
        if progress is not None:
            progress(tick + 1, count)


def hand_jacobians(robot: Robot, dynamics: Dynamics) -> list[Float64[np.ndarray, "6 nv"]]:
    """Jacobians of the robot's hands.

    Args:
        robot: the robot.
        dynamics: its state, up to date.
    """
    return [dynamics.frame(robot.frame_id(hand)).jacobian for hand in robot.hands]


def _kept_still(
    robot: Robot, dynamics: Dynamics, trunk: str | None
) -> Float64[np.ndarray, "nv nv"]:
    """Takes out of joint velocities what moves the trunk."""
    if trunk is None:
        return np.eye(robot.nv)
    J = dynamics.frame(robot.frame_id(trunk)).jacobian
    return np.eye(robot.nv) - np.linalg.pinv(J) @ J


def _lost(J: Float64[np.ndarray, "6 nv"]) -> Float64[np.ndarray, "6"]:
    """A direction that no joint moves: what is lost of one along all axes alike."""
    left, values, _ = np.linalg.svd(J)
    lost = np.pad(values, (0, 6 - len(values))) < _LOST * values[0]
    direction = left[:, lost].sum(axis=0) @ left[:, lost].T
    return direction / np.linalg.norm(direction)


def _source(name: str, about: str, singularity: Singularity) -> Source:
    return Source(
        name=f"ik-{name}",
        family="inverse kinematics",
        description=f"{about}; {singularity.robot}, poses of hands before posture.",
        consecutive=True,
        make=partial(singular_problems, singularity),
    )


SOURCES = (
    _source(
        "arm6-wrist",
        "Two axes of a wrist come into line",
        Singularity(
            robot="arm6",
            posture={"joint2": 0.5, "joint3": 1.2, "joint5": 0.0},
            leaves={"joint5": 1.0},
        ),
    ),
    _source(
        "arm6-elbow",
        "An elbow is stretched",
        Singularity(
            robot="arm6",
            posture={"joint2": 0.5, "joint3": 0.0, "joint5": 0.8},
            leaves={"joint3": 1.0},
        ),
    ),
    _source(
        "panda-shoulder",
        "The upper arm of seven axes points straight up",
        Singularity(
            robot="panda",
            posture={"panda_joint2": 0.0, "panda_joint3": 0.5 * np.pi},
            leaves={"panda_joint2": -1.0},
        ),
    ),
    _source(
        "upper17-elbows",
        "Both elbows are stretched while the torso keeps still",
        Singularity(
            robot="upper17",
            posture={"left_elbow": 0.0, "right_elbow": 0.0},
            leaves={"left_elbow": -1.0, "right_elbow": -1.0},
            trunk="torso",
        ),
    ),
)
"""Sequences of arms at singularities."""
