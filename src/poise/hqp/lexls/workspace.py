"""`Problem` and `Work`: what the compiled search reads, and where it keeps everything it makes.

Handing an array to compiled code costs as much as a reflection, so that all of them lie in two
buffers, and compiled code cuts them up.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from poise.linalg import compiled

CHANGES, PHASE, ENOUGH, GUESSED, LEAPS, FEWEST, SINCE = range(7)
IDLE, RELEASED, BLOCKED, BEGUN, DOUBT, FREE = range(7, 13)
"""Places of the numbers in `Work.state`; the last is how many coordinates no level has taken."""

STATES = 13

BEGINNING, LEAPING, STEPPING = range(3)
"""Phases of the search."""

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
        residuals: of each level.
        relative: likewise, divided by its scale.
        eased: square of the damping that each level needed.
        shift: by how much damping moved the bounds of equalities.
        slacks: of all bounds and rows at x.
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
        G: factor of what `guess` solves.
        side: of all bounds and rows: 1 upper, -1 lower, 2 equality, 0 inactive.
        firm: whether an active row's multiplier may have either sign further down.
        locked: whether a row came back at once when it was let go.
        order: bound or row of each active row.
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
    residuals: Float64[np.ndarray, " p"]
    relative: Float64[np.ndarray, " p"]
    eased: Float64[np.ndarray, " p"]
    shift: Float64[np.ndarray, " nm"]
    slacks: Float64[np.ndarray, " nm"]
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
    G: Float64[np.ndarray, "g g"]
    side: Int64[np.ndarray, " nm"]
    firm: Int64[np.ndarray, " nm"]
    locked: Int64[np.ndarray, " nm"]
    order: Int64[np.ndarray, " nm"]
    factored: Int64[np.ndarray, " nm"]
    chosen: Int64[np.ndarray, " nm"]
    begin: Int64[np.ndarray, " p1"]
    first: Int64[np.ndarray, " p1"]
    rank: Int64[np.ndarray, " p"]
    pivot: Int64[np.ndarray, " n"]
    state: Int64[np.ndarray, " s"]


def float_count(n: int, m: int, levels: int) -> int:
    """How many floats `cut` needs."""
    nm = n + m
    vectors = 6 * n + 11 * nm + 3 * levels + (levels + 1) * nm + 2 + 2 * (nm + n)
    return vectors + 5 * n * n + 2 * n * nm + n * (nm + n) + min(3 * n, nm) ** 2


def int_count(n: int, m: int, levels: int) -> int:
    """How many integers `cut` needs."""
    return 6 * (n + m) + 2 * (levels + 1) + levels + n + STATES


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
    nmn, nn = nm + n, n * n
    a = 6 * n
    b = a + 9 * nm
    c = b + 3 * levels + nm
    d = c + nm
    o = d + p1 * nm
    r = o + 2
    e = r + 2 * nmn
    f = e + nn
    g = f + nm * n
    k = g + n * nmn
    h = k + n * nm
    u = h + 4 * nn
    q = min(3 * n, nm)
    i = 6 * nm
    j = i + 2 * p1
    return Work(
        floats[:n],
        floats[n : 2 * n],
        floats[2 * n : 3 * n],
        floats[3 * n : 4 * n],
        floats[4 * n : 5 * n],
        floats[5 * n : a],
        floats[a : a + nm],
        floats[a + nm : a + 2 * nm],
        floats[a + 2 * nm : a + 3 * nm],
        floats[a + 3 * nm : a + 4 * nm],
        floats[a + 4 * nm : a + 5 * nm],
        floats[a + 5 * nm : a + 6 * nm],
        floats[a + 6 * nm : a + 7 * nm],
        floats[a + 7 * nm : a + 8 * nm],
        floats[a + 8 * nm : b],
        floats[b : b + levels],
        floats[b + levels : b + 2 * levels],
        floats[b + 2 * levels : b + 3 * levels],
        floats[b + 3 * levels : c],
        floats[c:d],
        floats[d:o].reshape((p1, nm)),
        floats[o:r],
        floats[r : r + nmn],
        floats[r + nmn : e],
        floats[e:f].reshape((n, n)),
        floats[f:g].reshape((nm, n)),
        floats[g:k].reshape((n, nmn)),
        floats[k:h].reshape((n, nm)),
        floats[h : h + nn].reshape((n, n)),
        floats[h + nn : h + 2 * nn].reshape((n, n)),
        floats[h + 2 * nn : h + 3 * nn].reshape((n, n)),
        floats[h + 3 * nn : u].reshape((n, n)),
        floats[u : u + q * q].reshape((q, q)),
        ints[:nm],
        ints[nm : 2 * nm],
        ints[2 * nm : 3 * nm],
        ints[3 * nm : 4 * nm],
        ints[4 * nm : 5 * nm],
        ints[5 * nm : i],
        ints[i : i + p1],
        ints[i + p1 : j],
        ints[j : j + levels],
        ints[j + levels : j + levels + n],
        ints[j + levels + n : j + levels + n + STATES],
    )
