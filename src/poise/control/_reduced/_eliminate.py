"""The elimination of `ChainElimination`, compiled."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import compiled, make_reflection, reflect, reflect_columns, reflect_rows

RANK_TOLERANCE = 1e-8
"""Pivots smaller than this, relative to the first, are no motion that a task can use."""

WEAK = 1e-2
"""Pivots smaller than this stay unknowns: eliminated, their inverse squares would be in the energy,
and a nearly straight arm cost LQP 1 its accuracy."""

ROUNDING = 1e-12
"""Coefficients smaller than this, relative to the largest of their level, are rounding."""


class Eliminated(NamedTuple):
    """What the elimination leaves; `G` and the rows have room for every p as an unknown.

    Attributes:
        G: how p answers to (dv_a, z, s), in the coordinates that V turns it into.
        c: p at zero, in the same coordinates.
        V: vectors of the reflections that turn p, each from its own place on.
        tau: their factors.
        rows: what the levels leave for LQP 1, one below the other: coefficients of (dv_a, z, s).
        values: right-hand sides.
        left: how many rows each level leaves.
        scratch: scratch.
        before: scratch, as large as the coefficients of p.
    """

    G: Float64[np.ndarray, "np n"]
    c: Float64[np.ndarray, " np"]
    V: Float64[np.ndarray, "np np"]
    tau: Float64[np.ndarray, " np"]
    rows: Float64[np.ndarray, "m n"]
    values: Float64[np.ndarray, " m"]
    left: Int64[np.ndarray, " levels"]
    scratch: Float64[np.ndarray, " s"]
    before: Float64[np.ndarray, "m np"]


@compiled
def eliminate(
    E: Float64[np.ndarray, "m n"],
    P: Float64[np.ndarray, "m np"],
    e: Float64[np.ndarray, " m"],
    nr: int,
    ends: Int64[np.ndarray, " k"],
    out: Eliminated,
) -> tuple[int, int]:
    """Solves weighted rows E x + P p = e for p, level by level, as far as they determine it.

    Args:
        E: coefficients of x = (dv_a, z), with zeros for the unknowns s; overwritten.
        P: coefficients of p; overwritten.
        e: right-hand sides; overwritten.
        nr: number of coordinates (dv_a, z).
        ends: where each level ends; the first entry is zero.
        out: receives what is left.

    Returns:
        How many p are determined or unknowns s, and how many are unknowns s.
    """
    G, c, V, tau, rows, values, left, scratch, before = out
    G[:], c[:] = 0.0, 0.0
    done = kept = total = 0
    for level in range(len(left)):
        begin, end = ends[level], ends[level + 1]
        block = P[begin:end]
        free = P.shape[1] - done
        kept_rows = before[: end - begin]
        _copy(block, kept_rows)
        rank = strong = end - begin
        floor = ROUNDING * max(_largest(block), _largest(E[begin:end, :nr]))
        # Mostly the freedom left reaches every row, and no other order of rows is needed.
        if rank > free or _rotate(block, done, rank, floor, V, tau) < rank:
            _copy(kept_rows, block)
            rank = _find_reached(block, E[begin:end, :nr], e[begin:end], done, floor, scratch)
            strong = _rotate(block, done, rank, floor, V, tau)
        for place in range(done, done + rank):
            reflect_rows(P[end:, place:], V[place, : P.shape[1] - place], tau[place])
        width = nr + kept + rank - strong
        for k in range(end - begin):
            row, place = begin + k, done + k
            for j in range(done + min(k, rank)):
                factor = P[row, j]
                if factor != 0.0:
                    e[row] -= factor * c[j]
                    for i in range(width):
                        E[row, i] -= factor * G[j, i]
            if k < strong:
                c[place] = e[row] / P[row, place]
                for i in range(width):
                    G[place, i] = E[row, i] / P[row, place]
                continue
            if k < rank:
                unknown = nr + kept + k - strong
                G[place, unknown] = -1.0
                E[row, unknown] += P[row, place]
            _copy(E[row : row + 1], rows[total : total + 1])
            values[total] = e[row]
            total += 1
        left[level] = end - begin - strong
        kept += rank - strong
        done += rank
    return done, kept


@compiled
def restore(
    p: Float64[np.ndarray, " np"],
    V: Float64[np.ndarray, "np np"],
    tau: Float64[np.ndarray, " np"],
    done: int,
) -> None:
    """Turns p back into the coordinates that it had before the elimination, in place.

    Args:
        p: overwritten.
        V: of `Eliminated`.
        tau: of `Eliminated`.
        done: how many of p are determined.
    """
    for k in range(done - 1, -1, -1):
        reflect(p[k:], V[k, : len(p) - k], tau[k])


@compiled
def _rotate(
    P: Float64[np.ndarray, "m np"],
    done: int,
    rank: int,
    floor: float,
    V: Float64[np.ndarray, "np np"],
    tau: Float64[np.ndarray, " np"],
) -> int:
    """Turns p so that the first rows of a level become lower triangular, in place.

    Args:
        P: coefficients of p, of which the first `done` are spoken for.
        done: how many of p the levels above have taken.
        rank: how many rows.
        floor: pivots up to this are rounding.
        V: receives the reflections' vectors.
        tau: receives their factors.

    Returns:
        How many of the first pivots are strong.
    """
    largest = 0.0
    for k in range(rank):
        place = done + k
        v = V[place, : P.shape[1] - place]
        tau[place] = make_reflection(P[k, place:], v)
        reflect_rows(P[k + 1 : rank, place:], v, tau[place])
        largest = max(largest, P[k, place])
    strong = 0
    # A leading block, because the rest is triangular. Written so that NaN ends it.
    while strong < rank and P[strong, done + strong] > max(WEAK * largest, floor):
        strong += 1
    return strong


@compiled
def _find_reached(
    P: Float64[np.ndarray, "m np"],
    E: Float64[np.ndarray, "m nr"],
    e: Float64[np.ndarray, " m"],
    done: int,
    floor: float,
    scratch: Float64[np.ndarray, " s"],
) -> int:
    """Turns a level's rows so that the first ones are all that the freedom left can reach.

    Args:
        P: coefficients of p, of which the first `done` are spoken for.
        E: coefficients of the rest of the robot, turned with them.
        e: right-hand sides, turned with them, too.
        done: how many of p the levels above have taken.
        floor: coefficients up to this are rounding.
        scratch: scratch.

    Returns:
        How many rows are reached; the others have no coefficient left.
    """
    m, inside = P.shape
    vector, column, scratch = scratch[:m], scratch[m : 2 * m], scratch[2 * m :]
    first, rank = 0.0, 0
    while rank < min(m, inside - done):
        best, size = done, -1.0
        for j in range(done, inside):
            square = 0.0
            for i in range(rank, m):
                square += P[i, j] * P[i, j]
            if square > size:
                best, size = j, square
        size = np.sqrt(size)
        first = max(first, size)
        # Written so that NaN ends it.
        if not size > max(RANK_TOLERANCE * first, floor):
            break
        for i in range(rank, m):
            column[i] = P[i, best]
        v = vector[rank:m]
        tau = make_reflection(column[rank:m], v)
        reflect_columns(P[rank:], v, tau, scratch)
        P[rank + 1 :, best] = 0.0
        reflect_columns(E[rank:], v, tau, scratch)
        reflect(e[rank:], v, tau)
        rank += 1
    P[rank:, done:] = 0.0
    return rank


@compiled
def _largest(X: Float64[np.ndarray, "m n"]) -> float:
    """Largest absolute entry."""
    largest = 0.0
    for row in range(len(X)):
        for column in range(X.shape[1]):
            largest = max(largest, abs(X[row, column]))
    return largest


@compiled
def _copy(X: Float64[np.ndarray, "m n"], out: Float64[np.ndarray, "m n"]) -> None:
    # An assignment of arrays takes seconds to compile, for the sake of its error message.
    for row in range(len(X)):
        for column in range(X.shape[1]):
            out[row, column] = X[row, column]
