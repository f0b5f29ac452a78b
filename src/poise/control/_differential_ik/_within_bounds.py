"""`solve_within_bounds`: the closed form with joints held at their bounds."""

from collections.abc import Sequence
from itertools import count

import numpy as np
from jaxtyping import Bool, Float64

from poise.control._differential_ik._closed_form import RANK, VelocityLevel, solve_levels
from poise.control._rank import RankTreatment

_SLACK = 1e-9
"""How far outside its bounds a joint may be by rounding [rad/s]; it is clipped afterwards."""

_SINGLY = 5
"""Joints that are held one by one; a joint held too many costs a task near a limit dearly."""

_FAR = 0.5
"""Beyond `_SINGLY`, joints this fraction as far outside as the farthest are held together with it.

A round a joint takes long where too much is asked of all, and there it is not measurably better."""

_MISSED = 1e-3
"""Velocity that the exact levels may miss before lower levels are let go for them [unit/s].

Two ankles at their limits differ by noise, and the legs' closed chain cannot follow both: nothing
to drop a posture for."""

_SLIPPED = 1e-6
"""Velocity that the first level, the contacts, may miss before the rest slows down [unit/s]."""


def solve_within_bounds(
    levels: Sequence[VelocityLevel],
    joint_weight: Float64[np.ndarray, " n"],
    lower: Float64[np.ndarray, " n"],
    upper: Float64[np.ndarray, " n"],
    *,
    exact: int = 1,
    rank: RankTreatment = RANK,
) -> tuple[Float64[np.ndarray, " n"], Bool[np.ndarray, " n"]]:
    """`solve_levels` with joint velocities inside their bounds.

    Where joints would leave their bounds, those farthest outside are held at their bounds and the
    others make up for them, level by level, until none is outside. Where that costs the exact
    levels something, levels are let go from the bottom up for as long as it helps. Where even the
    first level, the contacts, would be missed, everything else slows down in proportion instead.
    A good answer, not always the best: the hierarchical QP finds that.

    Args:
        levels: most important first.
        joint_weight: diagonal of W_B.
        lower: lower bounds of the joint velocities [rad/s].
        upper: upper bounds, not below the lower ones.
        exact: how many levels are met exactly where that is possible.
        rank: what happens to directions that are lost.

    Returns:
        Joint velocities [rad/s], and which joints are held.
    """
    levels = list(levels)
    u, held = _hold(levels, joint_weight, lower, upper, exact, rank)
    if not held.any():
        return u, held
    missed = _missed(levels[:exact], u)
    depth = len(levels) - 1
    while missed > _MISSED and depth >= exact:
        # A lower level may have spent the joints that an exact one needed.
        other, other_held = _hold(levels[:depth], joint_weight, lower, upper, exact, rank)
        other_missed = _missed(levels[:exact], other)
        if other_missed < missed - _MISSED:
            u, held, missed = other, other_held, other_missed
        depth -= 1
    if _missed(levels[:1], u) > _SLIPPED:
        u = _slowed(levels, joint_weight, lower, upper, exact, rank)
    return u, held


def _hold(
    levels: list[VelocityLevel],
    joint_weight: Float64[np.ndarray, " n"],
    lower: Float64[np.ndarray, " n"],
    upper: Float64[np.ndarray, " n"],
    exact: int,
    rank: RankTreatment,
) -> tuple[Float64[np.ndarray, " n"], Bool[np.ndarray, " n"]]:
    """Joints held, those farthest outside first, until none is outside."""
    held = np.zeros(len(lower), dtype=np.bool_)
    fixed = np.zeros(len(lower))
    u = solve_levels(levels, joint_weight, exact=exact, rank=rank)
    for round_ in count():
        outside = np.maximum(u - upper, lower - u)
        outside[held] = 0.0
        worst = outside.max()
        if not worst > _SLACK:
            break
        far = outside >= (worst if round_ < _SINGLY else _FAR * worst)
        held |= far
        fixed[far] = np.where(u > upper, upper, lower)[far]
        left = [
            level._replace(velocity=level.velocity - level.jacobian @ fixed) for level in levels
        ]
        u = fixed + solve_levels(left, np.where(held, np.inf, joint_weight), exact=exact, rank=rank)
    return np.minimum(np.maximum(u, lower), upper), held


def _slowed(
    levels: list[VelocityLevel],
    joint_weight: Float64[np.ndarray, " n"],
    lower: Float64[np.ndarray, " n"],
    upper: Float64[np.ndarray, " n"],
    exact: int,
    rank: RankTreatment,
) -> Float64[np.ndarray, " n"]:
    """From what serves the first level alone, as far towards all levels as the bounds allow."""
    least, _ = _hold(levels[:1], joint_weight, lower, upper, exact, rank)
    step = solve_levels(levels, joint_weight, exact=exact, rank=rank) - least
    room = np.where(step > 0.0, upper - least, lower - least)
    moves = step != 0.0
    ratio = np.divide(room, step, out=np.ones(len(step)), where=moves)
    return np.minimum(np.maximum(least + min(1.0, float(ratio.min())) * step, lower), upper)


def _missed(levels: Sequence[VelocityLevel], u: Float64[np.ndarray, " n"]) -> float:
    missing = [level.velocity - level.jacobian @ u for level in levels]
    return float(np.sqrt(sum(m.dot(m) for m in missing)))
