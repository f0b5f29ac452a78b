"""`OperationalSpaceController`: prioritised torques in closed form, with limits and cones met."""

from collections.abc import Sequence
from typing import Literal

import numpy as np
from jaxtyping import Float64

from poise._checks import Numbers, checked_kind
from poise.control._controller import Controller
from poise.control._fallback import RateLimit
from poise.control._osf._contact_forces import ContactForces
from poise.control._osf._recursion import OperationalRecursion
from poise.control._osf._rows import OperationalRows, RowScales
from poise.control._rank import RankTreatment
from poise.control._strategy import PHYSICS_TOLERANCE, Answer, bound_stack, softening_notes
from poise.dynamics import Dynamics
from poise.errors import ConfigurationError
from poise.hqp import SolveStatus
from poise.robots import Robot
from poise.stack import AT_BOUND, Contact, ContactSets, Stack, Task, checked_target


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
        return self._current.stack_rows.suspended

    @property
    def softened(self) -> dict[int, float]:
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
        self._solved = False
        self._bound_error = 0.0
        self._held_joints, self._held_rows = list[int](), list[int]()

    def prepare(self, contacts: tuple[Contact, ...]) -> bool:
        last, self._current = self._current, self._prepared.of(contacts)
        self.forces = self._all_forces.of(contacts)
        return self._current is not last

    def rehearse(self, dynamics: Dynamics) -> None:
        for contacts in self._prepared.sets:
            self.prepare(contacts)
            self.assemble(dynamics)
            self.solve()
        self.prepare(self.stack.active_contacts)
        self.reset()

    def assemble(self, dynamics: Dynamics) -> None:
        self._dynamics = dynamics
        self._current.fill(dynamics)

    def solve(self) -> Answer:
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
        return self._current.stack_rows.task_residuals() if self._solved else {}

    def explain(self) -> str:
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
            if error > PHYSICS_TOLERANCE:
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
            at = np.minimum(joints - bounds.lower, bounds.upper - joints) < AT_BOUND
            rows = np.minimum(values - bounds.least, bounds.most - values) < AT_BOUND
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


class OperationalSpaceController(Controller):
    """The operational space formulation with strict priorities, on any robot.

    `OperationalRecursion` gives torques in closed form. On a floating base contacts stand above
    all tasks, and `ContactForces` finds the wrenches that carry the base, with internal forces.

    Levels that cannot be met are softened by the stack's setting. Where the closed form leaves a
    contact's cone, a torque limit or the bounds of joint, balance or self-collision limit,
    `BoundedAcceleration` takes its place: bounds stand above the tasks, and tasks lose from the
    bottom up. Tasks of one level that conflict share by their weights over the mobility of
    their rows in the home posture. Tasks can be switched and re-ordered while running: no torque
    changes by more than `torque_step` from one tick to the next.

    `step` never raises. For a state that is not finite it returns the last good torque decayed
    towards damping, with that status.

    Args:
        robot: the robot.
        stack: contacts, limits and tasks; `default_stack(robot)` when None.
        rank: treatment of tasks that lose rank; the defaults of `RankTreatment` when None.
        torque_step: largest change of a torque from tick to tick [N m], one number or one a joint;
            a tenth of the torque limits when None, `math.inf` for no bound.
        dynamics: shared with the estimator of the state, see `Controller`; its own when None.

    Raises:
        PoiseError: a name that the robot does not have, no task, or a setting that cannot be right.
    """

    def __init__(
        self,
        robot: Robot,
        stack: Stack | None = None,
        *,
        rank: RankTreatment | None = None,
        torque_step: Numbers | None = None,
        dynamics: Dynamics | None = None,
    ) -> None:
        stack = bound_stack(robot, stack)
        rank = checked_kind(rank or RankTreatment(), RankTreatment, "rank of the controller")
        self._operational = OperationalStrategy(robot, stack, rank)
        super().__init__(
            self._operational, rate_limit=RateLimit(robot, torque_step), dynamics=dynamics
        )

    @property
    def strategy(self) -> OperationalStrategy:
        """Rows, accelerations and wrenches of the last tick."""
        return self._operational

    def set_levels(self, levels: Sequence[Sequence[Task]]) -> None:
        """Replace the tasks while running: on, off, or in another order.

        Tasks that remain keep their targets. Torques change by `torque_step` a tick at most.

        Args:
            levels: lists of tasks, most important first.

        Raises:
            ConfigurationError: no task, an empty level, or a name used twice.
            UnknownNameError: a frame or joint that the robot does not have.
        """
        self._operational.set_levels(levels)

    def set_wrench(self, contact: str, wrench: Numbers | None) -> None:
        """Set the reference of a contact's part of the internal forces.

        Of all wrenches that carry the robot, the nearest to the references are taken. They move
        nothing: they press contacts against each other, or shift load between them.

        Args:
            contact: name of a contact of the stack.
            wrench: [force; moment] on the robot, along the contact's axes at its centre
                [N, N m]; None for as little as possible.

        Raises:
            UnknownNameError: no such contact.
            TargetError: wrong shape, NaN or infinite.
        """
        self._operational.set_wrench(contact, wrench)
