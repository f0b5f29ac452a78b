"""The closed form of `ClosedForm` over levels that keep their rank, compiled."""

from math import sqrt
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import (
    MemoryBlock,
    compiled,
    factor_leading,
    part,
    solve_leading,
    solve_lower,
    view,
)
from poise.control._row_factor import (
    ROUNDING,
    add_row,
    factor_rows,
    fill_complement,
    keeps_rank,
    square_level,
    turn_back,
)

NO_VELOCITY = 1e-6
"""Smaller velocities are none: of a row by a radian a second, and those by which rows miss what
they are held to [unit/s]."""


class PriorityRows(NamedTuple):
    """Rows J u = v of one priority, as `VelocityLevels` has them."""

    jacobian: Float64[np.ndarray, "m n"]
    velocity: Float64[np.ndarray, " m"]
    weight: Float64[np.ndarray, " m"]
    scale: Float64[np.ndarray, " m"]


class VelocityLevels(MemoryBlock):
    """Rows J u = v of levels, and rows J u >= v of a limit."""

    jacobian: Float64[np.ndarray, "t n"]
    velocity: Float64[np.ndarray, " t"]
    weight: Float64[np.ndarray, " t"]  # diagonal of W_A, for levels that are not exact
    scale: Float64[np.ndarray, " t"]  # factors of the rows where ranks are decided
    rows: Int64[np.ndarray, " served"]  # of the levels, most important first
    ends: Int64[np.ndarray, " ends"]  # of each level in `rows`; the first entry is zero
    limits: Int64[np.ndarray, " limits"]  # rows of the limit
    exact: int  # leading levels that are met exactly

    def level(self, index: int) -> PriorityRows:
        """Copy one level."""
        rows = self.rows[self.ends[index] : self.ends[index + 1]]
        return PriorityRows(
            self.jacobian[rows], self.velocity[rows], self.weight[rows], self.scale[rows]
        )

    def with_limits(self) -> "VelocityLevels":
        """Make room for the same rows with one more level, that `take_rows` fills."""
        arrays = self.arrays()
        arrays["rows"] = np.append(self.rows, self.limits)
        arrays["ends"] = np.zeros(len(self.ends) + 1, dtype=np.int64)
        return VelocityLevels(**arrays, exact=self.exact + 1)


class ClosedFormMemory(MemoryBlock):
    """Input, answer and scratch of `serve_levels`, which works in z = W_B^1/2 u."""

    least: Float64[np.ndarray, "1"]  # singular value of a level's rows that keep their rank
    joint_weight: Float64[np.ndarray, " n"]  # diagonal of W_B
    fixed: Float64[np.ndarray, " n"]  # velocities of joints that are held, zero for the others
    count: int  # levels to be served
    u: Float64[np.ndarray, " n"]  # the answer, without `fixed`
    X: Float64[np.ndarray, "n n"]  # rows of the levels that are done, as `_row_factor` has them
    tau: Float64[np.ndarray, " n"]  # factors of their reflections
    B: Float64[np.ndarray, "n n"]  # orthonormal basis of what they leave, in rows
    y: Float64[np.ndarray, " n"]  # coordinates of z that they decide
    z: Float64[np.ndarray, "3 n"]  # the answer so far, and scratch
    shrink: Float64[np.ndarray, " n"]  # W_B^-1/2
    G: Float64[np.ndarray, "n n"]


class ConstrainedRows(MemoryBlock):
    """Rows on all velocities, and the same on those of joints under a stance."""

    J: Float64[np.ndarray, "t nv"]
    joints: Int64[np.ndarray, " n"]
    base_map: Float64[np.ndarray, "base n"]  # X of `base_from_joints`; empty for a fixed base
    jacobian: Float64[np.ndarray, "t n"]


@compiled
def constrain(rows_at: int, stance: Float64[np.ndarray, "c nv"]) -> None:
    """Find X of `base_from_joints` for the stance's Jacobian, and the rows J_j + J_b X."""
    rows = view(ConstrainedRows, rows_at)
    X, joints, base = rows.base_map, rows.joints, len(rows.base_map)
    for k in range(len(joints) if base > 0 else 0):
        j = base + joints[k]
        # The base's block is [A B; 0 A] with a rotation A.
        for i in range(3):
            X[3 + i, k] = 0.0
            for r in range(3):
                X[3 + i, k] -= stance[r, i] * stance[3 + r, j]
        for i in range(3):
            X[i, k] = 0.0
            for r in range(3):
                moved = stance[r, j]
                for s in range(3, 6):
                    moved += stance[r, s] * X[s, k]
                X[i, k] -= stance[r, i] * moved
    for row in range(len(rows.J)):
        own, found = rows.J[row], rows.jacobian[row]
        for k in range(len(joints)):
            found[k] = own[base + joints[k]]
        for b in range(base):
            factor, moved_by = own[b], X[b]
            # Rows of single joints do not move with the base.
            if factor != 0.0:
                for k in range(len(joints)):
                    found[k] += factor * moved_by[k]


@compiled
def serve_levels(levels_at: int, memory_at: int) -> int:
    """Serve levels up to the first that loses rank; return how many were served."""
    levels, memory = view(VelocityLevels, levels_at), view(ClosedFormMemory, memory_at)
    u, count, taken = memory.u, memory.count, 0
    n = len(u)
    for i in range(n):
        memory.shrink[i] = 1.0 / sqrt(memory.joint_weight[i])
    served, rest = count, False
    for level in range(count):
        rows = int(levels.ends[level + 1] - levels.ends[level])
        last = level == count - 1 and level >= levels.exact
        rest = last and taken + rows > n
        if rest:
            break
        # Nothing depends on what the last level leaves, nor on its rank.
        needed = 0.0 if last else memory.least[0]
        if not _serve_level(levels, level, needed, memory, taken):
            served = level
            break
        taken += rows
    for i in range(n):
        memory.z[0, i] = memory.y[i] if i < taken else 0.0
    turn_back(memory.z, 0, 1, memory.X, taken, memory.tau)
    if rest or served < count:
        fill_complement(memory.B, memory.X, taken, memory.tau)
    if rest:
        _serve_rest(levels, memory, n - taken)
    largest = 0.0
    for i in range(n):
        u[i] = memory.shrink[i] * memory.z[0, i]
        largest = max(largest, abs(u[i]))
    for i in range(n):
        # The next tick's weights go by the signs. Written so that NaN stays.
        if abs(u[i]) < ROUNDING * largest:
            u[i] = 0.0
    return served


@compiled
def take_rows(levels_at: int, joined_at: int, memory_at: int, taken: int) -> int:
    """Take up rows of the limit, the worst first, until an answer without bounds breaks none."""
    levels, joined = view(VelocityLevels, levels_at), view(VelocityLevels, joined_at)
    memory = view(ClosedFormMemory, memory_at)
    memory.count = len(joined.ends) - 1
    while taken < len(levels.limits):
        worst = _find_worst(joined, int(levels.ends[1]), taken, memory.u)
        if worst < 0:
            break
        taken += 1
        _join(levels, joined, worst, taken)
        if serve_levels(joined_at, memory_at) < memory.count:
            break
    return taken


@part
def _find_worst(
    joined: VelocityLevels, first: int, taken: int, u: Float64[np.ndarray, " n"]
) -> int:
    """Return the row that is broken by most, -1 for none; NaN breaks none."""
    worst, most = -1, NO_VELOCITY
    for row in joined.limits:
        own, rate, square = joined.jacobian[row], 0.0, 0.0
        for k in range(len(u)):
            rate += own[k] * u[k]
            square += own[k] * own[k]
        known = not square > NO_VELOCITY * NO_VELOCITY
        for k in range(first, first + taken):
            known = known or joined.rows[k] == row
        if joined.velocity[row] - rate > most and not known:
            worst, most = row, joined.velocity[row] - rate
            joined.scale[row] = 1.0 / sqrt(square)
    return worst


@part
def _join(levels: VelocityLevels, joined: VelocityLevels, row: int, taken: int) -> None:
    """Put one more row of the limit below the first level."""
    first = int(levels.ends[1])
    for k in range(first, int(levels.ends[-1])):
        joined.rows[k + taken] = levels.rows[k]
    joined.rows[first + taken - 1] = row
    joined.ends[1] = first
    for i in range(1, len(levels.ends)):
        joined.ends[i + 1] = levels.ends[i] + taken


@part
def _velocity_of(levels: VelocityLevels, row: int, memory: ClosedFormMemory) -> float:
    """Return the velocity of a row for the joints that are not held."""
    J, asked = levels.jacobian[row], levels.velocity[row]
    for k in range(len(J)):
        if memory.fixed[k] != 0.0:
            asked -= J[k] * memory.fixed[k]
    return asked


@part
def _serve_level(
    levels: VelocityLevels, level: int, least: float, memory: ClosedFormMemory, taken: int
) -> bool:
    """Find the coordinates y that a level decides; return True where it keeps its rank."""
    X, y, begin = memory.X, memory.y, int(levels.ends[level])
    end = taken + int(levels.ends[level + 1]) - begin
    if end > len(y):
        return False
    for place in range(taken, end):
        row = levels.rows[begin + place - taken]
        own, J, scale = X[place], levels.jacobian[row], levels.scale[row]
        for j in range(len(y)):
            own[j] = scale * J[j] * memory.shrink[j]
        y[place] = scale * _velocity_of(levels, row, memory)
    factor_rows(X, taken, end, memory.tau)
    if least > 0.0 and not keeps_rank(X, taken, end, least, memory.G):
        return False
    if level < levels.exact:
        solve_lower(X, taken, end, y)
    else:
        _serve_robustly(levels, begin, memory, taken, end)
    return True


@part
def _serve_robustly(
    levels: VelocityLevels, begin: int, memory: ClosedFormMemory, taken: int, end: int
) -> None:
    """Apply the SR-inverse (22e) to a level's own block of L, for places `taken` to `end` of y."""
    X, y, G, x, root = memory.X, memory.y, memory.G, memory.z[1], memory.z[2]
    size = end - taken
    # As B^T (B B^T + I)^-1 sqrt(W) v with B = sqrt(W) L it stays accurate for large weights.
    square_level(X, taken, end, G)
    for i in range(size):
        own, c, row = X[taken + i], y[taken + i], levels.rows[begin + i]
        for j in range(taken):
            c -= own[j] * y[j]
        # The rows of X carry their scales.
        root[i] = sqrt(levels.weight[row]) / levels.scale[row]
        x[i] = root[i] * c
        for j in range(i + 1):
            G[i, j] *= root[i] * root[j]
    _solve_robustly(memory, size)
    for k in range(size):
        y[taken + k] = 0.0
    for i in range(size):
        own, factor = X[taken + i, taken:], root[i] * x[i]
        for k in range(i + 1):
            y[taken + k] += own[k] * factor


@part
def _serve_rest(levels: VelocityLevels, memory: ClosedFormMemory, left: int) -> None:
    """Add the SR-inverse (22e) of the last level in what the others leave to z."""
    z, x, a, n = memory.z[0], memory.z[1], memory.z[2], len(memory.shrink)
    for i in range(left):
        x[i] = 0.0
        for j in range(i + 1):
            memory.G[i, j] = 0.0
    for k in range(levels.ends[memory.count - 1], levels.ends[memory.count]):
        row = int(levels.rows[k])
        J, c = levels.jacobian[row], _velocity_of(levels, row, memory)
        for j in range(n):
            c -= J[j] * memory.shrink[j] * z[j]
        for i in range(left):
            direction, total = memory.B[i], 0.0
            for j in range(n):
                total += J[j] * memory.shrink[j] * direction[j]
            a[i] = total
        add_row(memory.G, x, a, left, levels.weight[row], c)
    _solve_robustly(memory, left)
    for i in range(left):
        direction = memory.B[i]
        for j in range(n):
            z[j] += x[i] * direction[j]


@part
def _solve_robustly(memory: ClosedFormMemory, size: int) -> None:
    """X <- (G + I)^-1 x; NaN where that overflows."""
    for i in range(size):
        memory.G[i, i] += 1.0
    solvable = factor_leading(memory.G, size)
    solve_leading(memory.G, size, memory.z[1])
    for i in range(size):
        if not solvable:
            memory.z[1, i] = np.nan
