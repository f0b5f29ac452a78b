"""`System`: what a guess solves, apart from what the rest of the search keeps.

Compiled functions count the owners of every array that they are handed, which takes longer than a
step of a small guess. So its functions are handed no more than this.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import part

_VECTORS = 8


class System(NamedTuple):
    """The rows of a guess; "active row" counts them in the order in which they entered.

    Attributes:
        lower: bounds of the variables, then of the rows.
        upper: likewise.
        push: lambda of each active row.
        aim: where the next step takes it.
        price: D of all bounds and rows: by how much each gives way to a push.
        gap: by how much each bound is moved.
        settled: the same, where a level above could not be met.
        free: values of all bounds and rows at x_0, the optimum of the final cost alone.
        length: of all bounds' and rows' M.
        rest: the right side of each active row, divided by the factor.
        goal: values of all bounds and rows at x.
        y: C^T (x - x_0).
        M: C^-1 a of all bounds and rows.
        C: Cholesky factor of the final cost.
        G: Cholesky factor of M M^T + D of the active rows.
        side: of all bounds and rows: 1 upper, -1 lower, 2 equality, 0 inactive.
        firm: whether an active row's multiplier may have either sign.
        needed: by which level, counted from one, a row was needed, with the sign of its side; 0
            where it was inactive.
        order: bound or row of each active row.
    """

    lower: Float64[np.ndarray, " nm"]
    upper: Float64[np.ndarray, " nm"]
    push: Float64[np.ndarray, " nm"]
    aim: Float64[np.ndarray, " nm"]
    price: Float64[np.ndarray, " nm"]
    gap: Float64[np.ndarray, " nm"]
    settled: Float64[np.ndarray, " nm"]
    free: Float64[np.ndarray, " nm"]
    length: Float64[np.ndarray, " nm"]
    rest: Float64[np.ndarray, " nm"]
    goal: Float64[np.ndarray, " nm"]
    y: Float64[np.ndarray, " n"]
    M: Float64[np.ndarray, "nm n"]
    C: Float64[np.ndarray, "n n"]
    G: Float64[np.ndarray, "g g"]
    side: Int64[np.ndarray, " nm"]
    firm: Int64[np.ndarray, " nm"]
    needed: Int64[np.ndarray, " nm"]
    order: Int64[np.ndarray, " nm"]


def system_count(n: int, m: int) -> int:
    """How many floats a system needs for itself."""
    room = min(3 * n, n + m)
    return _VECTORS * (n + m) + room * room


@part
def cut_system(
    floats: Float64[np.ndarray, " f"],
    lower: Float64[np.ndarray, " nm"],
    upper: Float64[np.ndarray, " nm"],
    goal: Float64[np.ndarray, " nm"],
    y: Float64[np.ndarray, " n"],
    M: Float64[np.ndarray, "nm n"],
    C: Float64[np.ndarray, "n n"],
    side: Int64[np.ndarray, " nm"],
    firm: Int64[np.ndarray, " nm"],
    needed: Int64[np.ndarray, " nm"],
    order: Int64[np.ndarray, " nm"],
) -> System:
    """Cuts a buffer up into what a system needs for itself; the rest is lent.

    Args:
        floats: `system_count` of them.
        lower: see `System`.
        upper: likewise.
        goal: likewise.
        y: likewise.
        M: likewise.
        C: likewise.
        side: likewise.
        firm: likewise.
        needed: likewise.
        order: likewise.
    """
    nm, room = len(lower), min(3 * len(y), len(lower))
    rows = floats[: _VECTORS * nm].reshape((_VECTORS, nm))
    return System(
        lower,
        upper,
        rows[0],
        rows[1],
        rows[2],
        rows[3],
        rows[4],
        rows[5],
        rows[6],
        rows[7],
        goal,
        y,
        M,
        C,
        floats[_VECTORS * nm :].reshape((room, room)),
        side,
        firm,
        needed,
        order,
    )
