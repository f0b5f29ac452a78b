"""Memory of the compiled search: the problem that it reads, and its workspace, grouped by purpose.

The annotations are the layout; `make_work` gives the named sizes their values.
"""

from typing import Any

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import MemoryBlock, allocate

Vector = Float64[np.ndarray, " _"]
Matrix = Float64[np.ndarray, "_ _"]
Indices = Int64[np.ndarray, " _"]
"""Arrays of any shape, for compiled functions; the fields below have the shapes."""

BEGINNING, EXCHANGING, LEAPING, STEPPING = range(4)
"""Phases of the search."""

LAST, GUESS, NOTHING = range(3)
"""Origins of the active set that the search began with: the last solve, a guess, nothing."""

EQUALITY = 2
"""Instead of a side: the row is always active."""

LOCKED, RELEASED = 1, 2
"""States of a row since the point moved: it came back when it was deactivated, and stays active; it
was deactivated, and will stay active when it comes back."""

UNKNOWN = -9
"""In `RowStates.factored`: no side, so that the row's level is refactored."""


class Problem(MemoryBlock):
    """A problem as `HierarchicalProblem` stores it."""

    A: Float64[np.ndarray, "m n"]  # rows of all levels
    lower: Float64[np.ndarray, " nm"]  # bounds of the variables, then of the rows
    upper: Float64[np.ndarray, " nm"]  # bounds of the variables, then of the rows
    weights: Float64[np.ndarray, " nm"]  # of the slack of the variables' bounds, then of the rows
    H: Float64[np.ndarray, "n n"]  # of the final cost
    g: Float64[np.ndarray, " n"]  # of the final cost
    damping: Float64[np.ndarray, " p"]  # of each level, 0 for none
    starts: Int64[np.ndarray, " p1"]  # begin of each level's rows in A, and their end
    bounds_level: int  # level of the bounds of the variables


class State(MemoryBlock):
    """Numbers that steer the search."""

    begun: int  # 1 once the search of a problem has begun
    changes: int  # changes of the active set, or factorisations, so far
    phase: int  # `BEGINNING` or what follows it
    origin: int  # `LAST` or what follows it
    guess_at: int  # count of changes after which a guess comes
    turn: int  # count of exchanges or leaps since the phase began
    violated: int  # count of rows violated at the point regarded last
    fewest: int  # least count of wrong rows after a leap
    since: int  # leaps since that count
    idle: int  # steps that did not move the point
    blocked: int  # 1 if a row stopped the last step
    deactivated: int  # row that a step deactivated last, or -1
    doubtful: int  # 1 if a row with a multiplier of the wrong sign had to stay active
    unsettled: int  # 1 if rows may not be where their level was solved
    free: int  # count of coordinates that no level takes


class RowStates(MemoryBlock):
    """Bounds of the variables and rows, in the search."""

    norm: Float64[np.ndarray, " nm"]  # norm of its coefficients
    level: Int64[np.ndarray, " nm"]  # its level
    side: Int64[np.ndarray, " nm"]  # 1, -1: active at the upper, lower bound; 2: equality; 0
    sign_free: Int64[np.ndarray, " nm"]  # 1 if lower levels' multipliers may have either sign
    locked: Int64[np.ndarray, " nm"]  # `LOCKED`, `RELEASED` or 0, since the point moved
    returns: Int64[np.ndarray, " nm"]  # times that it came back as soon as it was deactivated
    needed_by: Int64[np.ndarray, " nm"]  # level that needs it active, counted from 1, or 0
    guarded: Int64[np.ndarray, " nm"]  # 1 if its remainder is kept from lower levels
    factored: Int64[np.ndarray, " nm"]  # side and sign freedom when its level was factored
    violation: Float64[np.ndarray, " nm"]  # signed, of an inactive row, by its norm
    shift: Float64[np.ndarray, " nm"]  # of the bounds of an equality, by damping


class Points(MemoryBlock):
    """The point and its target."""

    x: Float64[np.ndarray, " n"]  # best point so far
    values: Float64[np.ndarray, " nm"]  # of all bounds and rows there
    target: Float64[np.ndarray, " n"]  # optimum of the active set
    target_values: Float64[np.ndarray, " nm"]  # of all bounds and rows there


class Factor(MemoryBlock):
    """Active rows, level by level, in the coordinates y = Q^T x."""

    V: Float64[np.ndarray, "n n"]  # vectors of Q's reflections, each from the diagonal on
    tau: Float64[np.ndarray, " n"]  # their factors
    R: Float64[np.ndarray, "nm n"]  # active rows times their weights, in y
    order: Int64[np.ndarray, " nm"]  # bound or row of each active row
    bound: Float64[np.ndarray, " nm"]  # bound that it is active at, times its weight
    size: Float64[np.ndarray, " nm"]  # its norm times its weight
    slack: Float64[np.ndarray, " nm"]  # at the optimum of the active set, times its weight
    rhs: Float64[np.ndarray, " nm"]  # its bound less the part of the levels above
    left: Float64[np.ndarray, " nm"]  # squared length of its part outside those before it
    left_exact: Float64[np.ndarray, " nm"]  # the same when last computed, not updated
    begin: Int64[np.ndarray, " p1"]  # begin of each level's active rows
    first: Int64[np.ndarray, " p1"]  # count of coordinates that the levels above take
    rank: Int64[np.ndarray, " p"]  # of each level's pivots; guarded rows follow them
    y: Float64[np.ndarray, " n"]  # optimum of the active set
    whole: int  # count of levels whose rows in R are whole; of others some first columns are unset
    Q: Float64[np.ndarray, "n n"]  # columns of Q after the coordinates of those levels
    above: Float64[np.ndarray, " n"]  # point x of the coordinates before them


class LeastSquares(MemoryBlock):
    """Memory for the least squares of one level."""

    T: Float64[np.ndarray, "n nmn"]  # system, transposed
    V: Float64[np.ndarray, "n nmn"]  # vectors of the reflections that solve it
    tau: Float64[np.ndarray, " nm"]  # their factors
    v: Float64[np.ndarray, " nmn"]  # one more of those vectors
    rhs: Float64[np.ndarray, " nmn"]  # right side, then the solution
    u: Float64[np.ndarray, " n"]  # slack of the pivots, or coordinates of a damped level
    balance: Float64[np.ndarray, " n"]  # slack of each pivot that balances the other rows
    noise: Float64[np.ndarray, " n"]  # size of the terms of that balance


class FinalCost(MemoryBlock):
    """Final cost over the coordinates that no level takes."""

    gradient: Float64[np.ndarray, " n"]  # H x + g
    Z: Float64[np.ndarray, "n n"]  # basis of the free directions, one a row
    HZ: Float64[np.ndarray, "n n"]  # H times each direction, one a row
    C: Float64[np.ndarray, "n n"]  # Z^T H Z, then its factor; in a guess, that of H
    pivot: Int64[np.ndarray, " n"]  # order of its pivots
    z: Float64[np.ndarray, " n"]  # length along each direction


class Duals(MemoryBlock):
    """Multipliers, and the gradient that they balance."""

    multipliers: Float64[np.ndarray, "p1 nm"]  # of the levels, then of the final cost
    gradient: Float64[np.ndarray, " n"]  # of a level or the final cost
    turned: Float64[np.ndarray, " n"]  # the same in y
    chosen: Int64[np.ndarray, " nm"]  # list of rows
    forces: Float64[np.ndarray, " nm"]  # their multipliers times their sizes and sides


class Measures(MemoryBlock):
    """Measures of the point."""

    slacks: Float64[np.ndarray, " nm"]  # of all bounds and rows, signed
    residuals: Float64[np.ndarray, " p"]  # of each level
    relative: Float64[np.ndarray, " p"]  # of each level, by its scale
    target_residuals: Float64[np.ndarray, " p"]  # of each level, at the target
    eased: Float64[np.ndarray, " p"]  # square of the damping that each level needed


class Penalties(MemoryBlock):
    """Rows of a guess, active ones in the order of activation; in part shared memory."""

    M: Float64[np.ndarray, "nm n"]  # C^-1 a of all bounds and rows
    norm: Float64[np.ndarray, " nm"]  # of those
    start: Float64[np.ndarray, " nm"]  # their values at x_0, the optimum of the final cost alone
    values: Float64[np.ndarray, " nm"]  # their values at x
    lower: Float64[np.ndarray, " nm"]  # their bounds
    upper: Float64[np.ndarray, " nm"]  # their bounds
    level: Int64[np.ndarray, " nm"]  # of each
    side: Int64[np.ndarray, " nm"]  # of each, as in `RowStates`
    sign_free: Int64[np.ndarray, " nm"]  # 1 if an active row's multiplier may have either sign
    needed_by: Int64[np.ndarray, " nm"]  # as in `RowStates`, with the sign of the side
    compliance: Float64[np.ndarray, " nm"]  # D, way of each row per unit of its multiplier
    moved: Float64[np.ndarray, " nm"]  # displacement of each bound
    held: Float64[np.ndarray, " nm"]  # displacement by slack of levels that could not be met
    C: Float64[np.ndarray, "n n"]  # Cholesky factor of the final cost
    y: Float64[np.ndarray, " n"]  # C^T (x_0 - x)
    order: Int64[np.ndarray, " nm"]  # bound or row of each active row
    G: Float64[np.ndarray, "g g"]  # Cholesky factor of M M^T + D of the active rows
    rhs: Float64[np.ndarray, " nm"]  # right side of each active row, divided by the factor
    multiplier: Float64[np.ndarray, " nm"]  # lambda of each active row
    next_multiplier: Float64[np.ndarray, " nm"]  # lambda after the next step


class SearchWork(MemoryBlock):
    """Workspace of the search."""

    state: State
    rows: RowStates
    points: Points
    factor: Factor
    squares: LeastSquares
    cost: FinalCost
    duals: Duals
    answer: Measures
    guessed: Penalties


def make_work(n: int, m: int, levels: int) -> SearchWork:
    """Allocate the workspace of problems of a size."""
    sizes = {"n": n, "m": m, "nm": n + m, "nmn": n + m + n, "p": levels, "p1": levels + 1}
    # More rows are never active in a guess.
    sizes["g"] = min(3 * n, n + m)
    rows, factor = allocate(RowStates, sizes), allocate(Factor, sizes)
    points, cost = allocate(Points, sizes), allocate(FinalCost, sizes)
    # A guess overwrites the factorisation, which it makes useless.
    shared: dict[str, Any] = {
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
    guessed = allocate(Penalties, sizes, **shared)
    return allocate(
        SearchWork, sizes, rows=rows, factor=factor, points=points, cost=cost, guessed=guessed
    )
