"""`OperationalStrategy`: prioritised torques in closed form, with limits and cones met."""

from collections.abc import Sequence
from typing import Literal

import numpy as np
from jaxtyping import Float64

from poise._checks import Numbers
from poise.control._excess import excess
from poise.control._osf._contact_forces import TOLERANCE, ContactForces
from poise.control._osf._limits import DemandLimit, truncate_levels
from poise.control._osf._recursion import OperationalRecursion
from poise.control._osf._rows import LevelRows, OperationalRows, RowScales
from poise.control._rank import RankTreatment
from poise.control._strategy import Answer
from poise.dynamics import Dynamics
from poise.errors import ConfigurationError
from poise.hqp import SolveStatus
from poise.robots import Robot
from poise.stack import Contact, ContactSets, Stack, Task, checked_target

_LIMIT_ROUNDS = 4
"""How often joints that would leave their limits are held before the rest is accepted."""

_SLACK = 1e-6
"""How far outside its bounds a joint's acceleration may be by rounding [rad/s^2]."""


class OperationalStrategy:
    """Solves a stack by `OperationalRecursion`; a `Strategy`, see `OperationalSpaceController`.

    Args:
        robot: the robot.
        stack: contacts, limits and tasks, bound to the robot.
        rank: what happens where a task loses rank.
        demand: what happens where a level asks for too much; None for nothing.

    Attributes:
        robot: the robot.
        stack: contacts, limits and tasks.
        recursion: accelerations of the last tick.
        forces: wrenches of the last tick, and how well they keep to cones and limits.

    Raises:
        ConfigurationError: a stack without tasks.
    """

    commands: Literal["torque", "velocity"] = "torque"

    def __init__(
        self, robot: Robot, stack: Stack, rank: RankTreatment, demand: DemandLimit | None
    ) -> None:
        self.robot, self.stack = robot, stack
        self.recursion = OperationalRecursion(robot.nv, rank, demand)
        self._scales = RowScales(robot)
        self._wrenches: dict[str, Float64[np.ndarray, " c"]] = {}
        self._all_forces = ContactSets(stack, self._make_forces)
        self._set_stack(stack)
        # What is compiled is compiled now, not in the first tick.
        excess(np.zeros(robot.nv), robot.base_dofs, np.zeros(robot.nj), np.zeros(robot.nj))

    @property
    def current(self) -> OperationalRows:
        """Rows of the last tick."""
        return self._current

    @property
    def suspended(self) -> tuple[Task, ...]:
        """Tasks that a contact stands in for at the last tick."""
        return self._current.stack_rows.suspended

    @property
    def softened(self) -> dict[int, float]:
        """Weight of the softening term of each level that was softened, counted from zero."""
        return {}

    @property
    def size(self) -> tuple[int, int]:
        """Number of variables, accelerations and wrenches, and of rows."""
        rows, nv = self._current.stack_rows, self.robot.nv
        return nv + rows.contact_rows.stop, nv + len(rows.target)

    def set_levels(self, levels: Sequence[Sequence[Task]]) -> None:
        """Replaces the tasks, see `OperationalSpaceController.set_levels`."""
        old = self.stack
        stack = Stack(
            old.contacts,
            levels,
            torque_limit=old.torque_limit,
            joint_limit=old.joint_limit,
            balance_limit=old.balance_limit,
            self_collision_limit=old.self_collision_limit,
        )
        stack.bind(self.robot)
        before = {task for _, task in old.tasks()}
        self._set_stack(stack)
        for _, task in stack.tasks():
            if task not in before:
                # It holds what the robot does now, not what it did when it was last switched on.
                task.reset()

    def set_wrench(self, contact: str, wrench: Numbers | None) -> None:
        """Sets a contact's reference wrench, see `OperationalSpaceController.set_wrench`."""
        size = self.stack.contact(contact).dim
        what = f"wrench of contact {contact!r} [N, N m]"
        self._wrenches[contact] = (
            np.zeros(size) if wrench is None else checked_target(wrench, size, what).copy()
        )
        for forces in self._all_forces:
            forces.set_references(self._wrenches)

    def reset(self) -> None:
        """Forgets what the last tick found."""
        self._solved = False
        self._held = np.zeros(self.robot.nj, dtype=np.bool_)
        self._bounds, self._bound_error = np.zeros(self.robot.nj), 0.0
        self._held_rows: dict[int, float] = {}

    def prepare(self, contacts: tuple[Contact, ...]) -> bool:
        """Takes up rows and forces of a set of active contacts."""
        last, self._current = self._current, self._prepared.of(contacts)
        self.forces = self._all_forces.of(contacts)
        return self._current is not last

    def rehearse(self, dynamics: Dynamics) -> None:
        """Goes through a tick under every prepared set of contacts, and forgets it."""
        for contacts in self._prepared.sets:
            self.prepare(contacts)
            self.assemble(dynamics)
            self.solve()
        self.prepare(self.stack.active_contacts)
        self.reset()

    def assemble(self, dynamics: Dynamics) -> None:
        """Writes one state's rows."""
        self._dynamics = dynamics
        self._current.fill(dynamics)

    def solve(self) -> Answer:
        """Accelerations of all levels, then the wrenches and torques that bring them about."""
        rows, forces, dynamics = self._current, self.forces, self._dynamics
        acceleration = self._accelerations(rows.levels)
        if not forces.solve(acceleration, dynamics, rows.contact_jacobian):
            acceleration = truncate_levels(
                self.recursion.steps(),
                lambda a: forces.solve(a, dynamics, rows.contact_jacobian),
            )
        self._solved = True
        return Answer(
            SolveStatus.OPTIMAL,
            forces.torque.copy(),
            self._measure(acceleration),
            acceleration,
            rows.stack_rows.wrenches(forces.wrench.copy()),
            self._is_held_back(),
        )

    def _is_held_back(self) -> bool:
        """Whether a row of the balance limit is held."""
        balance = self._current.stack_rows.balance
        return balance is not None and any(row < balance.dim for row in self._held_rows)

    def task_residuals(self) -> dict[str, float]:
        """Norm of what each task could not meet at the last solve [unit/s^2]."""
        return self._current.stack_rows.task_residuals() if self._solved else {}

    def explain(self) -> str:
        """What could not be met at the last tick, in words."""
        forces, notes = self.forces, list[str]()
        names = [self.robot.joint_names[i] for i in np.flatnonzero(self._held)]
        if names:
            notes.append("held at their limits: " + ", ".join(names))
        limits = self._current.stack_rows.limits
        if self._held_rows:
            labels = [label for limit in limits for label in limit.labels]
            held = [name for name, count in labels for _ in range(count)]
            names = sorted({held[i] for i in self._held_rows})
            notes.append("held back by the " + ", ".join(names))
        for error, what in (
            (forces.base_error, "base dynamics miss {:.2g} of the weight"),
            (forces.cone_error, "contacts are asked for {:.2g} of the weight outside their cones"),
            (forces.torque_error, "a torque limit is exceeded by {:.2g} of itself"),
            (self._bound_error, "joints leave their acceleration bounds by {:.2g} of the largest"),
        ):
            if error > TOLERANCE:
                notes.append(what.format(error))
        return "; ".join(notes) or "contacts and limits hold"

    def _set_stack(self, stack: Stack) -> None:
        if not stack.levels:
            raise ConfigurationError(
                "the operational space formulation has nothing to do",
                got=[],
                wanted="at least one level with a task",
            )
        self._scales.learn(stack)
        self.stack = stack
        self._prepared = ContactSets(
            stack, lambda c: OperationalRows(self.robot, stack, c, self._scales)
        )
        self._current = self._prepared.of(stack.active_contacts)
        self.forces = self._all_forces.of(stack.active_contacts)
        self.reset()

    def _make_forces(self, contacts: tuple[Contact, ...]) -> ContactForces:
        forces = ContactForces(self.robot, self.stack, contacts)
        forces.set_references(self._wrenches)
        return forces

    def _accelerations(self, rows: LevelRows) -> Float64[np.ndarray, " nv"]:
        """Accelerations of all levels, with joints and balance held that would leave their limits.

        Of the rows of balance and self-collision limit the one that is farthest out is held in each
        round: the next is often met then, and edges on both sides of a corner are held together
        where it is not.
        """
        acceleration = self.recursion.resolve(rows, self._dynamics)
        self._held = np.zeros(self.robot.nj, dtype=np.bool_)
        self._held_rows = {}
        for _ in range(2 * _LIMIT_ROUNDS):
            # Joints first: what they give up may have been what leaned on the balance.
            if not (self._hold_joints(acceleration) or self._hold_limit(acceleration)):
                break
            acceleration = self.recursion.resolve(self._with_held(rows), self._dynamics)
        return acceleration

    def _hold_joints(self, acceleration: Float64[np.ndarray, " nv"]) -> bool:
        """Holds the joints that leave their limits; whether there are new ones."""
        limit, base = self.stack.joint_limit, self.robot.base_dofs
        if not excess(acceleration, base, limit.lower, limit.upper) > _SLACK:
            return False
        joints = acceleration[base:]
        outside = (joints < limit.lower - _SLACK) | (joints > limit.upper + _SLACK)
        outside &= ~self._held
        if outside.any():
            target = np.clip(joints, limit.lower, limit.upper)
            self._bounds = np.where(self._held, self._bounds, target)
            self._held |= outside
        return bool(outside.any())

    def _hold_limit(self, acceleration: Float64[np.ndarray, " nv"]) -> bool:
        """Holds the row of the limits that is farthest out; whether there is a new one."""
        stack_rows = self._current.stack_rows
        own = stack_rows.limit_rows
        if not stack_rows.excess(acceleration, own) > _SLACK:
            return False
        values = stack_rows.J[own] @ acceleration
        over, under = values - stack_rows.upper[own], stack_rows.target[own] - values
        outside = np.maximum(over, under)
        outside[list(self._held_rows)] = -np.inf
        worst = int(np.argmax(outside))
        if not outside[worst] > _SLACK:
            return False
        bound = stack_rows.upper if over[worst] > under[worst] else stack_rows.target
        self._held_rows[worst] = float(bound[own][worst])
        return True

    def _with_held(self, rows: LevelRows) -> LevelRows:
        """The levels with what is held behind the physics."""
        index = np.flatnonzero(self._held)
        if len(index):
            columns = index + self.robot.base_dofs
            selection = np.eye(self.robot.nv)[columns]
            rows = rows.with_held(selection, self._bounds[index], self._scales.joints[columns])
        if self._held_rows:
            stack_rows = self._current.stack_rows
            held = stack_rows.J[stack_rows.limit_rows][list(self._held_rows)]
            target = np.array(list(self._held_rows.values()))
            rows = rows.with_held(held, target, self._scales.of_rows(held))
        return rows

    def _measure(self, acceleration: Float64[np.ndarray, " nv"]) -> tuple[float, ...]:
        """Residuals: dynamics and torque limits, contacts and joint limits, then the levels."""
        limit, base = self.stack.joint_limit, self.robot.base_dofs
        outside = excess(acceleration, base, limit.lower, limit.upper)
        self._bound_error = outside / limit.acceleration_max
        contacts, *levels = self._current.stack_rows.measure(acceleration).tolist()
        forces = self.forces
        return (
            max(forces.base_error, forces.torque_error),
            max(contacts, forces.cone_error, self._bound_error),
            *levels,
        )
