"""A planar arm that goes through its stretched posture: the textbook's singularity."""

from collections.abc import Generator
from functools import partial

import numpy as np
from jaxtyping import Float64

from benchmarks.hqp.source import Progress, Source
from benchmarks.hqp.velocity_problem import equalities, velocity_problem
from poise.hqp import HierarchicalProblem

_DT = 0.005
"""Time between two problems [s]."""

_RATE = 1.0
"""How fast the first elbow goes through zero [rad/s]; those behind it go slower."""

_FASTEST = 2.0
"""Velocity limit of every joint [rad/s]."""

_OUT, _ASIDE = 0.3, 0.2
"""Velocity of the hand that is wanted, along the stretched arm and across it [m/s]."""

_POSTURE_GAIN, _BEND = 2.0, 0.5
"""The posture is held by this gain [1/s] towards elbows that are bent so far [rad]."""


def planar_problems(
    links: int, count: int, progress: Progress | None = None
) -> Generator[HierarchicalProblem]:
    """The hand's position first, the posture second, within velocity limits.

    The elbows go through zero together; at problem number `count // 2` the arm is stretched, and
    the hand still wants to go on.

    Args:
        links: of the arm, each as long as the others, 1 m together.
        count: how many ticks.
        progress: told how many are done.
    """
    share = 1.0 / np.arange(1, links)
    rest = np.concatenate(([0.3], np.full(links - 1, _BEND)))
    bound = np.full(links, _FASTEST)
    for tick in range(count):
        elbow = _RATE * _DT * (count // 2 - tick)
        q = np.concatenate(([0.3], elbow * share))
        along = np.array([np.cos(0.3), np.sin(0.3)])
        across = np.array([-along[1], along[0]])
        hand = equalities("hand", hand_jacobian(q), _OUT * along + _ASIDE * across)
        posture = equalities("posture", np.eye(links), _POSTURE_GAIN * (rest - q))
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


SOURCES = tuple(
    Source(
        name=f"ik-planar-{links}",
        family="inverse kinematics",
        description=f"A planar arm of {links} links goes through its stretched posture.",
        consecutive=True,
        make=partial(planar_problems, links),
    )
    for links in (3, 5, 7)
)
"""Sequences of planar arms."""
