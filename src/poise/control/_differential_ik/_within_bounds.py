"""`solve_within_bounds`: the closed form with joints held at their bounds."""

from collections.abc import Sequence
from itertools import count

import numpy as np
from jaxtyping import Bool, Float64

from poise.control._differential_ik._closed_form import RANK, ClosedForm
from poise.control._differential_ik._kernels import VelocityLevel, VelocityLevels
from poise.control._excess import excess
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
    """
    form = ClosedForm(len(joint_weight), exact, rank)
    return hold_within_bounds(form, VelocityLevels.of(levels), joint_weight, lower, upper)


def hold_within_bounds(
    form: ClosedForm,
    levels: VelocityLevels,
    joint_weight: Float64[np.ndarray, " n"],
    lower: Float64[np.ndarray, " n"],
    upper: Float64[np.ndarray, " n"],
) -> tuple[Float64[np.ndarray, " n"], Bool[np.ndarray, " n"]]:
    """`solve_within_bounds` by a closed form that is there already."""
    u, held = _hold(form, levels, joint_weight, lower, upper)
    if not held.any():
        return u, held
    missed = _missed(levels, form.exact, u)
    depth = len(levels.ends) - 2
    while missed > _MISSED and depth >= form.exact:
        # A lower level may have spent the joints that an exact one needed.
        other, other_held = _hold(form, _first(levels, depth), joint_weight, lower, upper)
        other_missed = _missed(levels, form.exact, other)
        if other_missed < missed - _MISSED:
            u, held, missed = other, other_held, other_missed
        depth -= 1
    if _missed(levels, 1, u) > _SLIPPED:
        u = _slowed(form, levels, joint_weight, lower, upper)
    return u, held


def _first(levels: VelocityLevels, count: int) -> VelocityLevels:
    """The first levels alone."""
    return levels._replace(ends=levels.ends[: count + 1])


def _hold(
    form: ClosedForm,
    levels: VelocityLevels,
    joint_weight: Float64[np.ndarray, " n"],
    lower: Float64[np.ndarray, " n"],
    upper: Float64[np.ndarray, " n"],
) -> tuple[Float64[np.ndarray, " n"], Bool[np.ndarray, " n"]]:
    """Joints held, those farthest outside first, until none is outside."""
    held = np.zeros(len(lower), dtype=np.bool_)
    u = form.solve(levels, joint_weight)
    if excess(u, 0, lower, upper) > _SLACK:
        u = _held_one_by_one(form, levels, joint_weight, lower, upper, u, held)
    return np.minimum(np.maximum(u, lower), upper), held


def _held_one_by_one(
    form: ClosedForm,
    levels: VelocityLevels,
    joint_weight: Float64[np.ndarray, " n"],
    lower: Float64[np.ndarray, " n"],
    upper: Float64[np.ndarray, " n"],
    u: Float64[np.ndarray, " n"],
    held: Bool[np.ndarray, " n"],
) -> Float64[np.ndarray, " n"]:
    """Velocities with those joints held that would be outside, which `held` receives."""
    fixed = np.zeros(len(lower))
    for round_ in count():
        outside = np.maximum(u - upper, lower - u)
        outside[held] = 0.0
        worst = outside.max()
        if not worst > _SLACK:
            break
        far = outside >= (worst if round_ < _SINGLY else _FAR * worst)
        held |= far
        fixed[far] = np.where(u > upper, upper, lower)[far]
        left = levels._replace(velocity=levels.velocity - levels.jacobian @ fixed)
        u = fixed + form.solve(left, np.where(held, np.inf, joint_weight))
    return u


def _slowed(
    form: ClosedForm,
    levels: VelocityLevels,
    joint_weight: Float64[np.ndarray, " n"],
    lower: Float64[np.ndarray, " n"],
    upper: Float64[np.ndarray, " n"],
) -> Float64[np.ndarray, " n"]:
    """From what serves the first level alone, as far towards all levels as the bounds allow."""
    least, _ = _hold(form, _first(levels, 1), joint_weight, lower, upper)
    step = form.solve(levels, joint_weight) - least
    room = np.where(step > 0.0, upper - least, lower - least)
    moves = step != 0.0
    ratio = np.divide(room, step, out=np.ones(len(step)), where=moves)
    return np.minimum(np.maximum(least + min(1.0, float(ratio.min())) * step, lower), upper)


def _missed(levels: VelocityLevels, count: int, u: Float64[np.ndarray, " n"]) -> float:
    """Norm of the velocity that the first levels miss."""
    end = int(levels.ends[: count + 1][-1])
    missing = levels.velocity[:end] - levels.jacobian[:end] @ u
    return float(np.sqrt(missing.dot(missing)))
