"""`LimitedLevels`: levels in closed form, and rows J u >= v that may not be broken."""

import numpy as np
from jaxtyping import Bool, Float64, Int64

from poise._compiled import compiled, part
from poise.control._differential_ik._closed_form import ClosedForm
from poise.control._differential_ik._kernels import (
    VelocityLevel,
    VelocityLevels,
    Work,
    serve_levels,
)
from poise.control._differential_ik._within_bounds import hold_within_bounds

_BROKEN = 1e-6
"""How far below its bound a row may be before it is held [m/s]."""

_NO_MOBILITY = 1e-6
"""Velocity of a row for a radian a second below which nothing moves it [m]."""

_ROUNDS = 3
"""How often rows are looked for: joints that come to rest at their bounds may break others."""


class LimitedLevels:
    """Levels, and the rows of the self-collision limit, which stand below the first of them.

    Rows that would be broken are held at their bounds, the worst first, as one more level below
    the contacts and above all that tasks ask for, until none is broken. Joints' bounds come before
    them: what those leave no room for is missed, and contacts are held all the same. Rows are
    looked for by compiled code, whatever their number, and three times at most.
    """

    def __init__(self, levels: VelocityLevels, limits: VelocityLevel) -> None:
        self._levels, self._limits = levels, limits
        n, size = levels.jacobian.shape[1], len(levels.velocity) + len(limits.velocity)
        ends = np.zeros(len(levels.ends) + 1, dtype=np.int64)
        weight, scale = np.ones((2, size))
        self._joined = VelocityLevels(np.zeros((size, n)), np.zeros(size), weight, scale, ends)
        self._order = np.zeros(len(limits.velocity), dtype=np.int64)
        self._free = np.zeros(n)

    def hold(
        self,
        form: ClosedForm,
        joined_form: ClosedForm,
        joint_weight: Float64[np.ndarray, " n"],
        lower: Float64[np.ndarray, " n"],
        upper: Float64[np.ndarray, " n"],
    ) -> tuple[Float64[np.ndarray, " n"], Bool[np.ndarray, " n"]]:
        """`hold_within_bounds`, with no row broken that can be kept."""
        bounds = joint_weight, lower, upper
        u, held = hold_within_bounds(form, self._levels, *bounds)
        taken = 0
        for _ in range(_ROUNDS if len(self._order) else 0):
            before, taken = taken, self._take(joined_form, joint_weight, u, taken)
            if taken == before:
                break
            u, held = hold_within_bounds(joined_form, self._joined, *bounds)
        return u, held

    def compile(self, form: ClosedForm) -> None:
        """Looks for rows where none is broken, so that nothing is compiled in a tick."""
        self._take(form, np.ones(len(self._free)), np.full(len(self._free), np.nan), 0)

    def _take(
        self,
        form: ClosedForm,
        joint_weight: Float64[np.ndarray, " n"],
        u: Float64[np.ndarray, " n"],
        taken: int,
    ) -> int:
        self._free[:] = u
        settings = form.exact, form.rank.high
        rows = self._levels, self._limits, self._joined, self._order
        return _take_rows(*rows, taken, joint_weight, *settings, form.work, self._free)


@compiled
def _take_rows(
    levels: VelocityLevels,
    limits: VelocityLevel,
    joined: VelocityLevels,
    order: Int64[np.ndarray, " rows"],
    taken: int,
    joint_weight: Float64[np.ndarray, " n"],
    exact: int,
    least: float,
    work: Work,
    u: Float64[np.ndarray, " n"],
) -> int:
    """Takes rows up, the worst first, until an answer without joints' bounds breaks none."""
    while taken < len(order):
        worst = _worst(limits, order, taken, u)
        if worst < 0:
            break
        order[taken] = worst
        taken += 1
        _join(levels, limits, joined, order, taken)
        served, _ = serve_levels(joined, joint_weight, exact, least, work, u)
        if served < len(joined.ends) - 1:
            break
    return taken


@part
def _worst(
    limits: VelocityLevel,
    order: Int64[np.ndarray, " rows"],
    taken: int,
    u: Float64[np.ndarray, " n"],
) -> int:
    """The row that is broken by most, -1 for none; NaN breaks none."""
    worst, most = -1, _BROKEN
    for row in range(len(limits.velocity)):
        own, rate, square = limits.jacobian[row], 0.0, 0.0
        for k in range(len(u)):
            rate += own[k] * u[k]
            square += own[k] * own[k]
        known = not square > _NO_MOBILITY * _NO_MOBILITY
        for k in range(taken):
            known = known or order[k] == row
        if limits.velocity[row] - rate > most and not known:
            worst, most = row, limits.velocity[row] - rate
    return worst


@part
def _join(
    levels: VelocityLevels,
    limits: VelocityLevel,
    joined: VelocityLevels,
    order: Int64[np.ndarray, " rows"],
    taken: int,
) -> None:
    """Puts rows that were taken up below the first level, one below the other."""
    first = int(levels.ends[1])
    for row in range(first):
        _copy(levels, row, joined, row)
    for i in range(taken):
        own, place, square = limits.jacobian[order[i]], first + i, 0.0
        for k in range(len(own)):
            joined.jacobian[place, k] = own[k]
            square += own[k] * own[k]
        joined.velocity[place] = limits.velocity[order[i]]
        joined.weight[place] = limits.weight[order[i]]
        joined.scale[place] = 1.0 / np.sqrt(square)
    for row in range(first, int(levels.ends[-1])):
        _copy(levels, row, joined, row + taken)
    joined.ends[0], joined.ends[1] = 0, first
    for i in range(1, len(levels.ends)):
        joined.ends[i + 1] = levels.ends[i] + taken


@part
def _copy(levels: VelocityLevels, row: int, joined: VelocityLevels, place: int) -> None:
    """Copies a row of the levels."""
    for k in range(levels.jacobian.shape[1]):
        joined.jacobian[place, k] = levels.jacobian[row, k]
    joined.velocity[place] = levels.velocity[row]
    joined.weight[place] = levels.weight[row]
    joined.scale[place] = levels.scale[row]
