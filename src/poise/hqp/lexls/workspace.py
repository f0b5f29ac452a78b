"""`Problem` and `Work`: what the compiled search reads, and where it keeps everything it makes.

Handing an array to compiled code costs as much as a reflection, so that all of them lie in two
buffers, and compiled code cuts them up.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import compiled
from poise.hqp.lexls.system import system_count

CHANGES, PHASE, ENOUGH, ORIGIN, LEAPS, FEWEST, SINCE = range(7)
IDLE, RELEASED, BLOCKED, BEGUN, DOUBT, FREE = range(7, 13)
"""Places of the numbers in `Work.state`; the last is how many coordinates no level has taken."""

STATES = 13

BEGINNING, EXCHANGING, LEAPING, STEPPING = range(4)
"""Phases of the search."""

LAST, GUESS, NONE = range(3)
"""Where the active set came from that it began with: the last solve, a guess, nothing."""

EQUALITY = 2
"""The side of a row that has no side: it is always active."""

UNKNOWN = -9
"""In `Work.factored`: no side, so that the row's level is factored anew."""


class Problem(NamedTuple):
    """A problem as `HierarchicalProblem` stores it.

    Attributes:
        A: rows of all levels.
        lower: bounds of the variables, then of the rows.
        upper: likewise.
        weights: likewise.
        H: final cost.
        g: likewise.
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


class Work(NamedTuple):
    """Everything the search keeps; "active row" counts active rows level by level.

    Attributes:
        x: the point.
        target: the optimum of the active set.
        y: the same in the coordinates Q^T x.
        hx: H x + g.
        force: a force in those coordinates.
        tau: factors of the reflections that make up Q.
        values: of all bounds and rows at x.
        goal: likewise at the target.
        norms: of all bounds' and rows' coefficients.
        bound: the bound each active row is active at, times its weight.
        size: norm of each active row, times its weight.
        slack: of each active row at the target, times its weight.
        rest: scratch of a level's active rows.
        left: share of each active row outside those before it, squared.
        kept: the same when it was computed last, not updated.
        shift: by how much damping moved the bounds of equalities.
        slacks: of all bounds and rows at x.
        residuals: of each level.
        relative: likewise, divided by its scale.
        eased: square of the damping that each level needed.
        multipliers: of each level, then of the final cost, over all bounds and rows.
        errors: how far, relatively, active rows are from where they should be, and forces from
            balance.
        V: vectors of the reflections, each from its own place on.
        R: active rows, times their weights, in y.
        right: right side of a level's least squares.
        vector: a reflection that solves it.
        T: its system.
        S: vectors of the reflections that solve it.
        Z: basis of what no level has taken, one direction a row.
        ZT: the same, transposed.
        HZ: H times each of them, one a row.
        C: final cost over that basis, and its Cholesky factor.
        system: everything of `System` that nothing else keeps.
        side: of all bounds and rows: 1 upper, -1 lower, 2 equality, 0 inactive.
        firm: whether an active row's multiplier may have either sign further down.
        locked: whether a row came back at once when it was let go.
        order: bound or row of each active row.
        needed: how many levels an active row was without use, counted from one; 0 for unknown.
        factored: sides and firmness of all bounds and rows when they were factored.
        chosen: scratch for a list of rows or columns.
        begin: where each level's active rows begin.
        first: how many coordinates the levels above each have taken.
        rank: how many each takes.
        pivot: order of the final cost's pivots.
        state: see `CHANGES`.
    """

    x: Float64[np.ndarray, " n"]
    target: Float64[np.ndarray, " n"]
    y: Float64[np.ndarray, " n"]
    hx: Float64[np.ndarray, " n"]
    force: Float64[np.ndarray, " n"]
    tau: Float64[np.ndarray, " n"]
    values: Float64[np.ndarray, " nm"]
    goal: Float64[np.ndarray, " nm"]
    norms: Float64[np.ndarray, " nm"]
    bound: Float64[np.ndarray, " nm"]
    size: Float64[np.ndarray, " nm"]
    slack: Float64[np.ndarray, " nm"]
    rest: Float64[np.ndarray, " nm"]
    left: Float64[np.ndarray, " nm"]
    kept: Float64[np.ndarray, " nm"]
    shift: Float64[np.ndarray, " nm"]
    slacks: Float64[np.ndarray, " nm"]
    residuals: Float64[np.ndarray, " p"]
    relative: Float64[np.ndarray, " p"]
    eased: Float64[np.ndarray, " p"]
    multipliers: Float64[np.ndarray, "p1 nm"]
    errors: Float64[np.ndarray, "2"]
    right: Float64[np.ndarray, " nmn"]
    vector: Float64[np.ndarray, " nmn"]
    V: Float64[np.ndarray, "n n"]
    R: Float64[np.ndarray, "nm n"]
    T: Float64[np.ndarray, "n nmn"]
    S: Float64[np.ndarray, "n nm"]
    Z: Float64[np.ndarray, "n n"]
    ZT: Float64[np.ndarray, "n n"]
    HZ: Float64[np.ndarray, "n n"]
    C: Float64[np.ndarray, "n n"]
    system: Float64[np.ndarray, " g"]
    side: Int64[np.ndarray, " nm"]
    firm: Int64[np.ndarray, " nm"]
    locked: Int64[np.ndarray, " nm"]
    order: Int64[np.ndarray, " nm"]
    needed: Int64[np.ndarray, " nm"]
    factored: Int64[np.ndarray, " nm"]
    chosen: Int64[np.ndarray, " nm"]
    begin: Int64[np.ndarray, " p1"]
    first: Int64[np.ndarray, " p1"]
    rank: Int64[np.ndarray, " p"]
    pivot: Int64[np.ndarray, " n"]
    state: Int64[np.ndarray, " s"]


ROWS, ROW_INTS, SQUARES = 11, 7, 5
"""How many vectors of `Work` are as long as there are bounds and rows, floats and integers, and how
many matrices have as many rows and columns as there are variables."""


def float_count(n: int, m: int, levels: int) -> int:
    """How many floats `cut` needs."""
    nm = n + m
    vectors = 6 * n + ROWS * nm + 3 * levels + (levels + 1) * nm + 2 + 2 * (nm + n)
    return vectors + SQUARES * n * n + 2 * n * nm + n * (nm + n) + system_count(n, m)


def int_count(n: int, m: int, levels: int) -> int:
    """How many integers `cut` needs."""
    return ROW_INTS * (n + m) + 2 * (levels + 1) + levels + n + STATES


@compiled
def cut(
    floats: Float64[np.ndarray, " f"], ints: Int64[np.ndarray, " i"], n: int, m: int, levels: int
) -> Work:
    """Cuts two buffers up into everything the search needs.

    Args:
        floats: `float_count` of them.
        ints: `int_count` of them.
        n: number of variables.
        m: number of rows.
        levels: number of levels.
    """
    nm, p1 = n + m, levels + 1
    a = 6 * n
    b = a + ROWS * nm
    c = b + 3 * levels
    d = c + p1 * nm
    e = d + 2 + 2 * (nm + n)
    f = e + SQUARES * n * n
    g = f + nm * n
    h = g + n * (nm + n)
    k = h + n * nm
    variables = floats[:a].reshape((6, n))
    rows = floats[a:b].reshape((ROWS, nm))
    measures = floats[b:c].reshape((3, levels))
    mixed = floats[d + 2 : e].reshape((2, nm + n))
    squares = floats[e:f].reshape((SQUARES, n, n))
    i = ROW_INTS * nm
    sides = ints[:i].reshape((ROW_INTS, nm))
    places = ints[i : i + 2 * p1].reshape((2, p1))
    j = i + 2 * p1
    return Work(
        variables[0],
        variables[1],
        variables[2],
        variables[3],
        variables[4],
        variables[5],
        rows[0],
        rows[1],
        rows[2],
        rows[3],
        rows[4],
        rows[5],
        rows[6],
        rows[7],
        rows[8],
        rows[9],
        rows[10],
        measures[0],
        measures[1],
        measures[2],
        floats[c:d].reshape((p1, nm)),
        floats[d : d + 2],
        mixed[0],
        mixed[1],
        squares[0],
        floats[f:g].reshape((nm, n)),
        floats[g:h].reshape((n, nm + n)),
        floats[h:k].reshape((n, nm)),
        squares[1],
        squares[2],
        squares[3],
        squares[4],
        floats[k:],
        sides[0],
        sides[1],
        sides[2],
        sides[3],
        sides[4],
        sides[5],
        sides[6],
        places[0],
        places[1],
        ints[j : j + levels],
        ints[j + levels : j + levels + n],
        ints[j + levels + n : j + levels + n + STATES],
    )
