"""A random hierarchy that drifts slowly, while a known number of inequalities changes each tick.

Around a point that moves, each of a pool of limits has a phase: in one half of its period it is at
its bound with a force that swells and fades, in the other half it is off it by a margin that does
the same. Nothing jumps, and in each tick as many limits come to their bounds or leave them as was
asked.
"""

from collections.abc import Generator
from dataclasses import dataclass
from functools import partial

import numpy as np

from benchmarks.hqp.random_problems import Knobs, RandomHierarchy, balance, random_hierarchy
from benchmarks.hqp.source import Progress, Source
from poise.errors import ConfigurationError
from poise.hqp import HierarchicalProblem

_SIZE = Knobs(
    variables=50,
    limits=54,
    equalities=(6, 9, 9),
    inequalities=(6, 6, 6),
    blocked=2,
    active=4,
)
"""Of a humanoid, with two task rows that four limits always keep from their targets."""

_SWINGING = 24
"""Limits that come and go; half of them are active at any time."""

_ANGLE = 0.02
"""How far a tick turns the sines by which coefficients and the optimum move [rad]."""

_SHARE = 0.1
"""How much of themselves they move by."""


_STEPS = 4096.0
"""Coefficients move in steps of this fraction, so that files of them stay small."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Drift:
    """How fast the active set changes.

    Attributes:
        changes: rows that become active or inactive a tick, on the average where it is not whole.
        seed: of everything random.
    """

    changes: float
    seed: int = 0

    def __post_init__(self) -> None:
        if not 0.0 < self.changes <= _SWINGING / 4:
            raise ConfigurationError(
                "changes a tick", got=self.changes, wanted=f"above 0, at most {_SWINGING / 4:g}"
            )


def drifting_problems(
    drift: Drift, count: int, progress: Progress | None = None
) -> Generator[HierarchicalProblem]:
    """Ticks of a drifting problem; the first ones are the same however many there are.

    Args:
        drift: how it drifts.
        count: how many ticks.
        progress: told how many are done.
    """
    for tick in range(count):
        rng = np.random.default_rng([drift.seed, _SWINGING])
        yield _move(random_hierarchy(rng, _SIZE), drift, tick)
        if progress is not None:
            progress(tick + 1, count)


def _move(made: RandomHierarchy, drift: Drift, tick: int) -> HierarchicalProblem:
    """Takes a hierarchy from tick 0 to another."""
    problem, n = made.problem, made.problem.n
    columns, angle = np.arange(n), _ANGLE * tick
    before = np.concatenate((made.x, problem.A @ made.x))
    # Columns grow and shrink as a whole: what is in balance stays in balance.
    problem.A *= 1.0 + np.round(_STEPS * _SHARE * np.sin(angle + columns)) / _STEPS
    made.x[:] *= 1.0 + _SHARE * np.sin(angle + 2.0 * columns)
    shift = np.concatenate((made.x, problem.A @ made.x)) - before
    equal = problem.equality
    problem.lower += shift
    # Rounding must not make two bounds of an equality.
    problem.upper[:] = np.where(equal, problem.lower, problem.upper + shift)
    _swing(made, drift, tick)
    balance(made)
    return problem


def _swing(made: RandomHierarchy, drift: Drift, tick: int) -> None:
    """Gives each limit of the pool the force or the distance from its bound of its phase."""
    limits = made.problem.level(0)
    half = _SWINGING / drift.changes
    last = len(limits.lower)
    for j, row in enumerate(range(last - _SWINGING, last)):
        # They cross zero at equal distances, and never at a tick itself.
        phase = np.sin(np.pi * (tick + (j + 0.5) / drift.changes) / half)
        value = float(limits.A[row] @ made.x)
        side = 1.0 if j % 4 < 2 else -1.0
        made.multipliers[made.problem.n + row] = side * max(phase, 0.0)
        bound = value + side * max(-phase, 0.0)
        limits.lower[row], limits.upper[row] = (
            (bound - 3.0, bound) if side > 0.0 else (bound, bound + 3.0)
        )


SOURCES = tuple(
    Source(
        name=f"random-drift-{name}",
        family="random",
        description=f"Random and drifting: {about}; two tasks in conflict with limits throughout.",
        consecutive=True,
        make=partial(drifting_problems, Drift(changes=changes)),
    )
    for name, changes, about in (
        ("slow", 0.1, "the active set changes by one row every 10 ticks"),
        ("one", 1.0, "the active set changes by one row a tick"),
        ("fast", 4.0, "the active set changes by 4 rows a tick"),
    )
)
"""Sequences of random hierarchies that drift."""
