"""`OperationalStrategy`: prioritised torques in closed form, with limits and cones met."""

from collections.abc import Sequence
from typing import Literal

import numpy as np
from jaxtyping import Float64

from poise._checks import Numbers
from poise.control._osf._contact_forces import TOLERANCE, ContactForces
from poise.control._osf._kernels import SLACK
from poise.control._osf._recursion import OperationalRecursion
from poise.control._osf._rows import OperationalRows, RowScales
from poise.control._rank import RankTreatment
from poise.control._strategy import Answer, softening_notes
from poise.dynamics import Dynamics
from poise.errors import ConfigurationError
from poise.hqp import SolveStatus
from poise.robots import Robot
from poise.stack import Contact, ContactSets, Stack, Task, checked_target


class OperationalStrategy:
    """Torques by `OperationalRecursion`; a `Strategy`, see `OperationalSpaceController`."""

    commands: Literal["torque", "velocity"] = "torque"
    kept = ("reference_wrenches",)

    def __init__(self, robot: Robot, stack: Stack, rank: RankTreatment) -> None:
        self.robot, self.stack = robot, stack
        self.recursion = OperationalRecursion(robot, rank)
        self._scales = RowScales(robot)
        self._wrenches: dict[str, Float64[np.ndarray, " c"]] = {}
        self._set_stack(stack)

    @property
    def current(self) -> OperationalRows:
        """Rows of the last tick."""
        return self._current

    @property
    def suspended(self) -> tuple[Task, ...]:
        """Tasks replaced by a contact at the last tick."""
        return self._current.stack_rows.suspended

    @property
    def softened(self) -> dict[int, float]:
        """Weight of the softening term of each level that was softened, counted from zero."""
        if not self._solved:
            return {}
        weights = self._current.levels.softened[1:].tolist()
        return {level: mu for level, mu in enumerate(weights) if mu > 0.0}

    @property
    def size(self) -> tuple[int, int]:
        """Number of variables, accelerations and wrenches, and of rows."""
        rows, nv = self._current.stack_rows, self.robot.nv
        return nv + rows.contact_rows.stop, nv + len(rows.target)

    def set_levels(self, levels: Sequence[Sequence[Task]]) -> None:
        """Replace the tasks, see `OperationalSpaceController.set_levels`."""
        old = self.stack
        stack = Stack(
            old.contacts,
            levels,
            torque_limit=old.torque_limit,
            joint_limit=old.joint_limit,
            balance_limit=old.balance_limit,
            self_collision_limit=old.self_collision_limit,
            softening=old.softening,
        )
        stack.bind(self.robot)
        before = {task for _, task in old.tasks()}
        self._set_stack(stack)
        for _, task in stack.tasks():
            if task not in before:
                # A new task holds the present pose, not that of its last use.
                task.reset()

    def set_wrench(self, contact: str, wrench: Numbers | None) -> None:
        """Set a contact's reference wrench, see `OperationalSpaceController.set_wrench`."""
        size = self.stack.contact(contact).dim
        what = f"wrench of contact {contact!r} [N, N m]"
        value = np.zeros(size) if wrench is None else checked_target(wrench, size, what).copy()
        self.reference_wrenches = self._wrenches | {contact: value}

    @property
    def reference_wrenches(self) -> dict[str, Float64[np.ndarray, " c"]]:
        """References of internal forces, by contact [N, N m]."""
        return self._wrenches

    @reference_wrenches.setter
    def reference_wrenches(self, wrenches: dict[str, Float64[np.ndarray, " c"]]) -> None:
        self._wrenches = wrenches
        for forces in self._all_forces:
            forces.set_references(wrenches)

    def reset(self) -> None:
        """Forget the last tick."""
        self._solved = False
        self._bound_error = 0.0
        self._held_joints, self._held_rows = list[int](), list[int]()

    def prepare(self, contacts: tuple[Contact, ...]) -> bool:
        """Use rows and forces of a set of active contacts."""
        last, self._current = self._current, self._prepared.of(contacts)
        self.forces = self._all_forces.of(contacts)
        return self._current is not last

    def rehearse(self, dynamics: Dynamics) -> None:
        """Run a tick under every prepared set of contacts, and forget it."""
        for contacts in self._prepared.sets:
            self.prepare(contacts)
            self.assemble(dynamics)
            self.solve()
        self.prepare(self.stack.active_contacts)
        self.reset()

    def assemble(self, dynamics: Dynamics) -> None:
        """Write one state's rows."""
        self._dynamics = dynamics
        self._current.fill(dynamics)

    def solve(self) -> Answer:
        """Find accelerations of all levels, then their wrenches and torques."""
        rows, forces, dynamics = self._current, self.forces, self._dynamics
        wanted = self.recursion.resolve(rows.levels, dynamics)
        acceleration = forces.solve(wanted, dynamics)
        self._solved = True
        self._find_held(acceleration)
        return Answer(
            SolveStatus.OPTIMAL,
            forces.torque.copy(),
            self._measure(acceleration),
            acceleration,
            rows.stack_rows.wrenches(forces.wrench.copy()),
            forces.bounded and rows.stack_rows.is_held(acceleration),
        )

    def task_residuals(self) -> dict[str, float]:
        """Return the norm of each task's residual at the last solve [unit/s^2]."""
        return self._current.stack_rows.task_residuals() if self._solved else {}

    def explain(self) -> str:
        """Describe what was not met at the last tick."""
        forces, notes = self.forces, list[str]()
        names = [self.robot.joint_names[i] for i in self._held_joints]
        if names:
            notes.append("held at their limits: " + ", ".join(names))
        limits = self._current.stack_rows.limits
        labels = [label for limit in limits for label in limit.labels]
        rows = [name for name, count in labels for _ in range(count)]
        held = sorted({rows[i] for i in self._held_rows})
        if held:
            notes.append("held back by the " + ", ".join(held))
        for error, what in (
            (forces.base_error, "base dynamics miss {:.2g} of the weight"),
            (forces.cone_error, "contacts are asked for {:.2g} of the weight outside their cones"),
            (forces.torque_error, "a torque limit is exceeded by {:.2g} of itself"),
            (self._bound_error, "joints leave their acceleration bounds by {:.2g} of the largest"),
        ):
            if error > TOLERANCE:
                notes.append(what.format(error))
        words = "; ".join(notes) or "contacts and limits hold"
        return "\n".join([words, *softening_notes(self.softened)])

    def _set_stack(self, stack: Stack) -> None:
        if not stack.levels:
            raise ConfigurationError(
                "the operational space formulation has nothing to do",
                got=[],
                wanted="at least one level with a task",
            )
        self._scales.measure(stack)
        self.stack = stack
        self._prepared = ContactSets(
            stack, lambda c: OperationalRows(self.robot, stack, c, self._scales)
        )
        self._all_forces = ContactSets(stack, self._make_forces)
        self._current = self._prepared.of(stack.active_contacts)
        self.forces = self._all_forces.of(stack.active_contacts)
        self.reset()

    def _make_forces(self, contacts: tuple[Contact, ...]) -> ContactForces:
        forces = ContactForces(self.robot, self.stack, self._prepared.of(contacts))
        forces.set_references(self._wrenches)
        return forces

    def _find_held(self, acceleration: Float64[np.ndarray, " nv"]) -> None:
        """Find the joints and rows of limits at their bounds."""
        self._held_joints, self._held_rows = [], []
        if self.forces.bounded:
            bounds, joints = self._current.bounds, acceleration[self.robot.base_dofs :]
            values = bounds.rows @ acceleration
            at = np.minimum(joints - bounds.lower, bounds.upper - joints) < SLACK
            rows = np.minimum(values - bounds.least, bounds.most - values) < SLACK
            self._held_joints = np.flatnonzero(at).tolist()
            self._held_rows = np.flatnonzero(rows).tolist()

    def _measure(self, acceleration: Float64[np.ndarray, " nv"]) -> tuple[float, ...]:
        """Measure dynamics and torque limits, contacts and joint limits, then the levels."""
        limit, joints = self.stack.joint_limit, acceleration[self.robot.base_dofs :]
        outside = np.maximum(joints - limit.upper, limit.lower - joints).max(initial=0.0)
        self._bound_error = float(outside) / limit.acceleration_max
        contacts, *levels = self._current.stack_rows.measure(acceleration).tolist()
        forces = self.forces
        return (
            max(forces.base_error, forces.torque_error),
            max(contacts, forces.cone_error, self._bound_error),
            *levels,
        )
