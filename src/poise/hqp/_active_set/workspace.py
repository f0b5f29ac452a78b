"""What the compiled search reads, and where it keeps everything it makes, grouped by purpose.

Handing an array to compiled code costs as much as a reflection. So all arrays lie in two buffers,
which compiled code cuts up, and the numbers that steer the search in one record.
"""

from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import compiled, part

Vector = Float64[np.ndarray, " _"]
Matrix = Float64[np.ndarray, "_ _"]
Indices = Int64[np.ndarray, " _"]
"""What compiled functions take; shapes stand with the fields of the groups."""

BEGINNING, EXCHANGING, LEAPING, STEPPING = range(4)
"""Phases of the search."""

LAST, GUESS, NOTHING = range(3)
"""Where the active set came from that the search began with: the last solve, a guess, nothing."""

EQUALITY = 2
"""The side of a row that has no side: it is always active."""

UNKNOWN = -9
"""In `Rows.factored`: no side, so that the row's level is factored anew."""


class Problem(NamedTuple):
    """A problem as `HierarchicalProblem` stores it.

    Attributes:
        A: rows of all levels.
        lower: bounds of the variables, then of the rows.
        upper: bounds of the variables, then of the rows.
        weights: of the slack of the variables' bounds, then of the rows.
        H: of the final cost.
        g: of the final cost.
        damping: of each level, 0 for none.
        starts: where each level's rows begin in A, and where the last one's end.
        bounds_level: to which level the bounds of the variables belong.
    """

    A: Float64[np.ndarray, "m n"]
    lower: Float64[np.ndarray, " nm"]
    upper: Float64[np.ndarray, " nm"]
    weights: Float64[np.ndarray, " nm"]
    H: Float64[np.ndarray, "n n"]
    g: Float64[np.ndarray, " n"]
    damping: Float64[np.ndarray, " p"]
    starts: Int64[np.ndarray, " p1"]
    bounds_level: int


@runtime_checkable
class State(Protocol):
    """The numbers that steer the search: a record, of which compiled code changes the fields.

    Attributes:
        floats: how many floats of the buffer are cut off.
        ints: how many integers of the buffer are cut off.
        begun: whether the search of a problem has begun.
        changes: of the active set, or factorisations, so far.
        phase: `BEGINNING` or what follows it.
        origin: `LAST` or what follows it.
        guess_at: the number of changes after which a guess comes.
        turn: which exchange or leap since the phase began.
        fewest: wrong rows that a leap has left.
        since: leaps since then.
        idle: steps that did not move the point.
        blocked: whether the last step was stopped by a row.
        deactivated: the row that a step deactivated last, or -1.
        doubtful: whether a row with a multiplier of the wrong sign had to stay active.
        free: how many coordinates no level has taken.
    """

    floats: int
    ints: int
    begun: int
    changes: int
    phase: int
    origin: int
    guess_at: int
    turn: int
    fewest: int
    since: int
    idle: int
    blocked: int
    deactivated: int
    doubtful: int
    free: int


STATE = np.dtype((np.record, [(name, np.int64) for name in State.__annotations__]))
"""`State` as NumPy stores it."""

States = Any
"""An array of one `STATE`: compiled functions may return it, but not the record itself."""


class Rows(NamedTuple):
    """What the search knows of each bound of a variable and each row.

    Attributes:
        norm: of its coefficients.
        level: the level it belongs to.
        side: 1 active at the upper bound, -1 at the lower one, 2 an equality, 0 inactive.
        sign_free: whether its multiplier may have either sign on the levels further down.
        locked: whether it came back at once when it was deactivated.
        needed_by: the level that needs it active, counted from one; 0 where nobody knows.
        factored: side and sign freedom when its level was factored.
        violation: signed distance of an inactive row outside its interval, by its norm.
        shift: by how much damping moved the bounds of an equality.
    """

    norm: Float64[np.ndarray, " nm"]
    level: Int64[np.ndarray, " nm"]
    side: Int64[np.ndarray, " nm"]
    sign_free: Int64[np.ndarray, " nm"]
    locked: Int64[np.ndarray, " nm"]
    needed_by: Int64[np.ndarray, " nm"]
    factored: Int64[np.ndarray, " nm"]
    violation: Float64[np.ndarray, " nm"]
    shift: Float64[np.ndarray, " nm"]


class Points(NamedTuple):
    """The point, and where it goes.

    Attributes:
        x: the best point so far.
        values: of all bounds and rows there.
        target: the optimum of the active set.
        target_values: of all bounds and rows there.
    """

    x: Float64[np.ndarray, " n"]
    values: Float64[np.ndarray, " nm"]
    target: Float64[np.ndarray, " n"]
    target_values: Float64[np.ndarray, " nm"]


class Factor(NamedTuple):
    """The active rows, level by level, in the coordinates y = Q^T x.

    Attributes:
        V: vectors of the reflections that make up Q, each from its own place on.
        tau: their factors.
        R: active rows, times their weights, in y.
        order: which bound or row each of them is.
        bound: the bound it is active at, times its weight.
        size: its norm, times its weight.
        slack: at the optimum of the active set, times its weight.
        rhs: what the levels above leave of its bound.
        left: part of it outside those before it, squared.
        left_exact: the same when it was computed last, not updated.
        begin: where each level's active rows begin.
        first: how many coordinates the levels above each have taken.
        rank: how many each takes.
        y: the optimum of the active set.
    """

    V: Float64[np.ndarray, "n n"]
    tau: Float64[np.ndarray, " n"]
    R: Float64[np.ndarray, "nm n"]
    order: Int64[np.ndarray, " nm"]
    bound: Float64[np.ndarray, " nm"]
    size: Float64[np.ndarray, " nm"]
    slack: Float64[np.ndarray, " nm"]
    rhs: Float64[np.ndarray, " nm"]
    left: Float64[np.ndarray, " nm"]
    left_exact: Float64[np.ndarray, " nm"]
    begin: Int64[np.ndarray, " p1"]
    first: Int64[np.ndarray, " p1"]
    rank: Int64[np.ndarray, " p"]
    y: Float64[np.ndarray, " n"]


class LeastSquares(NamedTuple):
    """Room for the least squares of one level.

    Attributes:
        T: its system, transposed.
        V: vectors of the reflections that solve it.
        tau: their factors.
        v: one more of those vectors.
        rhs: right side, then the solution.
        u: slack of the pivots, or coordinates of a damped level.
        balance: what the other rows ask of each pivot's slack.
        noise: the size of what cancels in that.
    """

    T: Float64[np.ndarray, "n nmn"]
    V: Float64[np.ndarray, "n nmn"]
    tau: Float64[np.ndarray, " nm"]
    v: Float64[np.ndarray, " nmn"]
    rhs: Float64[np.ndarray, " nmn"]
    u: Float64[np.ndarray, " n"]
    balance: Float64[np.ndarray, " n"]
    noise: Float64[np.ndarray, " n"]


class FinalCost(NamedTuple):
    """The final cost over what no level has taken.

    Attributes:
        gradient: H x + g.
        Z: basis of what no level has taken, one direction a row.
        ZT: the same, transposed.
        HZ: H times each direction, one a row.
        C: Z^T H Z, and its Cholesky factor, or that of H in a guess.
        pivot: order of its pivots.
        z: how far to go along each direction.
    """

    gradient: Float64[np.ndarray, " n"]
    Z: Float64[np.ndarray, "n n"]
    ZT: Float64[np.ndarray, "n n"]
    HZ: Float64[np.ndarray, "n n"]
    C: Float64[np.ndarray, "n n"]
    pivot: Int64[np.ndarray, " n"]
    z: Float64[np.ndarray, " n"]


class Duals(NamedTuple):
    """Multipliers, and what they balance.

    Attributes:
        multipliers: of each level, then of the final cost, over all bounds and rows.
        gradient: of a level or the final cost, in y or in x.
        chosen: rows that stand in a list.
        forces: their multipliers, times their sizes and sides.
    """

    multipliers: Float64[np.ndarray, "p1 nm"]
    gradient: Float64[np.ndarray, " n"]
    chosen: Int64[np.ndarray, " nm"]
    forces: Float64[np.ndarray, " nm"]


class Answer(NamedTuple):
    """What a point amounts to.

    Attributes:
        slacks: of all bounds and rows, signed.
        residuals: of each level.
        relative: of each level, by its scale.
        target_residuals: of each level, at the target.
        eased: square of the damping that each level needed.
    """

    slacks: Float64[np.ndarray, " nm"]
    residuals: Float64[np.ndarray, " p"]
    relative: Float64[np.ndarray, " p"]
    target_residuals: Float64[np.ndarray, " p"]
    eased: Float64[np.ndarray, " p"]


class Penalties(NamedTuple):
    """The rows of a guess; an active row counts in the order in which it entered.

    Compiled functions count the owners of every array that they are handed, which takes longer than
    a step of a small guess. So those of a guess are handed no more than this, some of it lent.

    Attributes:
        M: C^-1 a of all bounds and rows.
        norm: of all of them.
        start: their values at x_0, the optimum of the final cost alone.
        values: their values at x.
        lower: their bounds.
        upper: their bounds.
        level: of each.
        side: of each, as in `Rows`.
        sign_free: whether an active row's multiplier may have either sign.
        needed_by: the level that needed a row, counted from one, with the sign of its side; 0 where
            it was inactive.
        compliance: D, how much each gives way to its multiplier.
        moved: by how much each bound is moved.
        held: the same, where a level above could not be met.
        C: Cholesky factor of the final cost.
        y: C^T (x - x_0).
        order: bound or row of each active row.
        G: Cholesky factor of M M^T + D of the active rows.
        rhs: right side of each active row, divided by the factor.
        multiplier: lambda of each active row.
        next_multiplier: where the next step takes it.
    """

    M: Float64[np.ndarray, "nm n"]
    norm: Float64[np.ndarray, " nm"]
    start: Float64[np.ndarray, " nm"]
    values: Float64[np.ndarray, " nm"]
    lower: Float64[np.ndarray, " nm"]
    upper: Float64[np.ndarray, " nm"]
    level: Int64[np.ndarray, " nm"]
    side: Int64[np.ndarray, " nm"]
    sign_free: Int64[np.ndarray, " nm"]
    needed_by: Int64[np.ndarray, " nm"]
    compliance: Float64[np.ndarray, " nm"]
    moved: Float64[np.ndarray, " nm"]
    held: Float64[np.ndarray, " nm"]
    C: Float64[np.ndarray, "n n"]
    y: Float64[np.ndarray, " n"]
    order: Int64[np.ndarray, " nm"]
    G: Float64[np.ndarray, "g g"]
    rhs: Float64[np.ndarray, " nm"]
    multiplier: Float64[np.ndarray, " nm"]
    next_multiplier: Float64[np.ndarray, " nm"]


class Work(NamedTuple):
    """Everything the search keeps.

    Attributes:
        states: what steers it, one record.
        rows: what it knows of each row.
        points: where it is, and where it goes.
        factor: the active rows, factored.
        squares: room for a level's least squares.
        cost: the final cost over what is left.
        duals: multipliers.
        answer: what the point amounts to.
        spare: room for the rows of a guess, see `cut_penalties`.
    """

    states: States
    rows: Rows
    points: Points
    factor: Factor
    squares: LeastSquares
    cost: FinalCost
    duals: Duals
    answer: Answer
    spare: Float64[np.ndarray, " s"]


class _Buffers(NamedTuple):
    floats: Vector
    ints: Indices
    state: State


@compiled
def cut(floats: Vector, ints: Indices, states: States, n: int, m: int, levels: int) -> Work:
    """Cuts two buffers up into everything the search needs.

    Args:
        floats: the first buffer; where it is too short, arrays are empty and only counted.
        ints: the second buffer.
        states: one record, of which `floats` and `ints` then say how much was needed.
        n: number of variables.
        m: number of rows.
        levels: number of levels.
    """
    state, nm = states[0], n + m
    state.floats = state.ints = 0
    buffers = _Buffers(floats=floats, ints=ints, state=state)
    rows = _cut_rows(buffers, nm)
    points = Points(
        x=_floats(buffers, n),
        values=_floats(buffers, nm),
        target=_floats(buffers, n),
        target_values=_floats(buffers, nm),
    )
    factor = _cut_factor(buffers, n, nm, levels)
    cost = FinalCost(
        gradient=_floats(buffers, n),
        Z=_matrix(buffers, n, n),
        ZT=_matrix(buffers, n, n),
        HZ=_matrix(buffers, n, n),
        C=_matrix(buffers, n, n),
        pivot=_ints(buffers, n),
        z=_floats(buffers, n),
    )
    return Work(
        states=states,
        rows=rows,
        points=points,
        factor=factor,
        squares=LeastSquares(
            T=_matrix(buffers, n, nm + n),
            V=_matrix(buffers, n, nm + n),
            tau=_floats(buffers, nm),
            v=_floats(buffers, nm + n),
            rhs=_floats(buffers, nm + n),
            u=_floats(buffers, n),
            balance=_floats(buffers, n),
            noise=_floats(buffers, n),
        ),
        cost=cost,
        duals=Duals(
            multipliers=_matrix(buffers, levels + 1, nm),
            gradient=_floats(buffers, n),
            chosen=_ints(buffers, nm),
            forces=_floats(buffers, nm),
        ),
        answer=Answer(
            slacks=_floats(buffers, nm),
            residuals=_floats(buffers, levels),
            relative=_floats(buffers, levels),
            target_residuals=_floats(buffers, levels),
            eased=_floats(buffers, levels),
        ),
        spare=_floats(buffers, 8 * nm + min(3 * n, nm) ** 2),
    )


@part
def _cut_rows(buffers: _Buffers, nm: int) -> Rows:
    return Rows(
        norm=_floats(buffers, nm),
        level=_ints(buffers, nm),
        side=_ints(buffers, nm),
        sign_free=_ints(buffers, nm),
        locked=_ints(buffers, nm),
        needed_by=_ints(buffers, nm),
        factored=_ints(buffers, nm),
        violation=_floats(buffers, nm),
        shift=_floats(buffers, nm),
    )


@part
def _cut_factor(buffers: _Buffers, n: int, nm: int, levels: int) -> Factor:
    return Factor(
        V=_matrix(buffers, n, n),
        tau=_floats(buffers, n),
        R=_matrix(buffers, nm, n),
        order=_ints(buffers, nm),
        bound=_floats(buffers, nm),
        size=_floats(buffers, nm),
        slack=_floats(buffers, nm),
        rhs=_floats(buffers, nm),
        left=_floats(buffers, nm),
        left_exact=_floats(buffers, nm),
        begin=_ints(buffers, levels + 1),
        first=_ints(buffers, levels + 1),
        rank=_ints(buffers, levels),
        y=_floats(buffers, n),
    )


@part
def cut_penalties(problem: Problem, work: Work) -> Penalties:
    """Cuts up the room for the rows of a guess.

    The rows themselves lie where those of the factorisation do, which a guess makes useless.

    Args:
        problem: whose bounds are lent.
        work: whose sides a guess overwrites.
    """
    rows, factor, state = work.rows, work.factor, work.states[0]
    n, nm = len(factor.y), len(rows.side)
    room = min(3 * n, nm)
    state.floats = 0
    buffers = _Buffers(floats=work.spare, ints=rows.side, state=state)
    return Penalties(
        M=factor.R,
        norm=_floats(buffers, nm),
        start=_floats(buffers, nm),
        values=work.points.target_values,
        lower=problem.lower,
        upper=problem.upper,
        level=rows.level,
        side=rows.side,
        sign_free=rows.sign_free,
        needed_by=rows.needed_by,
        compliance=_floats(buffers, nm),
        moved=_floats(buffers, nm),
        held=_floats(buffers, nm),
        C=work.cost.C,
        y=factor.y,
        order=factor.order,
        G=_matrix(buffers, room, room),
        rhs=_floats(buffers, nm),
        multiplier=_floats(buffers, nm),
        next_multiplier=_floats(buffers, nm),
    )


@part
def _floats(buffers: _Buffers, count: int) -> Vector:
    begin = buffers.state.floats
    buffers.state.floats = begin + count
    return buffers.floats[begin : begin + count]


@part
def _matrix(buffers: _Buffers, rows: int, columns: int) -> Matrix:
    numbers = _floats(buffers, rows * columns)
    if len(numbers) < rows * columns:
        return numbers[:0].reshape((0, columns))
    return numbers.reshape((rows, columns))


@part
def _ints(buffers: _Buffers, count: int) -> Indices:
    begin = buffers.state.ints
    buffers.state.ints = begin + count
    return buffers.ints[begin : begin + count]
