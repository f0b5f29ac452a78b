"""Strictness where rows are nearly dependent: residuals with and without the levels below.

Strict priority means that a level's residual does not rise because a lower level was added. Each
random problem is solved with its levels 1 to k, for every k, and with all of them.
"""

from typing import Any

import numpy as np
from jaxtyping import Float64

from poise.hqp import HierarchicalProblem, Level, LexicographicSolver, Solution

DEPARTURES = (-10.0, -7.0)
"""Decades of the part of a nearly dependent row that lies outside the rows it combines."""

TOLERANCE = 1e-7
"""Rise of a level's residual that counts, relative to the numbers that meet in its rows. Each of
the two answers may be off by 1e-8 of them in each row, and a level here has up to 16 rows with the
bounds: 2 * sqrt(16) * 1e-8."""


def near_dependent(count: int, seed: int) -> dict[str, int | float]:
    """Count rises in random problems with rows dependent to within 1e-10 to 1e-7."""
    return _count(count, seed, DEPARTURES)


def exactly_dependent(count: int, seed: int) -> dict[str, int | float]:
    """Count the same in problems of the same kind whose dependent rows are exact combinations."""
    return _count(count, seed, None)


def _count(count: int, seed: int, departures: tuple[float, float] | None) -> dict[str, int | float]:
    solver, found = LexicographicSolver(), dict.fromkeys(("optimal", "inaccurate", "risen"), 0)
    rises: list[float] = []
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        levels, others = _random_levels(rng, departures)
        answers: list[Solution] = []
        for first in range(1, len(levels) + 1):
            solver.reset()
            answers.append(solver.solve(_state(levels[:first], others)))
        numbers = _numbers(_state(levels, others))
        rise = max(
            [_rise(fewer, answers[-1], numbers) for fewer in answers[:-1] if fewer.ok] or [0.0]
        )
        found["optimal" if answers[-1].ok else "inaccurate"] += 1
        if answers[-1].ok:
            rises.append(rise)
        elif rise > 0.0:
            found["risen"] += 1
    silent = int(np.count_nonzero(rises))
    return {"problems": count, **found, "silent": silent, "worst": max(rises, default=0.0)}


def _rise(fewer: Solution, more: Solution, numbers: Float64[np.ndarray, " p"]) -> float:
    """By how much the first level that differs has risen, relatively; 0 where it fell."""
    for before, after, size in zip(fewer.residuals, more.residuals, numbers, strict=False):
        change = float((after - before) / max(size, before))
        if abs(change) > TOLERANCE:
            return max(change, 0.0)
    return 0.0


def _numbers(problem: HierarchicalProblem) -> Float64[np.ndarray, " p"]:
    """`|W (|b| + |a| r)|` of each level, with r how far x has to go for any one bound."""
    norms = np.concatenate([np.ones(problem.n), np.linalg.norm(problem.A, axis=1)])
    bounds = np.abs(np.stack([problem.lower, problem.upper]))
    bounded = np.isfinite(bounds).any(axis=0)
    bound = np.where(np.isfinite(bounds), bounds, 0.0).max(axis=0)
    reach = (bound / norms).max()
    terms = np.where(bounded, problem.weights * (bound + norms * reach), 0.0)
    return np.sqrt(np.bincount(problem.level_of, terms**2, minlength=len(problem.levels)))


def _state(levels: list[Level], others: dict[str, Any]) -> HierarchicalProblem:
    """Levels with the cost and, if the level of the bounds is among them, the bounds."""
    if others["bounds_level"] < len(levels):
        return HierarchicalProblem(levels, **others)
    return HierarchicalProblem(levels, others["H"], others["g"])


def _random_levels(
    rng: np.random.Generator, departures: tuple[float, float] | None
) -> tuple[list[Level], dict[str, Any]]:
    """Two to five levels in 2 to 12 variables; three in five rows are combinations of others."""
    n, count = int(rng.integers(2, 13)), int(rng.integers(2, 6))
    inside, shared = rng.standard_normal((2, n))
    tension = rng.choice([0.0, 0.1, 1.0])
    rows: list[Float64[np.ndarray, " n"]] = []
    levels: list[Level] = []
    for _ in range(count):
        size = int(rng.integers(1, 5))
        rows += [_random_row(rng, rows, shared, departures) for _ in range(size)]
        A = np.array(rows[-size:])
        scales = np.linalg.norm(A, axis=1)
        centre = A @ inside + tension * scales * rng.standard_normal(size)
        room = scales * rng.uniform(0.0, 1.0, (2, size))
        kind = rng.integers(0, 5, size)  # 0, 1: equality; 2: two-sided; 3: lower; 4: upper only
        room[:, kind <= 1] = 0.0
        lower = np.where(kind == 4, -np.inf, centre - room[0])
        upper = np.where(kind == 3, np.inf, centre + room[1])
        weights = 10.0 ** rng.uniform(-1.0, 1.0, size) if rng.random() < 0.5 else None
        levels.append(Level(A, lower, upper, weights))
    others: dict[str, Any] = {"H": None, "g": None, "bounds_level": int(rng.integers(count))}
    if rng.random() < 0.5:
        root = rng.standard_normal((n, n))
        others |= {"H": root @ root.T + 0.1 * np.eye(n), "g": rng.standard_normal(n)}
    if rng.random() < 0.4:
        middle = inside + tension * rng.standard_normal(n)
        others["x_lower"] = middle - rng.uniform(0.0, 1.0, n)
        others["x_upper"] = middle + rng.uniform(0.0, 1.0, n)
    return levels, others


def _random_row(
    rng: np.random.Generator,
    rows: list[Float64[np.ndarray, " n"]],
    shared: Float64[np.ndarray, " n"],
    departures: tuple[float, float] | None,
) -> Float64[np.ndarray, " n"]:
    """One of its own, or a combination of up to three others that departs along some direction."""
    n = len(shared)
    if not rows or rng.random() < 0.4:
        return rng.standard_normal(n) * 10.0 ** rng.uniform(-0.5, 0.5)
    picks = rng.integers(0, len(rows), int(rng.integers(1, 4)))
    row = rng.standard_normal(len(picks)) @ np.array(rows)[picks]
    if departures is None:
        return row
    direction = rng.choice([-1.0, 1.0]) * shared if rng.random() < 0.5 else rng.standard_normal(n)
    length = 10.0 ** rng.uniform(*departures) * np.linalg.norm(row)
    return row + length * direction / np.linalg.norm(direction)
