"""Families of random hierarchies: in each, one thing goes from harmless to hard; some drift.

A hierarchy that drifts does so slowly, while a known number of inequalities changes each tick.
Around a point that moves, each of a pool of limits has a phase: in one half of its period it is at
its bound with a force that swells and fades, in the other half it is off it by a margin that does
the same. Nothing jumps, and in each tick as many limits come to their bounds or leave them as was
asked.
"""

from collections.abc import Callable, Generator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from benchmarks.hqp.problem_set import Progress, Source
from benchmarks.hqp.random_problems import Knobs, RandomHierarchy, balance, random_hierarchy
from poise.errors import ConfigurationError
from poise.hqp import HierarchicalProblem

Turn = Callable[[Knobs, int], Knobs]
"""Sets the knobs of problem number so and so of a family."""

RANK_SHARES = (0.9, 0.5, 0.7, 1.0)
CONDITIONS = (1e2, 1e6, 1e4, 1e1, 1e3, 1e5)
BLOCKED = (1, 6, 2, 4)
ACTIVE_SHARES = (0.1, 0.6, 0.2, 0.0, 0.4)
CONTRADICTIONS = (1e-3, 1e-1, 1e1)
"""What the problems of a family go through, again and again; short sequences have the range."""


def base_knobs(rng: np.random.Generator) -> Knobs:
    """A humanoid's size: 20 to 80 variables, 50 to 200 rows, 2 to 6 levels; nothing is hard.

    Equalities take a quarter to 0.35 of the variables' freedom, so that there is room for blocked
    rows and active bounds in every family.
    """
    n, levels = int(rng.integers(20, 81)), int(rng.integers(1, 6))
    equalities = _split(rng, int(n * rng.uniform(0.25, 0.35)), levels)
    rows = int(rng.integers(max(50, n + 12), min(200, 3 * n + 30) + 1))
    rest = rows - sum(equalities)
    inequalities = _split(rng, rest // 2, levels)
    return Knobs(
        variables=n,
        limits=rest - sum(inequalities),
        equalities=equalities,
        inequalities=inequalities,
        active=n // 10,
    )


def turn_rank(knobs: Knobs, number: int) -> Knobs:
    """Rank of each level's equalities, as a share of their number."""
    return replace(knobs, rank=RANK_SHARES[number % len(RANK_SHARES)])


def turn_condition(knobs: Knobs, number: int) -> Knobs:
    """Condition number of each level's equalities."""
    return replace(knobs, condition=CONDITIONS[number % len(CONDITIONS)])


def turn_conflict(knobs: Knobs, number: int) -> Knobs:
    """Equalities that limits keep from being met."""
    blocked = min(BLOCKED[number % len(BLOCKED)], sum(knobs.equalities))
    return replace(knobs, blocked=blocked, active=max(knobs.active, 2 * blocked))


def turn_contradiction(knobs: Knobs, number: int) -> Knobs:
    """Slack of each level's equalities, that contradict each other and differ in weight."""
    size = CONTRADICTIONS[number % len(CONTRADICTIONS)]
    return replace(knobs, rank=0.6, contradiction=size, weight_range=10.0)


def turn_active(knobs: Knobs, number: int) -> Knobs:
    """Active inequalities, as a share of the variables."""
    share = ACTIVE_SHARES[number % len(ACTIVE_SHARES)]
    return replace(knobs, active=int(share * knobs.variables))


def family_knobs(turn: Turn, seed: int, number: int) -> Knobs:
    """Knobs of one problem of a family."""
    return turn(base_knobs(_rng(seed, number)), number)


def random_problems(
    turn: Turn, seed: int, count: int, progress: Progress | None = None
) -> Generator[HierarchicalProblem]:
    """Problems of a family; the first ones are the same however many there are."""
    for number in range(count):
        rng = _rng(seed, number)
        yield random_hierarchy(rng, turn(base_knobs(rng), number)).problem
        if progress is not None:
            progress(number + 1, count)


def _rng(seed: int, number: int) -> np.random.Generator:
    return np.random.default_rng([seed, number])


def _split(rng: np.random.Generator, total: int, parts: int) -> tuple[int, ...]:
    """Random sizes, none of them zero where that is possible."""
    sizes = np.ones(parts, dtype=np.int64)
    sizes += rng.multinomial(total - parts, np.full(parts, 1.0 / parts))
    return tuple(sizes.tolist())


def _source(name: str, seed: int, turn: Turn, about: str) -> Source:
    return Source(
        name=f"random-{name}",
        family="random",
        description=f"Random: {about}.",
        consecutive=False,
        make=partial(random_problems, turn, seed),
    )


_FAMILIES = (
    _source("rank", 1, turn_rank, "each level's equalities have rank 1 to 0.5 of their number"),
    _source("condition", 2, turn_condition, "each level's condition number is 1e1 to 1e6"),
    _source("conflict", 3, turn_conflict, "limits keep 1 to 6 task rows from being met"),
    _source("contradiction", 4, turn_contradiction, "weighted equalities contradict each other"),
    _source("active", 5, turn_active, "0 to 0.6 n inequalities hold the optimum"),
)


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
    """Speed at which the active set changes."""

    # Rows that become active or inactive a tick, on the average where it is not whole
    changes: float
    seed: int = 0  # of everything random

    def __post_init__(self) -> None:
        if not 0.0 < self.changes <= _SWINGING / 4:
            raise ConfigurationError(
                "changes a tick", got=self.changes, wanted=f"above 0, at most {_SWINGING / 4:g}"
            )


def drifting_problems(
    drift: Drift, count: int, progress: Progress | None = None
) -> Generator[HierarchicalProblem]:
    """Ticks of a drifting problem; the first ones are the same however many there are."""
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


_DRIFTS = tuple(
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

SOURCES = (*_FAMILIES, *_DRIFTS)
"""Sequences of independent random hierarchies, and of those that drift."""
