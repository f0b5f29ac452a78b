"""`StackRows`: the rows of a stack for one set of active contacts, stacked once a tick.

`ContactSets`: what is prepared for each set of active contacts, and which are, ahead of time.
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from itertools import accumulate, chain, combinations, pairwise
from typing import Generic, Literal, TypeVar

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import compiled
from poise.dynamics import Dynamics
from poise.robots import Robot
from poise.stack._balance import BalanceRows
from poise.stack._contact import Contact
from poise.stack._evaluation import Evaluation
from poise.stack._self_collision import SelfCollisionRows
from poise.stack._softening import Softening
from poise.stack._stack import Stack, is_held
from poise.stack._tables import Rows
from poise.stack._task import Task

AT_BOUND = 1e-6
"""Acceleration that a row of the balance limit may lack to its bound and still be at it [m/s^2]."""

T = TypeVar("T")

Labels = list[tuple[str, int]]
"""Names of rows, each with the number of rows it stands for."""


class StackRows:
    """Evaluate, order, weight and suspend the rows of a stack for one set of contacts.

    This is the only place where tasks and contacts are evaluated. Every strategy reads from it,
    or has it written straight into the memory of a problem of its own (`write_into`):

        rows                    acceleration level, `update`     velocity level, `update_velocities`
        contacts                J dv = reference - drift         J v = 0
        rows of the strategy    left to it
        balance limit           J dv <= bound                    none
        self-collision limit    J dv >= bound                    J v >= bound
        tasks, level by level   J dv = reference - drift         J v = velocity

    A frame task on a frame in contact is suspended and has no rows: the contact already decides how
    that frame moves. A point contact leaves its frame free to turn and suspends position tasks
    only. Bounds on wrenches and, at acceleration level, on the joints come with the rows.

    Attributes:
        contacts: the contacts that have rows.
        levels: the tasks that act, level by level; a level may be empty.
        suspended: tasks that a contact stands in for.
        J: coefficients of all rows.
        target: right-hand sides of all rows: reference - drift, or velocities; lower bounds of
            those of the limits.
        upper: the same once more, but for the upper bounds of the limits.
        weight: weight of each row in its level; one for contacts.
        ends: where each of the user's levels ends; the first entry is where the first one begins.
        contact_rows: the rows of the contacts.
        own_rows: the strategy's own rows.
        balance: the rows of the balance limit; None where there are none.
        balance_rows: where they stand.
        collisions: the rows of the self-collision limit; None where there are none.
        collision_rows: where they stand.
        task_rows: each task that acts, with its rows.
        wrench_slices: where each contact's wrench stands among all wrenches, and its rows among
            the contacts' rows.
        wrench_lower: simple bounds of all wrenches [N, N m].
        wrench_upper: upper ones.
        evaluation: evaluates all of them.
        settling: joint limits, and what joints do beside contacts that come to rest.
        cone: rows C of all wrench cones C F <= 0, in the contacts' own axes.
        softening: weights and reference of the levels' softening terms.
    """

    def __init__(
        self,
        robot: Robot,
        stack: Stack,
        contacts: Sequence[Contact],
        *,
        stance: Contact | None = None,
        own_rows: int = 0,
        balance: Literal["before", "behind"] | None = None,
        collisions: Literal["before", "behind"] | None = None,
        joints: Collection[str] | None = None,
    ) -> None:
        self.contacts, self._stance, self._stack = tuple(contacts), stance, stack
        holding = self.contacts if stance is None else (*self.contacts, stance)
        self.suspended = tuple(t for _, t in stack.tasks() if is_held(t, holding))
        self.levels = tuple(
            tuple(t for t in level if t not in self.suspended) for level in stack.levels
        )
        self.wrench_slices = _spans([c.dim for c in self.contacts])
        wrench_dim = sum(c.dim for c in self.contacts)
        first = wrench_dim + own_rows
        self.contact_rows, self.own_rows = slice(0, wrench_dim), slice(wrench_dim, first)
        self.balance = stack.balance_limit.rows_for(self.contacts) if balance else None
        apart = stack.self_collision_limit
        self.collisions = apart.rows_for(holding, joints) if collisions else None
        sides = (self.balance, balance), (self.collisions, collisions)
        before = [limit for limit, side in sides if limit is not None and side == "before"]
        behind = [limit for limit, side in sides if limit is not None and side == "behind"]
        places = dict(zip(before, _spans([b.dim for b in before], first), strict=True))
        first += sum(limit.dim for limit in before)
        tasks = [task for level in self.levels for task in level]
        self.task_rows = list(zip(tasks, _spans([t.dim for t in tasks], first), strict=True))
        sizes = [sum(t.dim for t in level) for level in self.levels]
        self.ends: Int64[np.ndarray, " ends"] = np.array([*accumulate(sizes, initial=first)])
        last = int(self.ends[-1])
        places |= dict(zip(behind, _spans([b.dim for b in behind], last), strict=True))
        self.balance_rows = slice(first, first)
        if self.balance is not None:
            self.balance_rows = places[self.balance]
        self.collision_rows = slice(self.balance_rows.stop, self.balance_rows.stop)
        if self.collisions is not None:
            self.collision_rows = places[self.collisions]
        count = last + sum(limit.dim for limit in behind)
        cones = sum(len(c.cone) for c in contacts)
        self.write_cones_into(np.zeros((cones, wrench_dim)))
        self._missing = np.zeros(count)
        self._residuals = np.zeros(1 + len(sizes))
        contact_rows = zip(self.contacts, self.wrench_slices, strict=True)
        found = [*contact_rows, *places.items(), *self.task_rows]
        owners, rows = zip(*found, strict=True) if found else ((), ())
        self.evaluation = Evaluation(robot, owners, rows, count, wrench_dim)
        limit = stack.joint_limit
        self.settling = limit.settling(limit.lower, limit.upper)
        self._nv = robot.nv
        self.softening = Softening(robot, self.levels, self.task_rows, self.ends, stack.softening)
        self._take(self.evaluation.rows)
        # What is compiled is compiled now, not in the first tick.
        self.measure(np.zeros(robot.nv))

    def write_into(
        self,
        matrix: Float64[np.ndarray, "rows columns"],
        first: int,
        bounds: tuple[Float64[np.ndarray, " m"], Float64[np.ndarray, " m"]],
        weight: Float64[np.ndarray, " m"],
        wrench_bounds: tuple[Float64[np.ndarray, " w"], Float64[np.ndarray, " w"]],
    ) -> None:
        """Set the memory of a strategy that the rows are written into.

        Rows of the strategy's own are left alone.
        """
        weight[:] = self.weight
        self.evaluation.write_into(matrix, first, *bounds, weight, *wrench_bounds)
        self._take(self.evaluation.rows)

    def write_cones_into(self, matrix: Float64[np.ndarray, "cone w"]) -> None:
        """Set the memory of a strategy that `cone` is written into."""
        rows = _spans([len(c.cone) for c in self.contacts])
        self.cone: Float64[np.ndarray, "cone w"] = matrix
        self.cone[:] = stacked_cones(self.contacts)
        self._cones = [
            (contact, matrix[at, wrench])
            for contact, at, wrench in zip(self.contacts, rows, self.wrench_slices, strict=True)
        ]

    def _take(self, rows: Rows) -> None:
        self.J = rows.matrix[rows.first : rows.first + len(rows.target), : self._nv]
        self.target, self.weight, self.upper = rows.target, rows.weight, rows.upper
        self.wrench_lower, self.wrench_upper = rows.wrench_lower, rows.wrench_upper
        self.softening.read_from(rows)
        for task, place in self.task_rows:
            self.weight[place] = task.weight
        # What is compiled is compiled now, not in the first tick.
        for limit in (self.balance_rows, self.collision_rows):
            self.excess(np.zeros(self._nv), limit)

    def update(self, dynamics: Dynamics) -> None:
        """Evaluate limits, contacts and tasks for a state: rows on accelerations."""
        self.evaluation.update(dynamics, settling_at=self.settling.address)
        # What of a surface carries may change, see `SurfaceContact.carry_on`.
        for contact, cone in self._cones:
            cone[:] = contact.cone

    def update_velocities(self, dynamics: Dynamics) -> None:
        """Evaluate contacts and tasks for a state: rows on velocities.

        A task asks for its target's velocity plus its error fed back, (kp / kd) error, or for the
        velocity that it was given; contacts do not move.
        """
        if self._stance is not None:
            self._stance.evaluate(dynamics)
        self.evaluation.update(dynamics, velocities=True)

    def measure(
        self, x: Float64[np.ndarray, " n"], J: Float64[np.ndarray, "m n"] | None = None
    ) -> Float64[np.ndarray, " ends"]:
        """Return the relative residuals of the contacts and of each level; overwritten."""
        rows, bounds = self.J if J is None else J, (self.contact_rows.stop, self.ends)
        _measure(rows, self.target, self.weight, bounds, x, self._missing, self._residuals)
        return self._residuals

    def is_held(self, x: Float64[np.ndarray, " n"]) -> bool:
        """Return whether a row of the balance limit is at its bound."""
        return self.excess(x, self.balance_rows) >= -AT_BOUND

    @property
    def limits(self) -> tuple[BalanceRows | SelfCollisionRows, ...]:
        """The rows of the balance and the self-collision limit, where there are any."""
        return tuple(limit for limit in (self.balance, self.collisions) if limit is not None)

    @property
    def limit_rows(self) -> slice:
        """Rows of both limits, if both are on one side of the tasks."""
        balance, collisions = self.balance_rows, self.collision_rows
        if self.balance is None:
            return collisions
        return slice(balance.start, collisions.stop if self.collisions else balance.stop)

    def excess(self, x: Float64[np.ndarray, " n"], rows: slice) -> float:
        """Return the largest excess of an answer over the bounds of rows of limits [m/s^2, m/s].

        Negative where all of them hold with room; minus infinity for no rows.
        """
        own = self.evaluation.rows
        matrix, first = own.matrix, own.first + rows.start
        return _excess(matrix, first, self.target[rows], self.upper[rows], x, self._nv)

    def task_residuals(self, missing: Float64[np.ndarray, " m"] | None = None) -> dict[str, float]:
        """Norm of what each task could not meet, unweighted, by its name [unit/s^2, unit/s]."""
        left = self._missing if missing is None else missing
        return {task.name: float(np.linalg.norm(left[rows])) for task, rows in self.task_rows}

    @property
    def motion_labels(self) -> Labels:
        """Names of the contacts' rows."""
        return [(f"motion of contact {c.name}", c.dim) for c in self.contacts]

    @property
    def cone_labels(self) -> Labels:
        """Names of the cones' rows."""
        return [(f"wrench cone of contact {c.name}", len(c.cone)) for c in self.contacts]

    @property
    def force_labels(self) -> Labels:
        """Names of the bounds on wrenches."""
        return [(f"normal force of contact {c.name}", c.dim) for c in self.contacts]

    @property
    def task_labels(self) -> list[Labels]:
        """Names of the tasks' rows, level by level."""
        return [[(f"task {t.name}", t.dim) for t in level] for level in self.levels]

    @property
    def level_names(self) -> list[str]:
        """A name for each level: its tasks."""
        return [", ".join(t.name for t in level) for level in self.levels]

    @property
    def level_sizes(self) -> list[int]:
        """Number of rows of each level."""
        return np.diff(self.ends).tolist()

    def wrenches(self, wrench: Float64[np.ndarray, " w"]) -> dict[str, Float64[np.ndarray, " d"]]:
        """All wrenches by the names of their contacts, as views [N, N m]."""
        slices = zip(self.contacts, self.wrench_slices, strict=True)
        return {contact.name: wrench[rows] for contact, rows in slices}


PREPARED_CONTACTS = 3
"""Stacks of up to so many contacts have all their sets prepared before the first tick."""


class ContactSets(Generic[T]):
    """Objects made once for each set of active contacts: switching back allocates nothing.

    The active contacts are prepared when this is made; where there are few contacts, all their
    sets are, so that no tick has to make one. What is wrong is so refused before the first tick.
    """

    def __init__(self, stack: Stack, make: Callable[[tuple[Contact, ...]], T]) -> None:
        self._make = make
        self._made: dict[tuple[Contact, ...], T] = {}
        contacts = stack.contacts
        sets = {stack.active_contacts}
        if len(contacts) <= PREPARED_CONTACTS:
            sizes = range(len(contacts) + 1)
            sets.update(chain.from_iterable(combinations(contacts, k) for k in sizes))
        for contacts in sets:
            self.of(contacts)

    def of(self, contacts: tuple[Contact, ...]) -> T:
        """Return the object of a set of contacts, given in the order of the stack."""
        made = self._made.get(contacts)
        if made is None:
            made = self._made[contacts] = self._make(contacts)
        return made

    @property
    def sets(self) -> tuple[tuple[Contact, ...], ...]:
        """Contact sets with an object."""
        return tuple(self._made)

    def __iter__(self) -> Iterator[T]:
        """All objects."""
        return iter(self._made.values())

    def __len__(self) -> int:
        """Number of sets."""
        return len(self._made)


def home_jacobians(
    home: Dynamics, owners: Iterable[Contact | Task]
) -> dict[Contact | Task, Float64[np.ndarray, "m nv"]]:
    """Jacobians of contacts and tasks in one posture, by which loss of rank is measured."""
    found: dict[Contact | Task, Float64[np.ndarray, "m nv"]] = {}
    for owner in owners:
        owner.evaluate(home)
        found[owner] = owner.jacobian.copy()
        owner.reset()
    return found


def stacked_cones(contacts: Sequence[Contact]) -> Float64[np.ndarray, "cone w"]:
    """The rows C of all wrench cones C F <= 0, on all wrenches."""
    rows = _spans([len(c.cone) for c in contacts])
    columns = _spans([c.dim for c in contacts])
    cones = np.zeros((sum(len(c.cone) for c in contacts), sum(c.dim for c in contacts)))
    for contact, at, wrench in zip(contacts, rows, columns, strict=True):
        cones[at, wrench] = contact.cone
    return cones


def _spans(sizes: Iterable[int], start: int = 0) -> list[slice]:
    return [slice(a, b) for a, b in pairwise(accumulate(sizes, initial=start))]


@compiled
def _measure(
    J: Float64[np.ndarray, "m n"],
    target: Float64[np.ndarray, " m"],
    weight: Float64[np.ndarray, " m"],
    bounds: tuple[int, Int64[np.ndarray, " ends"]],
    x: Float64[np.ndarray, " n"],
    missing: Float64[np.ndarray, " m"],
    residuals: Float64[np.ndarray, " ends"],
) -> None:
    contacts, ends = bounds
    for level in range(len(residuals)):
        begin, end = (0, contacts) if level == 0 else (ends[level - 1], ends[level])
        left = asked = 0.0
        for row in range(begin, end):
            value = -target[row]
            for i in range(len(x)):
                value += J[row, i] * x[i]
            missing[row] = value
            left += (weight[row] * value) ** 2
            asked += (weight[row] * target[row]) ** 2
        residuals[level] = np.sqrt(left) / max(1.0, np.sqrt(asked))


@compiled
def _excess(
    matrix: Float64[np.ndarray, "rows columns"],
    first: int,
    lower: Float64[np.ndarray, " m"],
    upper: Float64[np.ndarray, " m"],
    x: Float64[np.ndarray, " k"],
    nv: int,
) -> float:
    worst = -np.inf
    for row in range(len(upper)):
        value = 0.0
        for i in range(nv):
            value += matrix[first + row, i] * x[i]
        worst = max(worst, value - upper[row], lower[row] - value)
    return worst
