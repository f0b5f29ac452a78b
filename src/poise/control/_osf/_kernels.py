"""The recursion of `OperationalRecursion` over levels that keep their rank, compiled."""

from math import sqrt
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from poise._compiled import compiled, factor_leading, part, solve_leading, solve_lower
from poise.control._osf._rows import LevelRows
from poise.control._row_factor import (
    add_row,
    factor_rows,
    fill_complement,
    keeps_rank,
    turn,
    turn_back,
)


class Bounds(NamedTuple):
    """What makes a level an ordinary one.

    Attributes:
        physics: least singular value of the physics' rows.
        held: of rows of joints that are held.
        tasks: of the tasks' rows.
        demand: largest acceleration that a level asks of a joint [rad/s^2]; infinite for any.
        base: number of coordinates before the joints.
    """

    physics: float
    held: float
    tasks: float
    demand: float
    base: int


class Work(NamedTuple):
    """Memory of the recursion; what it leaves there holds until the next state.

    Attributes:
        L: factor of the mass matrix, M = L^T L.
        X: rows J~ = J L^-1 of the leading levels, as `_row_factor` has them.
        tau: factors of their reflections.
        B: accelerations that leave the leading levels alone, orthonormal in the mass metric.
        y: coordinates of the answer that the levels decide: L_J y = target.
        S: acceleration after the leading levels.
        G: scratch.
        F: scratch.
        z: scratch, two rows.
    """

    L: Float64[np.ndarray, "n n"]
    X: Float64[np.ndarray, "n n"]
    tau: Float64[np.ndarray, " n"]
    B: Float64[np.ndarray, "n n"]
    y: Float64[np.ndarray, " n"]
    S: Float64[np.ndarray, " n"]
    G: Float64[np.ndarray, "n n"]
    F: Float64[np.ndarray, "n n"]
    z: Float64[np.ndarray, "2 n"]


def make_work(n: int) -> Work:
    """Memory for a robot of n generalized coordinates."""
    L, X, B, G, F = np.zeros((5, n, n))
    tau, y, S = np.zeros((3, n))
    return Work(L, X, tau, B, y, S, G, F, np.zeros((2, n)))


@compiled
def resolve(
    M: Float64[np.ndarray, "n n"],
    h: Float64[np.ndarray, " n"],
    levels: LevelRows,
    bounds: Bounds,
    work: Work,
    dv: Float64[np.ndarray, " n"],
) -> tuple[int, bool]:
    """The acceleration of one state, as long as levels keep their rank and ask for little enough.

    The first level that does not may still take all that is left, with nothing lost on the way; so
    does a posture below tasks that leave it less freedom than it has rows.

    Args:
        M: mass matrix.
        h: nonlinear effects.
        levels: rows of the state.
        bounds: what makes a level an ordinary one.
        work: memory.
        dv: receives the acceleration.

    Returns:
        How many leading levels are ordinary ones, and whether `dv` is the answer; if not, the
        levels from there on are to be taken one by one, from `work.S` and `work.B`.
    """
    _factor_mass(M, work.L)
    regular = _factor_levels(levels, bounds, work)
    regular = _add_levels(levels, bounds, work, regular)
    for i in range(len(dv)):
        dv[i] = work.S[i]
    taken = int(levels.ends[regular])
    if regular == len(levels.ends) - 1:
        _let_go(h, work, taken, dv)
        return regular, True
    find_rest(work, taken)
    return regular, _take_rest(levels, bounds, work, regular, dv)


@compiled
def find_rest(work: Work, taken: int) -> None:
    """Accelerations that leave the leading levels alone, in the rows of `work.B`.

    Args:
        work: memory of `resolve`.
        taken: how many rows these levels have.
    """
    fill_complement(work.B, work.X, taken, work.tau)
    for i in range(len(work.B) - taken):
        _to_acceleration(work.L, work.B, i)


@compiled
def sum_levels(levels: LevelRows, work: Work, count: int, S: Float64[np.ndarray, " n"]) -> None:
    """The acceleration after some of the ordinary levels of the last state, as in eq (17).

    Args:
        levels: the rows of `resolve`.
        work: its memory.
        count: how many levels.
        S: receives the acceleration.
    """
    _turn_part(work, 0, int(levels.ends[count]))
    for i in range(len(S)):
        S[i] = work.z[0, i]


@part
def _factor_mass(M: Float64[np.ndarray, "n n"], L: Float64[np.ndarray, "n n"]) -> None:
    """M = L^T L, from the last coordinate on: no limb gets coefficients of another.

    Section 6.5 of Featherstone, "Rigid Body Dynamics Algorithms" (2008). NaN stays NaN.

    Args:
        M: mass matrix; its lower triangle is read.
        L: receives the factor in its lower triangle.
    """
    n = len(M)
    for i in range(n):
        for j in range(i + 1):
            L[i, j] = M[i, j]
    for k in range(n - 1, -1, -1):
        coupled, pivot = L[k], sqrt(L[k, k])
        for i in range(k + 1):
            coupled[i] /= pivot
        for i in range(k):
            factor, row = coupled[i], L[i]
            if factor != 0.0:
                for j in range(i + 1):
                    row[j] -= factor * coupled[j]


@part
def _divide_row(L: Float64[np.ndarray, "n n"], X: Float64[np.ndarray, "m n"], row: int) -> None:
    """X <- x L^-1 for one row; what a limb does not move stays zero and costs nothing."""
    for k in range(len(L) - 1, -1, -1):
        if X[row, k] != 0.0:
            X[row, k] /= L[k, k]
            factor = X[row, k]
            for j in range(k):
                X[row, j] -= factor * L[k, j]


@part
def _to_acceleration(
    L: Float64[np.ndarray, "n n"], Z: Float64[np.ndarray, "m n"], row: int
) -> None:
    """Z <- L^-1 z for one row: from the mass metric's coordinates to accelerations."""
    z = Z[row]
    for i in range(len(L)):
        coupled, rest = L[i], z[i]
        for j in range(i):
            rest -= coupled[j] * z[j]
        z[i] = rest / coupled[i]


@part
def _factor_levels(levels: LevelRows, bounds: Bounds, work: Work) -> int:
    """Factors the leading levels; returns how many keep their rank."""
    n, ends, X, tau = len(work.L), levels.ends, work.X, work.tau
    for level in range(len(ends) - 1):
        begin, end = int(ends[level]), int(ends[level + 1])
        if end > n:
            return level
        for row in range(begin, end):
            scale = levels.scale[row]
            work.y[row] = scale * levels.target[row]
            for j in range(n):
                X[row, j] = scale * levels.jacobian[row, j]
            _divide_row(work.L, X, row)
        factor_rows(X, begin, end, tau)
        if not keeps_rank(X, begin, end, _least(levels, bounds, level), work.G):
            return level
        solve_lower(X, begin, end, work.y)
    return len(ends) - 1


@part
def _least(levels: LevelRows, bounds: Bounds, level: int) -> float:
    """Singular value from which a level's direction is controlled exactly, as `rank_of` has it."""
    if level >= levels.constraints:
        return bounds.tasks
    return bounds.held if level > 0 else bounds.physics


@part
def _turn_part(work: Work, begin: int, end: int) -> None:
    """The acceleration of some places of y, in the first row of z."""
    z = work.z
    for i in range(z.shape[1]):
        z[0, i] = work.y[i] if begin <= i < end else 0.0
    turn_back(z, 0, 1, work.X, end, work.tau)
    _to_acceleration(work.L, z, 0)


@part
def _add_levels(levels: LevelRows, bounds: Bounds, work: Work, regular: int) -> int:
    """S after the leading levels; returns how many of them ask for no more than is allowed."""
    S, z = work.S, work.z
    for i in range(len(S)):
        S[i] = 0.0
    for level in range(regular):
        _turn_part(work, int(levels.ends[level]), int(levels.ends[level + 1]))
        if level >= levels.constraints and not _is_kept(z, bounds):
            return level
        for i in range(len(S)):
            S[i] += z[0, i]
    return regular


@part
def _is_kept(z: Float64[np.ndarray, "2 n"], bounds: Bounds) -> bool:
    """Whether the first row asks no more of any joint than is allowed; False for NaN."""
    kept = True
    for i in range(bounds.base, z.shape[1]):
        kept = kept and abs(z[0, i]) <= bounds.demand
    return kept or np.isinf(bounds.demand)


@part
def _let_go(
    h: Float64[np.ndarray, " n"], work: Work, taken: int, dv: Float64[np.ndarray, " n"]
) -> None:
    """Dv <- dv - N M^-1 h: what no level decides is left without force."""
    z = work.z
    for i in range(len(h)):
        z[0, i] = h[i]
    _divide_row(work.L, z, 0)
    turn(z, 0, 1, work.X, 0, taken, work.tau)
    for i in range(taken):
        z[0, i] = 0.0
    turn_back(z, 0, 1, work.X, taken, work.tau)
    _to_acceleration(work.L, z, 0)
    for i in range(len(h)):
        dv[i] -= z[0, i]


@part
def _take_rest(
    levels: LevelRows, bounds: Bounds, work: Work, level: int, dv: Float64[np.ndarray, " n"]
) -> bool:
    """Gives a level all that is left, by least squares, if it loses no direction of that.

    With A = J B and c = target - J S it adds B (A^T A)^-1 A^T c; later levels find nothing.

    Args:
        levels: the rows.
        bounds: what makes a level an ordinary one.
        work: memory, with the basis of what is left.
        level: which one.
        dv: S, to which is added.

    Returns:
        Whether it was: no singular value of A is too small, and not too much is asked for.
    """
    begin, end = int(levels.ends[level]), int(levels.ends[level + 1])
    left, G, F, z = len(dv) - begin, work.G, work.F, work.z
    if end - begin < left:
        return False
    _square(levels, work, begin, end, left)
    least = _least(levels, bounds, level)
    for i in range(left):
        for j in range(i):
            F[i, j] = G[i, j]
        F[i, i] = G[i, i] - least * least
    if not (factor_leading(F, left) and factor_leading(G, left)):
        return False
    x = z[1]
    solve_leading(G, left, x)
    for j in range(len(dv)):
        z[0, j] = 0.0
        for i in range(left):
            z[0, j] += x[i] * work.B[i, j]
    if level >= levels.constraints and not _is_kept(z, bounds):
        return False
    for j in range(len(dv)):
        dv[j] += z[0, j]
    return True


@part
def _square(levels: LevelRows, work: Work, begin: int, end: int, left: int) -> None:
    """G = A^T A, in its lower triangle, and z[1] = A^T c, row by row of A."""
    S, G, a, total = work.S, work.G, work.z[0], work.z[1]
    for i in range(left):
        total[i] = 0.0
        for j in range(i + 1):
            G[i, j] = 0.0
    for row in range(begin, end):
        J, scale, c = levels.jacobian[row], levels.scale[row], levels.target[row]
        for k in range(len(S)):
            c -= J[k] * S[k]
        for i in range(left):
            direction, a[i] = work.B[i], 0.0
            for k in range(len(S)):
                a[i] += J[k] * direction[k]
        add_row(G, total, a, left, scale * scale, c)
