"""Random hierarchies whose rank, conditioning, conflicts and active set are what was asked for.

Each is made around a point `x` and around multipliers, so that the optimality conditions of every
level hold at `x` by construction: level by level

    sum of weight^2 slack a over its rows  =  what active rows above it push with

and for the final cost `H x + g + sum of multiplier a = 0`. So the optimum is known, and so are the
rows that miss, by how much, and the inequalities that are active, with force on each.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from poise.errors import ConfigurationError
from poise.hqp import HierarchicalProblem, Level

_MARGIN = (0.1, 2.0)
"""How far an inequality that is not active is from its bounds."""

_FORCE = (0.1, 1.0)
"""Multipliers of active rows, and what rows that miss miss by."""

_STEPS = 32.0
"""Random coefficients are whole multiples of a 32nd of their standard deviation."""

_PAIR = 2
"""Limits that together keep a task row from its target."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Knobs:
    """What a random hierarchy is like; checked when made.

    Level 0 holds limits, inequalities all of them; simple bounds on all variables count to it.
    Every level below has equalities and inequalities.
    """

    variables: int  # n
    limits: int  # rows of level 0
    equalities: tuple[int, ...]  # of each level below
    inequalities: tuple[int, ...]  # of each level below
    rank: float = 1.0  # of the equalities of each level, as a share of their number
    # Largest over smallest singular value, those that are zero apart, of the equalities of each
    # level
    condition: float = 10.0
    blocked: int = 0  # equalities that cannot be met because two limits stand in their way
    # Slack of each level's equalities that contradict each other; they must depend on each other
    contradiction: float = 0.0
    # Inequality rows and bounds that hold the optimum, those of blocked rows among them
    active: int = 0
    weight_range: float = 1.0  # largest over smallest weight

    def __post_init__(self) -> None:
        possible = self.limits - _PAIR * self.blocked + sum(self.inequalities) + self.variables
        for what, got, good, wanted in (
            ("rank", self.rank, 0.0 < self.rank <= 1.0, "a share in (0, 1]"),
            ("condition", self.condition, self.condition >= 1.0, "1 or more"),
            ("weight_range", self.weight_range, self.weight_range >= 1.0, "1 or more"),
            ("levels", self.levels, len(self.inequalities) == self.levels > 0, "lists as long"),
            ("blocked", self.blocked, self.blocked <= sum(self.equalities), "equalities"),
            ("limits", self.limits, self.limits >= _PAIR * self.blocked, "two a blocked row"),
            (
                "contradiction",
                self.contradiction,
                self.contradiction == 0.0 or self.rank < 1.0,
                "rank below 1",
            ),
            (
                "active",
                self.active,
                _PAIR * self.blocked <= self.active <= possible,
                f"{_PAIR * self.blocked} to {possible}",
            ),
            (
                "active rows and rank together",
                self.active + sum(self.ranks),
                self.active + sum(self.ranks) <= self.variables,
                f"at most the {self.variables} variables",
            ),
        ):
            if not good:
                raise ConfigurationError(f"{what} of a random hierarchy", got=got, wanted=wanted)

    @property
    def levels(self) -> int:
        """Levels below the limits."""
        return len(self.equalities)

    @property
    def ranks(self) -> tuple[int, ...]:
        """Rank of the equalities of each level below the limits."""
        return tuple(max(1, round(self.rank * m)) if m else 0 for m in self.equalities)


@dataclass(frozen=True, slots=True, kw_only=True)
class RandomHierarchy:
    """A hierarchy with its solution."""

    problem: HierarchicalProblem  # the hierarchy
    x: Float64[np.ndarray, " n"]  # its optimum
    # Of the final cost over bounds and rows: `H x + g + [I; A]^T multipliers = 0`
    multipliers: Float64[np.ndarray, " nm"]


def random_hierarchy(rng: np.random.Generator, knobs: Knobs) -> RandomHierarchy:
    """Makes a hierarchy."""
    n = knobs.variables
    x = rng.standard_normal(n)
    limits = _short(rng, knobs.limits, n)
    equalities, targets, weights = _tasks(rng, knobs, x, limits)
    loose = [limits, *(_short(rng, m, n) for m in knobs.inequalities)]
    pool = np.vstack([np.eye(n), *loose])
    side = _choose_active(rng, knobs, len(pool))
    force = side * rng.uniform(*_FORCE, len(pool))
    lower, upper = _around(rng, pool @ x, side)
    levels = [Level(limits, lower[n : n + len(limits)], upper[n : n + len(limits)], name="limits")]
    multipliers = [force[: n + len(limits)]]
    first = n + len(limits)
    for k, (E, b, weight) in enumerate(zip(equalities, targets, weights, strict=True)):
        A = loose[k + 1]
        part = slice(first, first + len(A))
        first = part.stop
        levels.append(
            Level(
                np.vstack([E, A]),
                np.concatenate((b, lower[part])),
                np.concatenate((b, upper[part])),
                np.concatenate((weight, np.ones(len(A)))),
                name=f"tasks {k + 1}",
            )
        )
        multipliers += [rng.uniform(-1.0, 1.0, len(E)), force[part]]
    problem = HierarchicalProblem(levels, _cost(rng, n), None, lower[:n], upper[:n])
    made = RandomHierarchy(problem=problem, x=x, multipliers=np.concatenate(multipliers))
    balance(made)
    return made


def balance(made: RandomHierarchy) -> None:
    """Writes the linear cost by which the optimum is one with these multipliers."""
    problem, n = made.problem, made.problem.n
    problem.g[:] = -(problem.H @ made.x)
    problem.g -= made.multipliers[:n] + problem.A.T @ made.multipliers[n:]


def _tasks(
    rng: np.random.Generator,
    knobs: Knobs,
    x: Float64[np.ndarray, " n"],
    limits: Float64[np.ndarray, "m n"],
) -> tuple[list[np.ndarray], list[np.ndarray], list[np.ndarray]]:
    """Equalities, targets and weights of each level; the first limits become what blocks rows."""
    equalities: list[np.ndarray] = []
    targets: list[np.ndarray] = []
    weights: list[np.ndarray] = []
    first = 0
    for m, rank, stuck in zip(knobs.equalities, knobs.ranks, _share_out(knobs), strict=True):
        E = _equalities(rng, m, knobs.variables, rank, knobs.condition)
        weight = knobs.weight_range ** rng.uniform(-0.5, 0.5, m)
        slack = _contradiction(rng, E, rank, knobs.contradiction) / weight**2
        slack[:stuck] += rng.uniform(*_FORCE, stuck)
        for row in range(stuck):
            limits[first : first + _PAIR] = _blocking(rng, E[row])
            first += _PAIR
        equalities.append(E)
        targets.append(E @ x + slack)
        weights.append(weight)
    return equalities, targets, weights


def _short(rng: np.random.Generator, m: int, n: int) -> Float64[np.ndarray, "m n"]:
    """Random coefficients of some 1/8 with few digits, so that files of them stay small."""
    return np.round(_STEPS * rng.standard_normal((m, n))) / (8.0 * _STEPS)


def _cost(rng: np.random.Generator, n: int) -> Float64[np.ndarray, "n n"]:
    """A final cost with curvatures from some 0.1 to 10, of few digits, and exactly symmetric."""
    root = _short(rng, n, n)
    curvature = np.round(_STEPS * 10.0 ** rng.uniform(-1.0, 1.0, n)) / _STEPS
    return root @ root.T + np.diag(curvature)


def _share_out(knobs: Knobs) -> list[int]:
    """How many equalities of each level are blocked: in turn, as long as a level has some."""
    shares = [0] * knobs.levels
    left = knobs.blocked
    while left:
        for k, m in enumerate(knobs.equalities):
            if left and shares[k] < m:
                shares[k] += 1
                left -= 1
    return shares


def _equalities(
    rng: np.random.Generator, m: int, n: int, rank: int, condition: float
) -> Float64[np.ndarray, "m n"]:
    """Rows with `rank` singular values from 1 down to 1 / condition, in equal steps of a factor."""
    left = np.linalg.qr(rng.standard_normal((m, m)))[0][:, :rank]
    right = np.linalg.qr(rng.standard_normal((n, n)))[0][:rank]
    values = np.logspace(0.0, -np.log10(condition), rank) if rank > 1 else np.ones(rank)
    return (left * values) @ right


def _contradiction(
    rng: np.random.Generator, E: Float64[np.ndarray, "m n"], rank: int, size: float
) -> Float64[np.ndarray, " m"]:
    """A vector of this length that no motion changes: E^T of it is zero."""
    m = len(E)
    free = m - rank
    if size == 0.0 or free == 0:
        return np.zeros(m)
    # Projected, not put together from a basis: which basis comes out depends on the machine.
    held = np.linalg.svd(E)[0][:, :rank]
    amount = rng.standard_normal(m)
    amount -= held @ (held.T @ amount)
    return size * amount / np.linalg.norm(amount)


def _blocking(
    rng: np.random.Generator, row: Float64[np.ndarray, " n"]
) -> Float64[np.ndarray, "2 n"]:
    """Two limits whose sum is a row: at their upper bounds, nothing increases its value."""
    aside = rng.standard_normal(len(row))
    aside *= np.linalg.norm(row) / np.linalg.norm(aside)
    return np.stack([0.5 * row + aside, 0.5 * row - aside])


def _choose_active(
    rng: np.random.Generator, knobs: Knobs, count: int
) -> Float64[np.ndarray, " rows"]:
    """1 at an active upper bound, -1 at an active lower one, 0 elsewhere; bounds on x first."""
    side = np.zeros(count)
    pairs = _PAIR * knobs.blocked
    taken = np.arange(knobs.variables, knobs.variables + pairs)
    others = np.setdiff1d(np.arange(count), taken)
    chosen = rng.choice(others, knobs.active - pairs, replace=False)
    side[chosen] = rng.choice([-1.0, 1.0], len(chosen))
    side[taken] = 1.0
    return side


def _around(
    rng: np.random.Generator,
    value: Float64[np.ndarray, " rows"],
    side: Float64[np.ndarray, " rows"],
) -> tuple[Float64[np.ndarray, " rows"], Float64[np.ndarray, " rows"]]:
    """Bounds that leave room on every side that is not active; one in five rows has only one."""
    below, above = rng.uniform(*_MARGIN, (2, len(value)))
    one_sided = rng.random(len(value)) < 0.2
    below[one_sided & (side >= 0.0)] = np.inf
    above[one_sided & (side < 0.0)] = np.inf
    below[side < 0.0], above[side > 0.0] = 0.0, 0.0
    return value - below, value + above
