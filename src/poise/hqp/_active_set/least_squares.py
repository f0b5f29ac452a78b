"""The least squares of a level whose rows contradict each other.

Each row that depends on the pivots is a combination C of them, and misses its bound by e where the
pivots meet theirs. With slack u of the pivots the others have w = C u + e, and |u|^2 + |w|^2 is
minimal. Pivots outside the contradiction have no coefficient in C, so that no rounding reaches
them, however large the slack of the others is.
"""

from poise._compiled import part
from poise.hqp._active_set.kernels import (
    add_multiple,
    copy,
    make_reflection,
    minus_dot,
    norm_of,
    reflect,
    reflect_rows,
)
from poise.hqp._active_set.workspace import Factor, LeastSquares, Vector
from poise.hqp._tolerances import CANCELLATION, STEEP


@part
def find_slacks_of_conflict(factor: Factor, squares: LeastSquares, level: int) -> None:
    """Divide a level's slack among its rows."""
    begin, end, first = factor.begin[level], factor.begin[level + 1], factor.first[level]
    rank = factor.rank[level]
    count, dependent = end - begin - rank, begin + rank
    _combine(factor, begin, end, first, rank)
    for i in range(count):
        # Rows that depend on no pivot have no part in the contradiction, nor in its rounding.
        touched = norm_of(factor.R[dependent + i, first : first + rank]) > 0.0
        squares.rhs[i] = -factor.slack[dependent + i] if touched else 0.0
    if count < rank:
        _solve_wide(factor, squares, dependent, end, first, rank)
    else:
        _solve_tall(factor, squares, dependent, end, first, rank)
    found, u = squares.rhs[: rank + count], factor.slack[begin : begin + rank]
    norm = norm_of(found)
    for j in range(rank):
        u[j] = found[j] if abs(found[j]) > CANCELLATION * norm else 0.0
    # Each comes from the solver, or from the others, whichever loses less by rounding.
    balance, noise = squares.balance, squares.noise
    balance[:rank], noise[:rank] = 0.0, 0.0
    for i in range(count):
        C = factor.R[dependent + i, first : first + rank]
        total, length = factor.slack[dependent + i], norm_of(C)
        size = abs(total)
        for j in range(rank):
            total += C[j] * u[j]
            size += abs(C[j] * u[j])
        # A steep row magnifies the pivots' rounding.
        if (size > norm or length > STEEP) and length > 0.0:
            total, size = found[rank + i], norm
        w = total if abs(total) > CANCELLATION * size else 0.0
        factor.slack[dependent + i] = w
        for j in range(rank):
            balance[j] -= C[j] * w
            noise[j] += abs(C[j]) * size
    for j in range(rank):
        best = u[j] if noise[j] > norm else balance[j]
        u[j] = best if abs(best) > CANCELLATION * min(noise[j], norm) else 0.0


@part
def _combine(factor: Factor, begin: int, end: int, first: int, rank: int) -> None:
    """Write each dependent row as a combination of the pivots, over its own part of R."""
    for row in range(begin + rank, end):
        C, size = factor.R[row, first : first + rank], factor.size[row]
        for k in range(rank - 1, -1, -1):
            pivot = factor.R[begin + k, first : first + rank]
            # So small a coefficient is rounding of the row.
            if abs(C[k]) <= CANCELLATION * size:
                C[k] = 0.0
                continue
            C[k] /= pivot[k]
            add_multiple(C[:k], -C[k], pivot)


@part
def _solve_wide(
    factor: Factor, squares: LeastSquares, begin: int, end: int, first: int, rank: int
) -> None:
    """Few rows depend on many pivots: (u, w) is the shortest solution of C u - w = -e."""
    count = end - begin
    T, V, taus, size = squares.T, squares.V, squares.tau, rank + count
    solution = squares.rhs[:size]
    for i in range(count):
        copy(T[i, :rank], factor.R[begin + i, first : first + rank])
        T[i, rank:size] = 0.0
        T[i, rank + i] = -1.0
    for i in range(count):
        v = V[i, : size - i]
        taus[i] = make_reflection(T[i, i:size], v)
        reflect_rows(T, i + 1, count, i, v, taus[i])
    for i in range(count):
        solution[i] = minus_dot(solution[i], solution[:i], T[i]) / T[i, i]
    solution[count:] = 0.0
    for i in range(count - 1, -1, -1):
        reflect(solution[i:], V[i, : size - i], taus[i])


@part
def _solve_tall(
    factor: Factor, squares: LeastSquares, begin: int, end: int, first: int, rank: int
) -> None:
    """Many rows depend on few pivots: u is the least-squares solution of C u = -e, u = 0."""
    count = end - begin
    for i in range(count):
        C = factor.R[begin + i, first : first + rank]
        for j in range(rank):
            squares.T[j, i] = C[j]
    solve_damped(squares, count, 1.0, squares.u[:rank])
    # The remainder, turned back, is (-w, -u): rounded as a whole, not one by one.
    found, size = squares.rhs[: count + rank], count + rank
    found[:rank] = 0.0
    for j in range(rank - 1, -1, -1):
        v = squares.v[: size - j]
        v[0] = 1.0
        copy(v[1:], squares.T[j, j + 1 : size])
        reflect(found[j:], v, squares.tau[j])
    for i in range(size):
        squares.v[i] = -found[i]
    copy(found[:rank], squares.v[count:size])
    copy(found[rank:], squares.v[:count])


@part
def solve_damped(squares: LeastSquares, count: int, damping: float, u: Vector) -> None:
    """Solve the least squares of the columns in T, and of damping times u = 0."""
    rank, T, taus = len(u), squares.T, squares.tau
    size = count + rank
    rhs = squares.rhs[:size]
    rhs[count:] = 0.0
    for j in range(rank):
        T[j, count:size] = 0.0
        T[j, count + j] = damping
    for j in range(rank):
        tail, v = T[j, j:size], squares.v[: size - j]
        taus[j] = make_reflection(tail, v)
        reflect_rows(T, j + 1, rank, j, v, taus[j])
        reflect(rhs[j:], v, taus[j])
        # The reflection stays where the column is zero now.
        copy(tail[1:], v[1:])
    copy(u, rhs)
    for j in range(rank - 1, -1, -1):
        u[j] /= T[j, j]
        add_multiple(u[:j], -u[j], T[j])
