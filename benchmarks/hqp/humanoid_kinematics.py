"""A humanoid by inverse kinematics: feet, COM, two hands, gaze, posture.

The hierarchy is that of the experiments of (Escande, Mansard, Wieber 2014, "Hierarchical quadratic
programming: Fast online humanoid-robot motion generation"), at the velocity level: joint limits and
the COM's support as inequalities, reaching and gaze below them.
"""

import math
from collections.abc import Generator
from dataclasses import dataclass
from functools import partial

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from benchmarks.hqp.source import Progress, Source
from benchmarks.hqp.velocity_problem import equalities, velocity_bounds, velocity_problem
from poise.dynamics import Dynamics, RobotState
from poise.hqp import HierarchicalProblem, Level, make_solver
from poise.robots import Robot, load_robot
from poise.stack import JointLimit

_ROBOT, _HEAD = "humanoid33", "head_link"

_DT = 0.01
"""Time between two problems [s]."""

_GAIN, _FASTEST = 2.0, 0.4
"""Gain of hands and gaze [1/s], and largest speed of a hand [m/s]."""

_POSTURE_GAIN, _LIMIT_TIME = 0.5, 0.1
"""Gain of the posture [1/s]; time in which no limit may be gone beyond [s]."""

_SUPPORT = np.array([0.06, 0.08])
"""Half the size of the rectangle above which the COM must stay [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reach:
    """Where hands and eyes go.

    Attributes:
        right: target of the right hand [m].
        left: of the left hand [m].
        gaze: point to look at [m].
        speed: share of the joints' velocity limits that may be used.
        before: ticks before the first problem that is kept.
    """

    right: tuple[float, float, float]
    left: tuple[float, float, float]
    gaze: tuple[float, float, float]
    speed: float = 1.0
    before: int = 150


def humanoid_problems(
    reach: Reach, count: int, progress: Progress | None = None
) -> Generator[HierarchicalProblem]:
    """Follows the velocities that are solved for, and keeps the problems after a while.

        level 1   joint limits
        level 2   both feet stay, the COM stays above its rectangle
        level 3   right hand
        level 4   left hand
        level 5   gaze
        level 6   posture

    Args:
        reach: where to.
        count: how many ticks.
        progress: told how many are done, those before the first problem among them.
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
        q = pin.integrate(robot.model, q, _DT * solver.solve(problem).x)
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
    lower, upper = velocity_bounds(robot, q, limit, _LIMIT_TIME)
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
    """Feet that stay, as equalities, and a COM that goes no farther than its rectangle."""
    feet = np.vstack([dynamics.frame(robot.frame_id(sole)).jacobian for sole in robot.soles])
    still, away = np.zeros(len(feet)), dynamics.com[:2] - middle
    return Level(
        np.vstack([feet, dynamics.com_jacobian[:2]]),
        np.concatenate((still, (-_SUPPORT - away) / _LIMIT_TIME)),
        np.concatenate((still, (_SUPPORT - away) / _LIMIT_TIME)),
        name="support",
        labels=[("feet", len(feet)), ("COM above its rectangle", 2)],
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


SOURCES = tuple(
    Source(
        name=f"ik-humanoid-{name}",
        family="inverse kinematics",
        description=f"humanoid33: feet, COM, two hands, gaze and posture; {about}.",
        consecutive=True,
        make=partial(humanoid_problems, reach),
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
"""Sequences of a humanoid by inverse kinematics."""
