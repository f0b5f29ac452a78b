"""The closed form of `solve_levels` over levels that keep their rank, compiled."""

from collections.abc import Sequence
from math import sqrt
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import compiled, factor_leading, part, solve_leading, solve_lower
from poise.control._row_factor import (
    add_row,
    factor_rows,
    fill_complement,
    keeps_rank,
    square_level,
    turn_back,
)


class VelocityLevel(NamedTuple):
    """Rows J u = v of one priority.

    Attributes:
        jacobian: J, maps joint velocities to the rows' velocities.
        velocity: v, the reference.
        weight: diagonal of W_A, for levels that give way; not negative.
        scale: what rows are multiplied by where ranks are decided, see `right_inverse`.
    """

    jacobian: Float64[np.ndarray, "m n"]
    velocity: Float64[np.ndarray, " m"]
    weight: Float64[np.ndarray, " m"]
    scale: Float64[np.ndarray, " m"]


class VelocityLevels(NamedTuple):
    """Rows of all levels, one below the other, as `VelocityLevel` has them.

    Attributes:
        jacobian: J of all levels.
        velocity: v.
        weight: diagonals of W_A.
        scale: what rows are multiplied by where ranks are decided.
        ends: where each level ends; the first entry is zero.
    """

    jacobian: Float64[np.ndarray, "t n"]
    velocity: Float64[np.ndarray, " t"]
    weight: Float64[np.ndarray, " t"]
    scale: Float64[np.ndarray, " t"]
    ends: Int64[np.ndarray, " ends"]

    @classmethod
    def of(cls, levels: Sequence[VelocityLevel]) -> "VelocityLevels":
        """Copies levels, most important first."""
        return cls(
            np.concatenate([level.jacobian for level in levels]),
            np.concatenate([level.velocity for level in levels]),
            np.concatenate([level.weight for level in levels]),
            np.concatenate([level.scale for level in levels]),
            np.cumsum([0, *(len(level.velocity) for level in levels)]),
        )

    @classmethod
    def nothing(cls, n: int) -> "VelocityLevels":
        """No level at all, for n joints."""
        none = np.zeros(0)
        return cls(np.zeros((0, n)), none, none, none, np.zeros(1, dtype=np.int64))

    def level(self, index: int) -> VelocityLevel:
        """One level, in views."""
        rows = slice(self.ends[index], self.ends[index + 1])
        return VelocityLevel(
            self.jacobian[rows], self.velocity[rows], self.weight[rows], self.scale[rows]
        )


ROUNDING = 1e-12
"""Velocities smaller than this, relative to the largest, are rounding."""


class Work(NamedTuple):
    """Memory of the closed form, in z = W_B^1/2 u.

    Attributes:
        X: rows of the levels that are done, as `_row_factor` has them.
        tau: factors of their reflections.
        B: an orthonormal basis of what they leave, in rows.
        y: coordinates of z that they decide.
        z: the answer so far, and scratch.
        shrink: W_B^-1/2.
        G: scratch.
    """

    X: Float64[np.ndarray, "n n"]
    tau: Float64[np.ndarray, " n"]
    B: Float64[np.ndarray, "n n"]
    y: Float64[np.ndarray, " n"]
    z: Float64[np.ndarray, "3 n"]
    shrink: Float64[np.ndarray, " n"]
    G: Float64[np.ndarray, "n n"]


def make_work(n: int) -> Work:
    """Memory for n joints."""
    X, B, G = np.zeros((3, n, n))
    tau, y, shrink = np.zeros((3, n))
    return Work(X, tau, B, y, np.zeros((3, n)), shrink, G)


@compiled
def serve_levels(
    levels: VelocityLevels,
    joint_weight: Float64[np.ndarray, " n"],
    exact: int,
    least: float,
    work: Work,
    u: Float64[np.ndarray, " n"],
) -> tuple[int, int]:
    """Serves levels as `solve_levels` does, up to the first that loses rank."""
    n, count, taken = len(u), len(levels.ends) - 1, 0
    for i in range(n):
        work.shrink[i] = 1.0 / sqrt(joint_weight[i])
    served, rest = count, False
    for level in range(count):
        rows = int(levels.ends[level + 1] - levels.ends[level])
        last = level == count - 1 and level >= exact
        rest = last and taken + rows > n
        if rest:
            break
        # Below the last level nobody asks what it leaves, nor whether it keeps its rank.
        needed = 0.0 if last else least
        if not _serve_level(levels, level, level < exact, needed, work, taken):
            served = level
            break
        taken += rows
    for i in range(n):
        work.z[0, i] = work.y[i] if i < taken else 0.0
    turn_back(work.z, 0, 1, work.X, taken, work.tau)
    if rest or served < count:
        fill_complement(work.B, work.X, taken, work.tau)
    if rest:
        _serve_rest(levels, work, n - taken)
    for i in range(n):
        u[i] = work.shrink[i] * work.z[0, i]
    drop_rounding(u)
    return served, taken


@compiled
def drop_rounding(u: Float64[np.ndarray, " n"]) -> None:
    """Zero velocities that are rounding: the next tick's weights go by their signs."""
    largest = 0.0
    for i in range(len(u)):
        largest = max(largest, abs(u[i]))
    for i in range(len(u)):
        # Written so that NaN stays.
        if abs(u[i]) < ROUNDING * largest:
            u[i] = 0.0


@part
def _serve_level(
    levels: VelocityLevels, level: int, exact: bool, least: float, work: Work, taken: int
) -> bool:
    """Finds the coordinates y that a level decides; returns whether it keeps its rank."""
    X, y, begin = work.X, work.y, int(levels.ends[level])
    end = taken + int(levels.ends[level + 1]) - begin
    if end > len(y):
        return False
    for place in range(taken, end):
        row = begin + place - taken
        own, J, scale = X[place], levels.jacobian[row], levels.scale[row]
        for j in range(len(y)):
            own[j] = scale * J[j] * work.shrink[j]
        y[place] = scale * levels.velocity[row]
    factor_rows(X, taken, end, work.tau)
    if least > 0.0 and not keeps_rank(X, taken, end, least, work.G):
        return False
    if exact:
        solve_lower(X, taken, end, y)
    else:
        _serve_robustly(levels, begin, work, taken, end)
    return True


@part
def _serve_robustly(levels: VelocityLevels, begin: int, work: Work, taken: int, end: int) -> None:
    """The SR-inverse (22e) of a level's own block of L, for places `taken` to `end` of y.

    As B^T (B B^T + I)^-1 sqrt(W) v with B = sqrt(W) L, which stays accurate for large weights.
    """
    X, y, G, x, root = work.X, work.y, work.G, work.z[1], work.z[2]
    size = end - taken
    square_level(X, taken, end, G)
    for i in range(size):
        own, c = X[taken + i], y[taken + i]
        for j in range(taken):
            c -= own[j] * y[j]
        # The rows of X carry their scales.
        root[i] = sqrt(levels.weight[begin + i]) / levels.scale[begin + i]
        x[i] = root[i] * c
        for j in range(i + 1):
            G[i, j] *= root[i] * root[j]
    _solve_robustly(work, size)
    for k in range(size):
        y[taken + k] = 0.0
    for i in range(size):
        own, factor = X[taken + i, taken:], root[i] * x[i]
        for k in range(i + 1):
            y[taken + k] += own[k] * factor


@part
def _serve_rest(levels: VelocityLevels, work: Work, left: int) -> None:
    """The SR-inverse (22e) of the last level in what the others leave, added to z."""
    z, x, a, n = work.z[0], work.z[1], work.z[2], len(work.shrink)
    for i in range(left):
        x[i] = 0.0
        for j in range(i + 1):
            work.G[i, j] = 0.0
    for row in range(levels.ends[-2], levels.ends[-1]):
        J, c = levels.jacobian[row], levels.velocity[row]
        for j in range(n):
            c -= J[j] * work.shrink[j] * z[j]
        for i in range(left):
            direction, total = work.B[i], 0.0
            for j in range(n):
                total += J[j] * work.shrink[j] * direction[j]
            a[i] = total
        add_row(work.G, x, a, left, levels.weight[row], c)
    _solve_robustly(work, left)
    for i in range(left):
        direction = work.B[i]
        for j in range(n):
            z[j] += x[i] * direction[j]


@part
def _solve_robustly(work: Work, size: int) -> None:
    """X <- (G + I)^-1 x; NaN where numbers end."""
    for i in range(size):
        work.G[i, i] += 1.0
    solvable = factor_leading(work.G, size)
    solve_leading(work.G, size, work.z[1])
    for i in range(size):
        if not solvable:
            work.z[1, i] = np.nan
