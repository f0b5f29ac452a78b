"""Naming, in words, the rows that conflict: which, by how much, and with what."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from poise.hqp.optimality import certify_point
from poise.hqp.problem import HierarchicalProblem

_VISIBLE_VIOLATION = 1e-8
"""Violations below this, relative to the level's slack scale, are rounding and not worth words."""


@dataclass(frozen=True, slots=True)
class Conflict:
    """One row that could not be met.

    Attributes:
        label: the task or limit the row comes from.
        level: index of the row's level, 0 is the highest.
        row: stacked index of the row; the first n are the simple bounds.
        violation: signed distance outside the row's bounds, in the row's unit.
        conflicting_with: labels of the rows that stand in its way, strongest first.
    """

    label: str
    level: int
    row: int
    violation: float
    conflicting_with: tuple[str, ...]


def find_conflicts(
    problem: HierarchicalProblem,
    x: Float64[np.ndarray, " n"],
    slacks: Float64[np.ndarray, " nm"],
) -> list[Conflict]:
    """List the violated rows in order of priority, with what holds each of them up.

    What stands in the way of a level are the rows that carry a multiplier in that level's
    optimality conditions, its own other rows included.
    """
    certificate = certify_point(problem, x)
    conflicts: list[Conflict] = []
    for level, multipliers in enumerate(certificate.multipliers):
        mine = problem.level_of == level
        visible = _VISIBLE_VIOLATION * max(1.0, float(np.abs(slacks[mine]).max(initial=0.0)))
        for row in np.flatnonzero(mine & (np.abs(slacks) > visible)):
            label = problem.label(int(row))
            conflicts.append(
                Conflict(
                    label=label,
                    level=level,
                    row=int(row),
                    violation=float(slacks[row]),
                    conflicting_with=_opponents(problem, multipliers, int(row), label),
                )
            )
    return conflicts


def describe(status: str, problem: HierarchicalProblem, conflicts: list[Conflict]) -> str:
    """Return one line a conflicting label, for people."""
    if not conflicts:
        return f"{status}: every row of every level is met"
    lines = [f"{status}: {len(conflicts)} rows cannot be met"]
    groups: dict[tuple[int, str], list[Conflict]] = {}
    for conflict in conflicts:
        groups.setdefault((conflict.level, conflict.label), []).append(conflict)
    for (level, label), rows in groups.items():
        worst = max(rows, key=lambda conflict: abs(conflict.violation))
        opponents = list(dict.fromkeys(name for c in rows for name in c.conflicting_with))
        against = f", against {', '.join(opponents)}" if opponents else ", by itself"
        side = "above" if worst.violation > 0.0 else "below"
        lines.append(
            f"  level {level + 1} ({problem.level(level).name}): {label!r} misses {len(rows)} of "
            f"its rows, by up to {abs(worst.violation):.3g} {side} its bound{against}"
        )
    return "\n".join(lines)


def _opponents(
    problem: HierarchicalProblem,
    multipliers: Float64[np.ndarray, " nm"],
    row: int,
    label: str,
) -> tuple[str, ...]:
    """Return the labels of rows that pull against `row`, by the force they pull with."""
    norms = np.concatenate([np.ones(problem.n), np.linalg.norm(problem.A, axis=1)])
    pulls = np.abs(multipliers) * norms
    strength: dict[str, float] = {}
    for index in np.flatnonzero(multipliers):
        if index == row:
            continue
        name = problem.label(int(index))
        strength[name] = strength.get(name, 0.0) + float(pulls[index])
    largest = max(strength.values(), default=0.0)
    named = [
        name
        for name, pull in sorted(strength.items(), key=lambda item: -item[1])
        if pull > 1e-6 * largest and name != label
    ]
    return tuple(named)
