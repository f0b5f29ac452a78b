"""`WithinBounds`: the closed form with joints held at their bounds, and rows at theirs."""

from itertools import count

import numpy as np
from jaxtyping import Bool, Float64

from poise.control._differential_ik._closed_form import ClosedForm
from poise.control._differential_ik._kernels import VelocityLevels

_SLACK = 1e-9
"""Excess of a joint's velocity over its bound that is rounding [rad/s]; it is clipped."""

_SINGLY = 5
"""Joints that are held one by one; a joint held too many costs a task near a limit dearly."""

_FAR = 0.5
"""Beyond `_SINGLY`, joints this fraction as far outside as the farthest are held together with it.

One joint a round takes long where many are outside, and there it is not measurably better."""

_MISSED = 1e-3
"""Velocity that the exact levels may miss before lower levels are dropped for them [unit/s].

Two ankles at their limits differ by noise, and the legs' closed chain cannot follow both: nothing
to drop a posture for."""

_SLIPPED = 1e-6
"""Velocity that the first level, the contacts, may miss before the rest slows down [unit/s]."""

_ROUNDS = 3
"""Searches for broken rows: joints that come to rest at their bounds may break others."""

_Held = tuple[Float64[np.ndarray, " n"], Bool[np.ndarray, " n"]]
"""Joint velocities, and which joints are held at their bounds."""


class WithinBounds:
    """Levels in closed form with joint velocities inside their bounds.

    Where joints would leave their bounds, those farthest outside are held at their bounds and the
    others make up for them, level by level, until none is outside. Where that costs the exact
    levels something, levels are dropped from the bottom up for as long as it helps. Where even the
    first level, the contacts, would be missed, everything else slows down in proportion instead.
    A good answer, not always the best: the hierarchical QP finds that.

    Rows of the self-collision limit that would be broken are held at their bounds, the worst first,
    as one more level below the contacts and above all tasks, until none is broken. Joints' bounds
    come before them: rows without room are missed, and contacts are held all the same.
    """

    def __init__(self, form: ClosedForm) -> None:
        self._form = form

    def solve(
        self,
        levels: VelocityLevels,
        joined: VelocityLevels,
        joint_weight: Float64[np.ndarray, " n"],
        lower: Float64[np.ndarray, " n"],
        upper: Float64[np.ndarray, " n"],
    ) -> _Held:
        """Return the velocities, and which joints are held; `joined` is `levels.with_limits()`."""
        self._joint_weight, self._lower, self._upper = joint_weight, lower, upper
        u, held = self._serve(levels)
        taken = 0
        for _ in range(_ROUNDS if len(levels.limits) else 0):
            before = taken
            taken = self._form.take_rows(levels, joined, joint_weight, u, taken)
            if taken == before:
                break
            u, held = self._serve(joined)
        return u, held

    def _serve(self, levels: VelocityLevels) -> _Held:
        depth = len(levels.ends) - 1
        u, held = self._hold(levels, depth)
        if not held.any():
            return u, held
        missed = _missed(levels, levels.exact, u)
        while missed > _MISSED and depth > levels.exact:
            # A lower level may have spent the joints that an exact one needed.
            depth -= 1
            other, other_held = self._hold(levels, depth)
            other_missed = _missed(levels, levels.exact, other)
            if other_missed < missed - _MISSED:
                u, held, missed = other, other_held, other_missed
        if _missed(levels, 1, u) > _SLIPPED:
            u = self._slow_down(levels)
        return u, held

    def _hold(self, levels: VelocityLevels, depth: int) -> _Held:
        """Hold joints, those farthest outside first, until the first levels leave none outside."""
        held, fixed = np.zeros(len(self._lower), dtype=np.bool_), np.zeros(len(self._lower))
        u = self._form.solve(levels, self._joint_weight, count=depth)
        for round_ in count():
            outside = np.maximum(u - self._upper, self._lower - u)
            outside[held] = 0.0
            worst = outside.max()
            if not worst > _SLACK:
                break
            far = outside >= (worst if round_ < _SINGLY else _FAR * worst)
            held |= far
            fixed[far] = np.where(u > self._upper, self._upper, self._lower)[far]
            weight = np.where(held, np.inf, self._joint_weight)
            u = fixed + self._form.solve(levels, weight, count=depth, fixed=fixed)
        return self._clip(u), held

    def _slow_down(self, levels: VelocityLevels) -> Float64[np.ndarray, " n"]:
        """Go from what serves the first level alone as far towards all as the bounds allow."""
        least, _ = self._hold(levels, 1)
        step = self._form.solve(levels, self._joint_weight) - least
        room = np.where(step > 0.0, self._upper - least, self._lower - least)
        ratio = np.divide(room, step, out=np.ones(len(step)), where=step != 0.0)
        return self._clip(least + min(1.0, float(ratio.min())) * step)

    def _clip(self, u: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " n"]:
        return np.minimum(np.maximum(u, self._lower), self._upper)


def _missed(levels: VelocityLevels, depth: int, u: Float64[np.ndarray, " n"]) -> float:
    """Return the norm of the velocity that the first levels miss."""
    rows = levels.rows[: levels.ends[: depth + 1][-1]]
    missing = levels.velocity[rows] - levels.jacobian[rows] @ u
    return float(np.sqrt(missing.dot(missing)))
