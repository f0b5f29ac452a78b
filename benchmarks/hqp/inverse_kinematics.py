"""Prioritised joint velocities as hierarchical problems: arms at singularities, a humanoid.

The humanoid's hierarchy is that of the experiments of (Escande, Mansard, Wieber 2014, "Hierarchical
quadratic programming: Fast online humanoid-robot motion generation"), at the velocity level: joint
limits and the CoM's support as inequalities, reaching and gaze below them.
"""

import math
from collections.abc import Generator, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from benchmarks.hqp.problem_set import Make, Progress, Source
from poise.dynamics import Dynamics, RobotState
from poise.hqp import HierarchicalProblem, Level, make_solver
from poise.robots import Robot, load_robot
from poise.stack import JointLimit

_ARM_DT, _HUMANOID_DT = 0.005, 0.01
"""Time between two problems of an arm, and of the humanoid [s]."""

_JOINT_RATE = 1.0
"""How fast the joint at an arm's singularity moves; of a planar arm the first elbow [rad/s]."""

_LIMIT_TIME = 0.1
"""Time in which no joint may go farther than its limit [s]."""


def velocity_problem(
    tasks: Sequence[Level], lower: Float64[np.ndarray, " n"], upper: Float64[np.ndarray, " n"]
) -> HierarchicalProblem:
    """Joint limits first, then tasks, then the least velocity.

    Args:
        tasks: rows J u = v, most important first.
        lower: of the velocities [rad/s]; -inf where there is no bound.
        upper: likewise.
    """
    n = len(lower)
    limits = Level(np.zeros((0, n)), 0.0, 0.0, name="joint limits")
    return HierarchicalProblem([limits, *tasks], None, None, lower, upper)


def velocity_bounds(
    robot: Robot, q: Float64[np.ndarray, " n"], limit: JointLimit
) -> tuple[Float64[np.ndarray, " n"], Float64[np.ndarray, " n"]]:
    """Least and greatest joint velocities that keep position and velocity limits [rad/s].

    Args:
        robot: whose joints.
        q: their angles [rad].
        limit: position margin and velocity scale.
    """
    v_max = limit.velocity_scale * robot.v_max
    lower = (robot.q_min + limit.position_margin - q) * (1.0 / _LIMIT_TIME)
    upper = (robot.q_max - limit.position_margin - q) * (1.0 / _LIMIT_TIME)
    return np.clip(lower, -v_max, v_max), np.clip(upper, -v_max, v_max)


def equalities(
    name: str, J: Float64[np.ndarray, "m n"], velocity: Float64[np.ndarray, " m"]
) -> Level:
    """A task J u = velocity."""
    return Level(J, velocity, velocity, name=name, labels=name)


_PLANAR_FASTEST = 2.0
"""Velocity limit of every joint [rad/s]."""

_OUT, _ASIDE = 0.3, 0.2
"""Velocity of the hand that is wanted, along the stretched arm and across it [m/s]."""

_PLANAR_GAIN, _BEND = 2.0, 0.5
"""The posture is held by this gain [1/s] towards elbows that are bent so far [rad]."""


def planar_problems(
    links: int, count: int, progress: Progress | None = None
) -> Generator[HierarchicalProblem]:
    """The hand's position first, the posture second, within velocity limits.

    The elbows go through zero together; at problem number `count // 2` the arm is stretched, and
    the hand still wants to go on.
    """
    share = 1.0 / np.arange(1, links)
    rest = np.concatenate(([0.3], np.full(links - 1, _BEND)))
    bound = np.full(links, _PLANAR_FASTEST)
    for tick in range(count):
        elbow = _JOINT_RATE * _ARM_DT * (count // 2 - tick)
        q = np.concatenate(([0.3], elbow * share))
        along = np.array([np.cos(0.3), np.sin(0.3)])
        across = np.array([-along[1], along[0]])
        hand = equalities("hand", hand_jacobian(q), _OUT * along + _ASIDE * across)
        posture = equalities("posture", np.eye(links), _PLANAR_GAIN * (rest - q))
        yield velocity_problem([hand, posture], -bound, bound)
        if progress is not None:
            progress(tick + 1, count)


def hand_jacobian(q: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, "2 n"]:
    """Jacobian of the hand's position of an arm of equal links, 1 m together.

    Args:
        q: angle of each joint against the link before it [rad].
    """
    angle = np.cumsum(q)
    steps = np.stack([np.cos(angle), np.sin(angle)]) / len(q)
    # What a joint moves is what lies behind it.
    behind = np.cumsum(steps[:, ::-1], axis=1)[:, ::-1]
    return np.stack([-behind[1], behind[0]])


_SPEED = 0.5
"""Speed of each hand, in the direction that the singularity takes away [m/s and rad/s]."""

_ARM_GAIN = 1.0
"""Gain by which the joints are drawn to where the singularity is [1/s]."""

_LOST = 1e-9
"""Share of the largest singular value below which a direction is lost."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Singularity:
    """A posture in which a hand loses a direction."""

    robot: str  # name of a robot with a fixed base
    posture: dict[str, float]  # joint angles there, those not named as at home [rad]
    # Signs by which joints leave it
    leaves: dict[str, float] = field(default_factory=dict[str, float])
    trunk: str | None = None  # a frame that is held above the hands; None for none


def singular_problems(
    singularity: Singularity, count: int, progress: Progress | None = None
) -> Generator[HierarchicalProblem]:
    """Poses of all hands within joint limits, then posture; a trunk that is held comes first.

    The joints come, at problem number `count // 2` they are at the singularity, and go again.
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
        q = there + _JOINT_RATE * _ARM_DT * abs(tick - count // 2) * way
        dynamics.update(RobotState(q, np.zeros(robot.nv)))
        levels: list[Level] = []
        if singularity.trunk is not None:
            J = dynamics.frame(robot.frame_id(singularity.trunk)).jacobian
            levels.append(equalities("trunk", J, np.zeros(6)))
        hands = np.vstack(hand_jacobians(robot, dynamics))
        levels.append(equalities("hands", hands, wanted))
        levels.append(equalities("posture", np.eye(robot.nj), _ARM_GAIN * (there - q)))
        yield velocity_problem(levels, *velocity_bounds(robot, q, JointLimit()))
        if progress is not None:
            progress(tick + 1, count)


def hand_jacobians(robot: Robot, dynamics: Dynamics) -> list[Float64[np.ndarray, "6 nv"]]:
    """Jacobians of the robot's hands."""
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


_ROBOT, _HEAD = "humanoid33", "head_link"

_GAIN, _FASTEST = 2.0, 0.4
"""Gain of hands and gaze [1/s], and largest speed of a hand [m/s]."""

_POSTURE_GAIN = 0.5
"""Gain of the posture [1/s]."""

_SUPPORT = np.array([0.06, 0.08])
"""Half the size of the rectangle above which the CoM must stay [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reach:
    """Courses of hands and eyes."""

    right: tuple[float, float, float]  # target of the right hand [m]
    left: tuple[float, float, float]  # of the left hand [m]
    gaze: tuple[float, float, float]  # point to look at [m]
    speed: float = 1.0  # share of the joints' velocity limits that may be used
    before: int = 150  # ticks before the first problem that is kept


def humanoid_problems(
    reach: Reach, count: int, progress: Progress | None = None
) -> Generator[HierarchicalProblem]:
    """Follows the velocities that are solved for, and keeps the problems after a while.

    level 1   joint limits
    level 2   both feet stay, the CoM stays above its rectangle
    level 3   right hand
    level 4   left hand
    level 5   gaze
    level 6   posture
    """
    robot = load_robot(_ROBOT)
    dynamics, solver = Dynamics(robot), make_solver("direct")
    middle = dynamics.com[:2].copy()
    limit = JointLimit(velocity_scale=reach.speed)
    q = robot.q_home.copy()
    for tick in range(reach.before + count):
        dynamics.update(RobotState(q, np.zeros(robot.nv)))
        problem = _problem(robot, dynamics, reach, middle, limit)
        if tick >= reach.before:
            yield problem
        q = pin.integrate(robot.model, q, _HUMANOID_DT * solver.solve(problem).x)
        if progress is not None:
            progress(tick + 1, reach.before + count)


def _problem(
    robot: Robot,
    dynamics: Dynamics,
    reach: Reach,
    middle: Float64[np.ndarray, "2"],
    limit: JointLimit,
) -> HierarchicalProblem:
    nv, nj = robot.nv, robot.nj
    q = dynamics.state.q[-nj:]
    free = np.full(nv - nj, np.inf)
    lower, upper = velocity_bounds(robot, q, limit)
    levels = [_support(robot, dynamics, middle)]
    for hand, target in zip(reversed(robot.hands), (reach.right, reach.left), strict=True):
        frame = dynamics.frame(robot.frame_id(hand))
        velocity = _GAIN * (np.array(target) - frame.position)
        velocity *= _FASTEST / max(_FASTEST, math.sqrt(float(velocity.dot(velocity))))
        levels.append(equalities(hand, frame.jacobian[:3], velocity))
    levels.append(_gaze(robot, dynamics, np.array(reach.gaze)))
    posture = np.hstack([np.zeros((nj, nv - nj)), np.eye(nj)])
    levels.append(equalities("posture", posture, _POSTURE_GAIN * (robot.q_home[-nj:] - q)))
    return velocity_problem(levels, np.concatenate((-free, lower)), np.concatenate((free, upper)))


def _support(robot: Robot, dynamics: Dynamics, middle: Float64[np.ndarray, "2"]) -> Level:
    """Feet that stay, as equalities, and a CoM that goes no farther than its rectangle."""
    feet = np.vstack([dynamics.frame(robot.frame_id(sole)).jacobian for sole in robot.soles])
    still, away = np.zeros(len(feet)), dynamics.com[:2] - middle
    return Level(
        np.vstack([feet, dynamics.com_jacobian[:2]]),
        np.concatenate((still, (-_SUPPORT - away) / _LIMIT_TIME)),
        np.concatenate((still, (_SUPPORT - away) / _LIMIT_TIME)),
        name="support",
        labels=[("feet", len(feet)), ("CoM above its rectangle", 2)],
    )


def _gaze(robot: Robot, dynamics: Dynamics, point: Float64[np.ndarray, "3"]) -> Level:
    """The point lies ahead: its direction has no part along the head's y and z axes.

    With r from the head to the point, d(R^T r)/dt = R^T (r x w - v) for head velocity v, w.
    """
    head = dynamics.frame(robot.frame_id(_HEAD))
    r = point - head.position
    distance = float(np.linalg.norm(r))
    J = head.rotation.T @ (pin.skew(r) @ head.jacobian[3:] - head.jacobian[:3]) / distance
    direction = head.rotation.T @ r / distance
    return equalities("gaze", J[1:], -_GAIN * direction[1:])


def _source(name: str, description: str, make: Make) -> Source:
    return Source(
        name=f"ik-{name}",
        family="inverse kinematics",
        description=description,
        consecutive=True,
        make=make,
    )


def _at_singularity(name: str, about: str, singularity: Singularity) -> Source:
    words = f"{about}; {singularity.robot}, poses of hands before posture."
    return _source(name, words, partial(singular_problems, singularity))


PLANAR = tuple(
    _source(
        f"planar-{links}",
        f"A planar arm of {links} links goes through its stretched posture.",
        partial(planar_problems, links),
    )
    for links in (3, 5, 7)
)

SINGULAR = (
    _at_singularity(
        "arm6-wrist",
        "Two axes of a wrist come into line",
        Singularity(
            robot="arm6",
            posture={"joint2": 0.5, "joint3": 1.2, "joint5": 0.0},
            leaves={"joint5": 1.0},
        ),
    ),
    _at_singularity(
        "arm6-elbow",
        "An elbow is stretched",
        Singularity(
            robot="arm6",
            posture={"joint2": 0.5, "joint3": 0.0, "joint5": 0.8},
            leaves={"joint3": 1.0},
        ),
    ),
    _at_singularity(
        "panda-shoulder",
        "The upper arm of seven axes points straight up",
        Singularity(
            robot="panda",
            posture={"panda_joint2": 0.0, "panda_joint3": 0.5 * np.pi},
            leaves={"panda_joint2": -1.0},
        ),
    ),
    _at_singularity(
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

HUMANOID = tuple(
    _source(
        f"humanoid-{name}",
        f"humanoid33: feet, CoM, two hands, gaze and posture; {about}.",
        partial(humanoid_problems, reach),
    )
    for name, about, reach in (
        (
            "reach",
            "everything but the posture can be met",
            Reach(right=(0.35, -0.25, 0.9), left=(0.35, 0.25, 0.9), gaze=(1.5, 0.3, 1.2)),
        ),
        (
            "conflict",
            "hands that want farther than they reach, joints that may not go fast",
            Reach(
                right=(0.5, -1.6, 0.9),
                left=(0.5, 1.6, 0.9),
                gaze=(1.5, 0.3, 1.2),
                speed=0.03,
                before=80,
            ),
        ),
        (
            "overstretched",
            "stretched arms that nothing damps, so that many limits change every tick",
            Reach(right=(0.5, -1.6, 0.9), left=(0.5, 1.6, 0.9), gaze=(-1.0, 1.0, 1.2)),
        ),
    )
)

SOURCES = (*PLANAR, *SINGULAR, *HUMANOID)
"""Sequences of planar arms, of arms at singularities, and of a humanoid."""
