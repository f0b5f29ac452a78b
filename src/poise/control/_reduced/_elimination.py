"""`ChainElimination`: conditions of tasks in the unconstrained chain on the reduced robot.

Rows of tasks stand in columns, so that one pass over an unknown serves all rows. Reflections make a
level's rows triangular in p, in one of two ways:

    P <- V^T P                  where they reach less than all p that are left; V turns p
    [E; P] <- [E; P] U          of the level alone, where they are more than that, or depend on each
                                other; an orthogonal U keeps the norm of its residual
"""

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import (
    MemoryBlock,
    allocate,
    compiled,
    make_reflection,
    part,
    reflect,
    reflect_columns,
    reflect_rows,
    say_if_slow,
    view,
)
from poise.control._reduced._assignment import AssignedRows
from poise.control._row_factor import ROUNDING
from poise.dynamics import (
    Dynamics,
    ReducedDynamics,
    ReducedMatrices,
    StateNumbers,
    from_coordinates,
    reduce_dynamics,
)

RANK_TOLERANCE = 1e-8
"""Pivots smaller than this, relative to the first, are no motion that a task can use."""

WEAK = 1e-2
"""Motion of a row by p, over that by x, both for a unit of energy, below which p stays an unknown:
eliminated, the inverse square would be in the energy, beside one, and a nearly straight arm cost
LQP 1 its accuracy. A heavy leg moves little, but so does the body that it hangs on."""


class ChainRows(MemoryBlock):
    """Rows E y + P p = 0 with y = (x, 1), x = (dv, z), and the result of their elimination."""

    E: Float64[np.ndarray, "y m"]  # coefficients of y; columns are rows, then those left
    P: Float64[np.ndarray, "np m"]  # coefficients of p, then in the coordinates that V turns p into
    ends: Int64[np.ndarray, " ends"]  # of each level; the first entry is zero
    ease: Float64[np.ndarray, " x"]  # inverse inertia of each of x
    G: Float64[np.ndarray, "y_np np"]  # p, so turned, is -G y; lower rows: those that stay s
    V: Float64[np.ndarray, "np np"]  # vectors of the reflections that turn p
    tau: Float64[np.ndarray, " np"]  # their factors
    kept_rows: Int64[np.ndarray, " m"]  # rows that are left, level by level
    left: Int64[np.ndarray, " levels"]  # rows that each level leaves
    weak: Int64[np.ndarray, " np"]  # p that stay unknowns s
    turns: int  # number of these reflections
    used: int  # number of p that are determined or unknowns s
    kept: int  # number of unknowns s
    every: Int64[np.ndarray, " y"]  # 0, 1, ...: all of E
    order: Int64[np.ndarray, " np"]  # scratch: p in the order in which a level determines them
    pivot: Float64[np.ndarray, " m"]  # scratch: a level's pivots
    moved: Float64[np.ndarray, " m"]  # scratch: squared motion of rows by a unit of energy of x
    rest: Float64[np.ndarray, " np_m"]  # scratch: rest of a square, for each row or p
    vector: Float64[np.ndarray, " m"]  # scratch: a reflection of rows
    turned: Float64[np.ndarray, " np_m"]  # scratch: input of a reflection
    shares: Float64[np.ndarray, " m"]  # scratch


def chain_rows(fixed: int, inside: int, ends: Int64[np.ndarray, " ends"]) -> ChainRows:
    """Make room for the rows of some tasks."""
    m = int(ends[-1])
    sizes = {"y": fixed, "np": inside, "y_np": fixed + inside, "m": m, "np_m": inside + m}
    sizes |= {"levels": len(ends) - 1, "x": fixed - 1}
    return allocate(ChainRows, sizes, ends=ends, every=np.arange(fixed))


@part
def eliminate(rows: ChainRows) -> None:
    """Solve E y + P p = 0 for p, level by level, as far as the rows determine it."""
    rows.used = rows.kept = rows.turns = total = 0
    for level in range(len(rows.left)):
        begin, end = rows.ends[level], rows.ends[level + 1]
        floor = ROUNDING * max(
            _largest(rows.P, len(rows.P), begin, end), _largest(rows.E, len(rows.E) - 1, begin, end)
        )
        count = rank = end - begin
        _find_moved(rows, begin, end)
        # Mostly the freedom left reaches every row, and none has to be combined with others.
        if rank > len(rows.P) - rows.used or not _turn(rows, begin, rank, floor):
            _turn_back(rows, begin)
            rank = _find_reached(rows, begin, end, floor)
            count = rank + _compress(rows, begin + rank, end, floor)
            _find_moved(rows, begin, begin + rank)
            # Where they reach it with all of the freedom left, there is nothing to choose.
            if rank < len(rows.P) - rows.used:
                _turn(rows, begin, rank, floor)
        strong = _count_strong(rows, rank, floor)
        for k in range(strong, rank):
            _keep(rows, rows.order[k])
        _substitute(rows, begin, strong)
        for k in range(strong, count):
            rows.kept_rows[total] = begin + k
            total += 1
        rows.left[level] = count - strong
        rows.used += rank


@part
def answer(rows: ChainRows, y: Float64[np.ndarray, " n"], p: Float64[np.ndarray, " np"]) -> None:
    """Return p for x and s, in the coordinates before the elimination."""
    fixed = len(rows.E)
    for k in range(len(p)):
        p[k] = 0.0
    for i in range(fixed + rows.kept):
        row = rows.G[i if i < fixed else fixed + rows.weak[i - fixed]]
        for k in range(rows.used):
            p[k] -= row[k] * y[i]
    for k in range(rows.turns - 1, -1, -1):
        reflect(p[k:], rows.V[k, k:], rows.tau[k])


@part
def _turn(rows: ChainRows, begin: int, rank: int, floor: float) -> bool:
    """Turn p by reflections that make some rows lower triangular, weak pivots last."""
    used, inside, P, pivot = rows.used, len(rows.P), rows.P, rows.pivot
    rest, moved, smallest, largest, good = rows.rest, rows.moved, np.inf, 0.0, 10.0 * WEAK
    for k in range(rank):
        rest[k] = 0.0
    for i in range(used, inside):
        own = P[i, begin : begin + rank]
        for k in range(len(own)):
            rest[k] += own[k] * own[k]
    for k in range(rank):
        best = k
        # Weak pivots come last; among good ones the order does not matter.
        if not rest[k] > good * good * moved[k]:
            for j in range(k + 1, rank):
                if rest[j] * moved[best] > rest[best] * moved[j]:
                    best = j
        if best != k:
            _swap(rows.E, begin + k, begin + best)
            _swap(P, begin + k, begin + best)
            moved[k], moved[best] = moved[best], moved[k]
            rest[best] = rest[k]
        place = used + k
        for i in range(place, inside):
            rows.turned[i] = P[i, begin + k]
        v = rows.V[place]
        rows.tau[place] = make_reflection(rows.turned[place:inside], v[place:])
        for i in range(place, inside):
            P[i, begin + k] = rows.turned[i]
        reflect_columns(P, place, inside, begin + k + 1, v, rows.tau[place], rows.shares)
        for j in range(k + 1, rank):
            rest[j] -= P[place, begin + j] * P[place, begin + j]
        rows.order[k], pivot[k], rows.turns = place, P[place, begin + k], place + 1
        smallest, largest = min(smallest, pivot[k]), max(largest, pivot[k])
    # Written so that NaN is rounding.
    return smallest > max(RANK_TOLERANCE * largest, floor)


@part
def _turn_back(rows: ChainRows, begin: int) -> None:
    """Undo the reflections of p for a level that begins with a row, if there were any."""
    while rows.turns > rows.used:
        place = rows.turns - 1
        v = rows.V[place]
        reflect_columns(rows.P, place, len(rows.P), begin, v, rows.tau[place], rows.shares)
        rows.turns = place


@part
def _swap(X: Float64[np.ndarray, "n m"], a: int, b: int) -> None:
    """Swap two columns."""
    for i in range(len(X)):
        X[i, a], X[i, b] = X[i, b], X[i, a]


@part
def _find_moved(rows: ChainRows, begin: int, end: int) -> None:
    """Find the squared motion of some rows of a level by x."""
    moved = rows.moved[: end - begin]
    for k in range(len(moved)):
        moved[k] = 0.0
    for i in range(len(rows.ease)):
        own, ease = rows.E[i, begin:end], rows.ease[i]
        for k in range(len(moved)):
            moved[k] += ease * own[k] * own[k]


@part
def _count_strong(rows: ChainRows, rank: int, floor: float) -> int:
    """Count the first pivots of a level that are strong."""
    strong, pivot = 0, rows.pivot
    # Written so that NaN ends it.
    while strong < rank and pivot[strong] > max(WEAK * np.sqrt(rows.moved[strong]), floor):
        strong += 1
    return strong


@part
def _substitute(rows: ChainRows, begin: int, strong: int) -> None:
    """Solve a level's triangular rows for their p, and substitute those in the rows below."""
    # Lower triangular where p was turned for it, upper where the rows were.
    fixed, lower = len(rows.E), rows.turns > rows.used
    for step in range(strong):
        k = step if lower else strong - 1 - step
        place = rows.order[k]
        own = rows.P[place]
        scale = 1.0 / own[begin + k]
        for i in range(fixed + rows.kept):
            weak = rows.weak[i - fixed] if i >= fixed else 0
            row = rows.E[i] if i < fixed else rows.P[weak]
            share = row[begin + k] * scale
            rows.G[i if i < fixed else fixed + weak, place] = share
            for m in range(len(row)):
                row[m] -= share * own[m]


@part
def _keep(rows: ChainRows, place: int) -> None:
    """Make one of p an unknown s, that depends on itself alone."""
    own = rows.G[len(rows.E) + place]
    for i in range(len(rows.G)):
        rows.G[i, place] = 0.0
    for k in range(len(own)):
        own[k] = 0.0
    own[place] = -1.0
    rows.weak[rows.kept] = place
    rows.kept += 1


@part
def _find_reached(rows: ChainRows, begin: int, end: int, floor: float) -> int:
    """Combine a level's rows so that the freedom left reaches the first ones alone."""
    used, free, rest, order = rows.used, len(rows.P) - rows.used, rows.rest, rows.order
    for i in range(free):
        order[i], rest[i] = used + i, _square(rows.P[used + i, begin:end])
    first, size, rank = 0.0, 0.0, 0
    while rank < min(end - begin, free):
        best = rank
        for i in range(rank + 1, free):
            if rest[i] > rest[best]:
                best = i
        order[rank], order[best] = order[best], order[rank]
        rest[best] = rest[rank]
        own = rows.P[order[rank], begin + rank : end]
        # Not from the rest, which is no more accurate than the tolerance.
        size = np.sqrt(_square(own))
        first = max(first, size)
        # Written so that NaN ends it.
        if not size > max(RANK_TOLERANCE * first, floor):
            break
        tau = _combine(rows, own, begin + rank, 0)
        reflect_rows(rows.P, order[rank:free], begin + rank, rows.vector[: len(own)], tau)
        for i in range(rank + 1, free):
            rest[i] -= rows.P[order[i], begin + rank] ** 2
        for k in range(1, len(own)):
            own[k] = 0.0
        rows.pivot[rank] = own[0]
        rank += 1
    for k in range(begin + rank, end):
        for i in range(rank, free):
            rows.P[order[i], k] = 0.0
        for i in range(len(rows.E) if np.isnan(size) else 0):
            # The solver of the rest has to refuse it.
            rows.E[i, k] = np.nan
    return rank


@part
def _square(x: Float64[np.ndarray, " n"]) -> float:
    """Return the squared length."""
    square = 0.0
    for k in range(len(x)):
        square += x[k] * x[k]
    return square


@part
def _compress(rows: ChainRows, begin: int, end: int, floor: float) -> int:
    """Combine rows that p does not reach to no more than they have unknowns."""
    fixed, rank = len(rows.E), 0
    unknowns = fixed - 1 + rows.kept
    if end - begin <= unknowns:
        return end - begin
    for i in range(unknowns):
        row = rows.E[i] if i < fixed - 1 else rows.P[rows.weak[i - fixed + 1]]
        own = row[begin + rank : end]
        # Written so that NaN is a coefficient.
        if not _square(own) <= floor * floor:
            _combine(rows, own, begin + rank, i)
            rank += 1
            own = own[1:]
        for k in range(len(own)):
            own[k] = 0.0
    return rank


@part
def _combine(rows: ChainRows, own: Float64[np.ndarray, " n"], begin: int, done: int) -> float:
    """Reflect some rows so that the first alone has a coefficient of one unknown."""
    turned, v = rows.turned[: len(own)], rows.vector[: len(own)]
    for k in range(len(own)):
        turned[k] = own[k]
    tau = make_reflection(turned, v)
    # The last of E are the constants, which always count.
    first = min(done, len(rows.E) - 1)
    reflect_rows(rows.E, rows.every[first:], begin, v, tau)
    reflect_rows(rows.P, rows.weak[done - first : rows.kept], begin, v, tau)
    return tau


@part
def _largest(X: Float64[np.ndarray, "n m"], count: int, begin: int, end: int) -> float:
    """Return the largest absolute coefficient of the first unknowns in some rows."""
    largest = 0.0
    for i in range(count):
        own = X[i, begin:end]
        for k in range(len(own)):
            largest = max(largest, abs(own[k]))
    return largest


class Elimination(MemoryBlock):
    """A `ChainElimination` for compiled code."""

    reduced: ReducedMatrices
    J: Float64[np.ndarray, "t nv"]  # coefficients of dv of the tasks' rows
    target: Float64[np.ndarray, " t"]  # their right-hand sides
    weight: Float64[np.ndarray, " t"]  # of each row in its level
    second: Int64[np.ndarray, " m"]  # rows that need the unconstrained chain's own joints
    moving: Int64[np.ndarray, " moving"]  # coordinates of `u` that may move each
    moving_ends: Int64[np.ndarray, " moving_ends"]  # of those of each; the first entry is zero
    seen: Int64[np.ndarray, " seen"]  # places in `a` of the coordinates that may move any
    through: Int64[np.ndarray, " through"]  # rows that move with the centroids
    variables: Int64[np.ndarray, " x"]  # of LQP 1 that x = (dv_seen, z) are
    rows: ChainRows  # the second ones, eliminated
    centroid: Float64[np.ndarray, "nz through"]  # coefficients of z; a column for each row
    turned: Float64[np.ndarray, "nu wide"]  # scratch: the carriers' rows, then both, in (z, p)
    shares: Float64[np.ndarray, " wide"]  # scratch
    dv_u: Float64[np.ndarray, " nu"]  # acceleration of the unconstrained chain, once it is known
    y: Float64[np.ndarray, " y_np"]  # scratch: (x, 1, s)
    zp: Float64[np.ndarray, " nu"]  # scratch: (z, p)


class ChainElimination:
    """Takes the motions inside the unconstrained chain out of the hierarchy, exactly.

    With dv_u = Jbar_z z + N_z p, a row of a task in the unconstrained chain is T x + N p = r with
    x = (dv_a, z). Nothing else depends on p, and its energy is p^T p / 2. So p can be chosen for
    any x, level by level: with the weighted rows of a level split into those directions that the
    freedom Z left by the levels above reaches and those that it does not,

        W N Z = U1 T1 V1^T          Z <- Z V2         [U1 U2], [V1 V2] orthogonal
        p <- p - Z V1 T1^-1 U1^T W (T x + N p - r)    meets those reached, for any x
        U2^T W (T x + N p - r) = 0                    remains for x, at the same level

    In the end p = c - G x, and its energy belongs to x. LQP 1 with the rows that are left and the
    energy |c - G x|^2 / 2 has the solution of the whole problem as long as no limit of the
    unconstrained chain is active, whatever the order of its tasks. Where two full arms do not
    use up the freedom, their levels become empty. Directions in which an arm hardly moves,
    near a singular posture, are not eliminated but join x as unknowns s, with their rows.

    Of a level whose rows outnumber what they depend on, as those of a posture do once the arms have
    used up the freedom, an orthogonal combination remains: no more rows than unknowns, however many
    joints the chain has. Of dv_a only those coordinates count that move a frame of such a task.

    A task that turns out to move with the centroids alone, N = 0, is left to LQP 1 as it is.
    """

    def __init__(self, reduced: ReducedDynamics, rows: AssignedRows) -> None:
        chains, seen = reduced.partition, rows.seen
        inside, fixed = chains.nu - chains.nz, 1 + len(seen) + chains.nz
        self._rows = chain_rows(fixed, inside, rows.second_ends)
        wide = len(reduced.matrices.shares) + len(rows.second) + len(rows.centroid)
        self.block = allocate(
            Elimination,
            {"nu": chains.nu, "nz": chains.nz, "through": len(rows.centroid), "wide": wide}
            | {"y_np": fixed + inside},
            reduced=reduced.matrices,
            J=rows.J,
            target=rows.target,
            weight=rows.weight,
            second=rows.second,
            moving=rows.moving,
            moving_ends=rows.moving_ends,
            seen=seen,
            through=rows.centroid,
            variables=np.concatenate((seen, np.arange(chains.na, chains.nr))),
            rows=self._rows,
        )

    def update(self, dynamics: Dynamics) -> None:
        """Reduce the dynamics, and eliminate p for the state of the tasks."""
        _eliminate(self.block.address, dynamics.numbers.address)

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of unknowns s, then of rows left in each level."""
        return (self._rows.kept, *self._rows.left.tolist())


def announce() -> None:
    """Log that the reduced controller is about to be compiled, unless it already was."""
    say_if_slow(_eliminate, "the reduced controller")


@compiled
def _eliminate(address: int, state_at: int) -> None:
    eliminate_chain(view(Elimination, address), view(StateNumbers, state_at))


@part
def eliminate_chain(chain: Elimination, state: StateNumbers) -> None:
    """Reduce the dynamics, and eliminate p for the state of the tasks."""
    _read_rows(chain)
    reduce_dynamics(chain.reduced, chain.turned, chain.shares, state)
    if len(chain.turned) > 0:
        _sort_coordinates(chain)
        eliminate(chain.rows)


@part
def _read_rows(chain: Elimination) -> None:
    """Read weighted rows, at coordinates that move them."""
    a, u, X, E = chain.reduced.a, chain.reduced.u, chain.turned, chain.rows.E
    first = len(chain.reduced.shares)
    X[:] = 0.0
    for k in range(len(chain.second)):
        row = chain.second[k]
        own, weight = chain.J[row], chain.weight[row]
        for at in range(chain.moving_ends[k], chain.moving_ends[k + 1]):
            i = chain.moving[at]
            X[i, first + k] = weight * own[u[i]]
        for i in range(len(chain.seen)):
            E[i, k] = weight * own[a[chain.seen[i]]]
        E[len(E) - 1, k] = -weight * chain.target[row]
    # LQP 1 weighs these itself.
    for k in range(len(chain.through)):
        own = chain.J[chain.through[k]]
        for i in range(len(u)):
            X[i, first + len(chain.second) + k] = own[u[i]]


@part
def _sort_coordinates(chain: Elimination) -> None:
    """Sort coefficients into those of z and of p."""
    rows, nz, order = chain.rows, len(chain.centroid), chain.reduced.factors.order
    first, m = len(chain.reduced.shares), len(chain.second)
    for i in range(len(rows.ease)):
        rows.ease[i] = 1.0 / chain.reduced.M[chain.variables[i], chain.variables[i]]
    for i in range(len(order)):
        own = chain.turned[order[i]]
        kept = rows.E[len(chain.seen) + i] if i < nz else rows.P[i - nz]
        for k in range(m):
            kept[k] = own[first + k]
        if i < nz:
            for k in range(len(chain.through)):
                chain.centroid[i, k] = own[first + m + k]


@part
def recover(chain: Elimination, x: Float64[np.ndarray, " n"]) -> None:
    """Find the acceleration of the unconstrained chain for a solution of LQP 1."""
    if len(chain.dv_u) == 0:
        return
    nz, fixed, nr = len(chain.centroid), len(chain.variables), len(chain.reduced.M)
    for i in range(fixed):
        chain.y[i] = x[chain.variables[i]]
    chain.y[fixed] = 1.0
    for i in range(chain.rows.kept):
        chain.y[fixed + 1 + i] = x[nr + i]
    for i in range(nz):
        chain.zp[i] = x[nr - nz + i]
    answer(chain.rows, chain.y, chain.zp[nz:])
    from_coordinates(chain.zp, chain.reduced.factors, chain.dv_u)
