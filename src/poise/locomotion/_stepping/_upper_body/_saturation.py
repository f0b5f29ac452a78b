"""`go`: serves rows as far as bounds allow, and keeps what comes first (parts of compiled code).

`Work` is what it works on, `copy_rows` and `ask` prepare it.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from poise._compiled import factor_leading, part, solve_leading

_KEPT = 1e-6
"""Damping of what comes first [m^2]: rows that are nearly the same can both be kept."""

_STILL = 1e-12
"""A velocity that is none [rad/s, m/s]."""


class Work(NamedTuple):
    """What the compiled functions work on, for k joints."""

    kept: Float64[np.ndarray, "kept k"]
    rows: Float64[np.ndarray, "r k"]
    within: Float64[np.ndarray, "r k"]
    squares: Float64[np.ndarray, "size size"]
    column: Float64[np.ndarray, " size"]
    missing: Float64[np.ndarray, " r"]
    change: Float64[np.ndarray, " k"]
    free: Float64[np.ndarray, " k"]
    low: Float64[np.ndarray, " k"]
    high: Float64[np.ndarray, " k"]


def make_work(k: int, first: int, rows: int) -> Work:
    """For so many joints, rows that come first, and rows that are served."""
    # Each time round one joint or one pair comes to its end.
    kept, r = first + k, max(rows, k)
    size = max(kept, r)
    return Work(
        kept=np.empty((kept, k)),
        rows=np.empty((r, k)),
        within=np.empty((r, k)),
        squares=np.empty((size, size)),
        column=np.empty(size),
        missing=np.empty(r),
        change=np.empty(k),
        free=np.empty(k),
        low=np.empty(k),
        high=np.empty(k),
    )


@part
def copy_rows(
    source: Float64[np.ndarray, "s k"],
    begin: int,
    end: int,
    target: Float64[np.ndarray, "t k"],
    first: int,
) -> None:
    """Copies some rows to where others begin.

    Args:
        source: the rows.
        begin: the first that is copied.
        end: where those end.
        target: receives them.
        first: from this row on.
    """
    for row in range(begin, end):
        for i in range(source.shape[1]):
            target[first + row - begin, i] = source[row, i]


@part
def ask(
    reference: Float64[np.ndarray, " n"],
    begin: int,
    count: int,
    found: Float64[np.ndarray, " k"],
    work: Work,
) -> None:
    """What is missing of a reference: w - B x.

    Args:
        reference: w.
        begin: where it begins.
        count: how many rows B has.
        found: x [rad/s].
        work: B, and receives what is missing.
    """
    for row in range(count):
        rest = reference[begin + row]
        for i in range(len(found)):
            rest -= work.rows[row, i] * found[i]
        work.missing[row] = rest


@part
def go(
    first: int,
    count: int,
    low: Float64[np.ndarray, " k"],
    high: Float64[np.ndarray, " k"],
    near: Float64[np.ndarray, "p k"],
    least: Float64[np.ndarray, " p"],
    held: Float64[np.ndarray, " p"],
    damping: float,
    found: Float64[np.ndarray, " k"],
    work: Work,
) -> None:
    """Serves what is missing as far as it goes, and keeps what has come to its end by then.

    Args:
        first: how many rows of `work.kept` come first.
        count: how many of `work.rows` are served.
        low: least velocities [rad/s].
        high: largest ones [rad/s].
        near: rows of pairs.
        least: of their products with velocities [m/s].
        held: which pairs have come to their end; overwritten.
        damping: of what is served.
        found: velocities, moved on [rad/s].
        work: rows and what is missing of them, overwritten.
    """
    k, kept = len(found), first
    for i in range(k):
        work.free[i] = 1.0
    for pair in range(len(least)):
        held[pair] = 0.0
    for _ in range(k):
        if not _find_change(kept, count, damping, k, work):
            return
        share, joint, pair = 1.0, -1, -1
        for i in range(k):
            change = work.change[i]
            room = max(high[i] - found[i] if change > 0.0 else found[i] - low[i], 0.0)
            if abs(change) > _STILL and room < share * abs(change):
                share, joint = room / abs(change), i
        for p in range(len(least)):
            lost, room = 0.0, -least[p]
            for i in range(k):
                lost -= near[p, i] * work.change[i]
                room += near[p, i] * found[i]
            if held[p] == 0.0 and lost > _STILL and max(room, 0.0) < share * lost:
                share, pair = max(room, 0.0) / lost, p
        for i in range(k):
            found[i] += share * work.change[i]
        if joint < 0 and pair < 0:
            return
        for row in range(count):
            for i in range(k):
                work.missing[row] -= share * work.rows[row, i] * work.change[i]
        if pair >= 0:
            held[pair] = 1.0
            for i in range(k):
                work.kept[kept, i] = near[pair, i] * work.free[i]
            kept += 1
            continue
        work.free[joint] = 0.0
        for row in range(kept):
            work.kept[row, joint] = 0.0
        for row in range(count):
            work.rows[row, joint] = 0.0


@part
def _find_change(kept: int, count: int, damping: float, k: int, work: Work) -> bool:
    """The change d of `serve`; whether there is one, which with NaN there is not."""
    A, B, N, G, y = work.kept, work.rows, work.within, work.squares, work.column
    for i in range(kept):
        for j in range(i + 1):
            G[i, j] = _dot(A[i], A[j]) + (_KEPT if i == j else 0.0)
    if not factor_leading(G, kept):
        return False
    for row in range(count):
        for i in range(kept):
            y[i] = _dot(A[i], B[row])
        solve_leading(G, kept, y)
        for j in range(k):
            rest = B[row, j]
            for i in range(kept):
                rest -= y[i] * A[i, j]
            N[row, j] = rest
    for i in range(count):
        for j in range(i + 1):
            G[i, j] = _dot(N[i], N[j]) + (damping * damping if i == j else 0.0)
    if not factor_leading(G, count):
        return False
    for row in range(count):
        y[row] = work.missing[row]
    solve_leading(G, count, y)
    for j in range(k):
        change = 0.0
        for row in range(count):
            change += N[row, j] * y[row]
        work.change[j] = change
    return True


@part
def _dot(a: Float64[np.ndarray, " k"], b: Float64[np.ndarray, " k"]) -> float:
    total = 0.0
    for i in range(len(a)):
        total += a[i] * b[i]
    return total
