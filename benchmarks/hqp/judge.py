"""Whether a point is right: its levels, measured from x alone, beside the best that is known."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from poise.hqp import HierarchicalProblem

LEVEL_TOLERANCE = 1e-6
"""A level may be this much worse than the best known, in units of its scale."""

TIE_TOLERANCE = 1e-12
"""Points tie on a level where their weighted slacks lie this near to each other, in units of its
scale: as near as exact methods come.

It is the slacks that must agree, not their norms: around its least value a norm is flat, so a point
that gives away 1e-6 of a level shows 1e-12 in the norm. And they must agree much better than
`LEVEL_TOLERANCE`: where levels are nearly dependent, what is given away above buys 1e4 times as
much below, and would pass for a better answer there."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """Value of a point."""

    # Weighted slack `W w` of each level's rows, divided by the level's scale, which is `max(1, |W
    # w|)` at `x = 0`
    slacks: tuple[Float64[np.ndarray, " _"], ...]
    residuals: Float64[np.ndarray, " p"]  # their Euclidean norms, one a level
    cost: float  # the final cost `x^T H x / 2 + g^T x`
    cost_terms: float  # the size of what is added up in it, `x^T H x / 2 + |g^T x|`


@dataclass(frozen=True, slots=True, kw_only=True)
class Best:
    """The best known: least residuals, level by level, and the least cost below them."""

    residuals: Float64[np.ndarray, " p"]  # relative, one a level
    cost: float  # final cost
    # What differences of costs are relative to: the terms of the best, at least 1
    cost_scale: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """A point beside the best known."""

    right: bool  # no level is worse than the best known by more than `LEVEL_TOLERANCE`
    # By how much the worst level is worse, of those down to the first that differs by more than the
    # tolerance; what comes below that one is another problem. Zero if none is worse.
    gap: float
    cost_gap: float | None  # by how much the cost is worse, relative; None where a level differs


def measure_point(problem: HierarchicalProblem, x: Float64[np.ndarray, " n"]) -> Measured:
    """Measures a point on the problem's own rows."""
    reached = np.concatenate([x, problem.A @ x])
    outside, at_zero = (
        problem.weights
        * (np.maximum(at - problem.upper, 0.0) - np.maximum(problem.lower - at, 0.0))
        for at in (reached, np.zeros(len(reached)))
    )
    slacks: list[Float64[np.ndarray, " _"]] = []
    for level in range(len(problem.levels)):
        own = problem.level_of == level
        slacks.append(outside[own] / max(1.0, float(np.linalg.norm(at_zero[own]))))
    curved, linear = 0.5 * float(x @ problem.H @ x), float(problem.g @ x)
    return Measured(
        slacks=tuple(slacks),
        residuals=np.array([np.linalg.norm(one) for one in slacks]),
        cost=curved + linear,
        cost_terms=curved + abs(linear),
    )


def best_known(points: Sequence[Measured]) -> Best:
    """The lexicographically best of what several methods found.

    On each level, of the points that tie on all levels above, those with the least residual come
    into question, up to `TIE_TOLERANCE`; where they are several, the one leads with which most
    points tie. What ties with the leader goes on to the next level.
    """
    tied = list(points)
    residuals: list[float] = []
    for level in range(len(points[0].residuals)):
        least = min(float(point.residuals[level]) for point in tied)
        leading = [p for p in tied if float(p.residuals[level]) <= least + TIE_TOLERANCE]
        groups = [[p for p in tied if _apart(p, one, level) <= TIE_TOLERANCE] for one in leading]
        tied = max(groups, key=len)
        residuals.append(min(float(point.residuals[level]) for point in tied))
    leader = min(tied, key=lambda point: point.cost)
    return Best(
        residuals=np.array(residuals),
        cost=leader.cost,
        cost_scale=max(1.0, leader.cost_terms),
    )


def judge_point(point: Measured, best: Best) -> Verdict:
    """Compares a point with the best known, from the highest level down."""
    gap = 0.0
    for worse in (point.residuals - best.residuals).tolist():
        gap = max(gap, worse)
        if abs(worse) > LEVEL_TOLERANCE:
            # Better than the best known means that it gave something away above, within tolerance.
            return Verdict(right=worse < 0.0, gap=gap, cost_gap=None)
    cost_gap = max(0.0, (point.cost - best.cost) / best.cost_scale)
    return Verdict(right=True, gap=gap, cost_gap=cost_gap)


def _apart(one: Measured, other: Measured, level: int) -> float:
    return float(np.linalg.norm(one.slacks[level] - other.slacks[level]))
