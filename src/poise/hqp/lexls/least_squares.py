"""The least squares of a level whose rows contradict each other.

Each row that depends on the pivots is a combination C of them, and misses its bound by e where the
pivots meet theirs. If they give u instead, the others give w = C u + e, and |u|^2 + |w|^2 is to be
least. Pivots that the contradiction does not touch have no coefficient in C, so that no rounding
reaches them, however large the slack of the others is.
"""

import numpy as np
from jaxtyping import Float64

from poise._compiled import part
from poise.hqp.lexls.reflections import copy, length_of, reflect, reflect_rows, turn_row
from poise.hqp.lexls.tolerances import CANCELLATION, DEPENDENCE_TOLERANCE
from poise.hqp.lexls.workspace import Work


@part
def share_slack(work: Work, begin: int, end: int, first: int, rank: int) -> None:
    """Shares a level's slack out among its rows.

    Args:
        work: whose slack of the dependent rows is what they miss where all pivots are met.
        begin: the level's first row.
        end: where its rows end.
        first: its first coordinate.
        rank: how many pivots it has.
    """
    _combine(work, begin, end, first, rank)
    count = end - begin - rank
    if count < rank:
        _solve_wide(work, begin + rank, end, first, rank)
    else:
        _solve_tall(work, begin + rank, end, first, rank)
    found, u = work.right[: rank + count], work.slack[begin : begin + rank]
    for i in range(count):
        work.vector[i] = length_of(work.R[begin + rank + i, first : first + rank])
    norm = length_of(found)
    for j in range(rank):
        u[j] = found[j] if abs(found[j]) > CANCELLATION * norm else 0.0
    # Each is taken from the solver, or from the others, wherever less is lost by rounding.
    balance, noise = work.left[:rank], work.kept[:rank]
    balance[:], noise[:] = 0.0, 0.0
    for i in range(count):
        C = work.R[begin + rank + i, first : first + rank]
        total = work.slack[begin + rank + i]
        size = abs(total)
        for j in range(rank):
            total += C[j] * u[j]
            size += abs(C[j] * u[j])
        if size > norm and work.vector[i] > 0.0:
            total, size = found[rank + i], norm
        w = total if abs(total) > CANCELLATION * size else 0.0
        work.slack[begin + rank + i] = w
        for j in range(rank):
            balance[j] -= C[j] * w
            noise[j] += abs(C[j]) * size
    for j in range(rank):
        best = u[j] if noise[j] > norm else balance[j]
        u[j] = best if abs(best) > CANCELLATION * min(noise[j], norm) else 0.0


@part
def _combine(work: Work, begin: int, end: int, first: int, rank: int) -> None:
    """Writes each dependent row as a combination of the pivots, over its own part of R."""
    for row in range(begin + rank, end):
        C, size = work.R[row, first : first + rank], work.size[row]
        for k in range(rank - 1, -1, -1):
            pivot = work.R[begin + k, first : first + rank]
            # What is left of a coefficient that is zero is rounding of the row.
            if abs(C[k]) <= DEPENDENCE_TOLERANCE * size:
                C[k] = 0.0
                continue
            share = C[k] / pivot[k]
            C[k] = share
            for j in range(k):
                C[j] -= share * pivot[j]


@part
def _contradiction(work: Work, row: int, first: int, rank: int) -> float:
    """-e; what depends on nothing has no part in it, nor in its rounding."""
    return -work.slack[row] if length_of(work.R[row, first : first + rank]) > 0.0 else 0.0


@part
def _solve_wide(work: Work, begin: int, end: int, first: int, rank: int) -> None:
    """Few rows depend on many pivots: (u, w) is the shortest solution of C u - w = -e."""
    count = end - begin
    T, V, size = work.T, work.S, rank + count
    step, taus = work.right[:size], work.kept
    for i in range(count):
        copy(T[i, :rank], work.R[begin + i, first : first + rank])
        T[i, rank:size] = 0.0
        T[i, rank + i] = -1.0
        step[i] = _contradiction(work, begin + i, first, rank)
    for i in range(count):
        tail, v = T[i, i:size], V[i, : size - i]
        taus[i] = turn_row(tail, v, length_of(tail))
        reflect_rows(T, i + 1, count, i, v, taus[i])
    for i in range(count):
        row, total = T[i], step[i]
        for j in range(i):
            total -= row[j] * step[j]
        step[i] = total / row[i]
    step[count:] = 0.0
    for i in range(count - 1, -1, -1):
        reflect(step[i:], V[i, : size - i], taus[i])


@part
def _solve_tall(work: Work, begin: int, end: int, first: int, rank: int) -> None:
    """Many rows depend on few pivots: u is the least-squares solution of C u = -e, u = 0."""
    count = end - begin
    for i in range(count):
        C = work.R[begin + i, first : first + rank]
        for j in range(rank):
            work.T[j, i] = C[j]
        work.right[i] = _contradiction(work, begin + i, first, rank)
    solve_damped(work, count, 1.0, work.goal[:rank])
    # What is left over, turned back, is (-w, -u): rounded as a whole, not one by one.
    found, size = work.right[: count + rank], count + rank
    found[:rank] = 0.0
    for j in range(rank - 1, -1, -1):
        v = work.vector[: size - j]
        v[0] = 1.0
        copy(v[1:], work.T[j, j + 1 : size])
        reflect(found[j:], v, work.force[j])
    for i in range(size):
        work.vector[i] = -found[i]
    copy(found[:rank], work.vector[count:size])
    copy(found[rank:], work.vector[:count])


@part
def solve_damped(work: Work, count: int, damping: float, u: Float64[np.ndarray, " r"]) -> None:
    """Least squares of the columns in T, and of damping times u = 0.

    Args:
        work: whose T and right side are overwritten.
        count: how many rows the columns have.
        damping: of all u.
        u: receives the solution.
    """
    rank, T, taus = len(u), work.T, work.force
    size = count + rank
    right, v = work.right[:size], work.vector
    right[count:] = 0.0
    for j in range(rank):
        T[j, count:size] = 0.0
        T[j, count + j] = damping
    for j in range(rank):
        tail = T[j, j:size]
        taus[j] = turn_row(tail, v[: size - j], length_of(tail))
        reflect_rows(T, j + 1, rank, j, v[: size - j], taus[j])
        reflect(right[j:], v[: size - j], taus[j])
        # Where the column is zero now, its reflection is kept.
        copy(tail[1:], v[1 : size - j])
    for j in range(rank):
        u[j] = right[j]
    for j in range(rank - 1, -1, -1):
        u[j] /= T[j, j]
        column = T[j]
        for i in range(j):
            u[i] -= u[j] * column[i]
