"""What the compiled search reads, and where it keeps everything it makes, grouped by purpose.

The annotations are the layout: an array is as long as the names of its sizes say, which `sizes_of`
knows.
"""

from typing import Any

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import Block, allocate

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

LOCKED, RELEASED = 1, 2
"""Of a row at a point: it came back when it was deactivated, and stays; it was deactivated, and
will stay if it comes back."""

UNKNOWN = -9
"""In `Rows.factored`: no side, so that the row's level is factored anew."""


class Problem(Block):
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


class State(Block):
    """The numbers that steer the search.

    Attributes:
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
        unsettled: whether rows may be where their level did not leave them.
        free: how many coordinates no level has taken.
    """

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
    unsettled: int
    free: int


class Rows(Block):
    """What the search knows of each bound of a variable and each row.

    Attributes:
        norm: of its coefficients.
        level: the level it belongs to.
        side: 1 active at the upper bound, -1 at the lower one, 2 an equality, 0 inactive.
        sign_free: whether its multiplier may have either sign on the levels further down.
        locked: `LOCKED`, `RELEASED`, or 0, since a step moved the point.
        needed_by: the level that needs it active, counted from one; 0 where nobody knows.
        guarded: whether what little of it lies outside the rows before it is kept from the levels
            below.
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
    guarded: Int64[np.ndarray, " nm"]
    factored: Int64[np.ndarray, " nm"]
    violation: Float64[np.ndarray, " nm"]
    shift: Float64[np.ndarray, " nm"]


class Points(Block):
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


class Factor(Block):
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
        rank: how many each takes for its pivots; those of guarded rows follow.
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


class LeastSquares(Block):
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


class FinalCost(Block):
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


class Duals(Block):
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


class Answer(Block):
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


class Penalties(Block):
    """The rows of a guess; an active row counts in the order in which it entered.

    Much of it is lent, see `make_work`: a guess makes a factorisation useless.

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


class Work(Block):
    """Everything the search keeps.

    Attributes:
        state: what steers it.
        rows: what it knows of each row.
        points: where it is, and where it goes.
        factor: the active rows, factored.
        squares: room for a level's least squares.
        cost: the final cost over what is left.
        duals: multipliers.
        answer: what the point amounts to.
        guessed: the rows of a guess.
    """

    state: State
    rows: Rows
    points: Points
    factor: Factor
    squares: LeastSquares
    cost: FinalCost
    duals: Duals
    answer: Answer
    guessed: Penalties


def sizes_of(n: int, m: int, levels: int) -> dict[str, int]:
    """Return the sizes that the annotations above name."""
    return {
        "n": n,
        "m": m,
        "nm": n + m,
        "nmn": n + m + n,
        "p": levels,
        "p1": levels + 1,
        # More rows than that are never active in a guess.
        "g": min(3 * n, n + m),
    }


def make_work(n: int, m: int, levels: int) -> Work:
    """Everything the search keeps, empty."""
    sizes = sizes_of(n, m, levels)
    rows, factor = allocate(Rows, sizes), allocate(Factor, sizes)
    points, cost = allocate(Points, sizes), allocate(FinalCost, sizes)
    lent: dict[str, Any] = {
        "M": factor.R,
        "values": points.target_values,
        "level": rows.level,
        "side": rows.side,
        "sign_free": rows.sign_free,
        "needed_by": rows.needed_by,
        "C": cost.C,
        "y": factor.y,
        "order": factor.order,
    }
    guessed = allocate(Penalties, sizes, **lent)
    return allocate(
        Work, sizes, rows=rows, factor=factor, points=points, cost=cost, guessed=guessed
    )
