"""`OperationalSpaceController`: prioritised torques in closed form."""

import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64

from poise._checks import Numbers, checked_kind
from poise.control._command import Command, CommandStatus
from poise.control._fallback import Fallback
from poise.control._osf._contact_forces import TOLERANCE, ContactForces
from poise.control._osf._formulation import OperationalFormulation
from poise.control._osf._levels import LevelRows
from poise.control._osf._limits import DemandLimit, TorqueStep, shed
from poise.control._osf._rank import RankTreatment
from poise.control._osf._recursion import OperationalRecursion
from poise.control._osf._scales import RowScales
from poise.control._ticking import TickingController
from poise.dynamics import RobotState
from poise.errors import ConfigurationError
from poise.robots import Robot
from poise.stack import Contact, Stack, Task, checked_target

_LIMIT_ROUNDS = 4
"""How often joints that would leave their limits are held before the rest is accepted."""

_SLACK = 1e-6
"""How far outside its bounds a joint's acceleration may be by rounding [rad/s^2]."""


class OperationalSpaceController(TickingController[Float64[np.ndarray, " nv"]]):
    """The operational space formulation with strict priorities, on any robot.

    Torques come in closed form from `OperationalRecursion`. On a floating base contacts stand above
    all tasks, and `ContactForces` finds the wrenches that carry the base, internal forces among
    them.

    A level that asks for more acceleration of a joint than `demand` is damped. Other inequalities
    are no part of the formulation; they are met as follows. Joints whose acceleration
    would leave the bounds of the stack's joint limit are held at the bound, above the tasks. Where
    a contact's cone or a torque limit cannot be met by internal forces, tasks are let go from the
    bottom up, the last of them partly, until it is. Tasks can be switched and re-ordered while
    running: no torque changes by more than `torque_step` from one tick to the next.

    `step` never raises. A state that is not finite gives the last good torque decayed towards
    damping, and says so in the command's status.

    Args:
        robot: the robot.
        stack: contacts, limits and tasks; `default_stack(robot)` when None.
        rank: what happens where a task loses rank; the defaults of `RankTreatment` when None.
        demand: largest acceleration that one level asks of a joint [rad/s^2], as `DemandLimit` has
            it; `math.inf` for no bound.
        torque_step: largest change of a torque from tick to tick [N m], one number or one a joint;
            a tenth of the torque limits when None, `math.inf` for no bound.

    Raises:
        PoiseError: a name that the robot does not have, no task, or a setting that cannot be right.
    """

    def __init__(
        self,
        robot: Robot,
        stack: Stack | None = None,
        *,
        rank: RankTreatment | None = None,
        demand: float = 50.0,
        torque_step: Numbers | None = None,
    ) -> None:
        super().__init__(robot, stack)
        rank = checked_kind(rank or RankTreatment(), RankTreatment, "rank of the controller")
        limit = None
        if demand != math.inf:
            limit = DemandLimit(acceleration=demand, base=robot.base_dofs)
        self._recursion = OperationalRecursion(robot.nv, rank, limit)
        self._scales = RowScales(robot)
        self._wrenches: dict[str, Float64[np.ndarray, " c"]] = {}
        self._set_stack(self.stack)
        self._torque_step = TorqueStep(robot, torque_step)
        self._fallback = Fallback(robot, self.stack.torque_limit)

    @property
    def suspended(self) -> tuple[Task, ...]:
        """Tasks that a contact stands in for at the last tick."""
        return self._current[0].suspended

    @property
    def size(self) -> tuple[int, int]:
        """Number of variables, accelerations and wrenches, and of rows."""
        formulation = self._current[0]
        rows = self.robot.nv + len(formulation.rows.reference)
        return self.robot.nv + formulation.contact_dim, rows

    @property
    def forces(self) -> ContactForces:
        """Wrenches of the last tick, and how well they keep to cones and limits."""
        return self._current[1]

    def set_levels(self, levels: Sequence[Sequence[Task]]) -> None:
        """Replaces the tasks while running: on, off, or in another order.

        Tasks that were there before keep their targets. Torques move to what the new tasks ask
        for by `torque_step` a tick.

        Args:
            levels: lists of tasks, most important first.

        Raises:
            ConfigurationError: no task, an empty level, or a name used twice.
            UnknownNameError: a frame or joint that the robot does not have.
        """
        old = self.stack
        stack = Stack(
            old.contacts, levels, torque_limit=old.torque_limit, joint_limit=old.joint_limit
        )
        before = {task for _, task in old.tasks()}
        self._set_stack(stack)
        for _, task in stack.tasks():
            if task not in before:
                # It holds what the robot does now, not what it did when it was last switched on.
                task.reset()

    def set_wrench(self, contact: str, wrench: Numbers | None) -> None:
        """Sets the wrench that a contact's share of the internal forces should come near.

        Wrenches must carry the robot first; of all that do, the nearest to what was set is taken.
        It moves nothing: it presses contacts against each other, or shifts load between them.

        Args:
            contact: name of a contact of the stack.
            wrench: [force; moment] on the robot, along the contact's axes at its centre
                [N, N m]; None for as little as possible.

        Raises:
            ConfigurationError: no such contact.
            TargetError: wrong shape, NaN or infinite.
        """
        size = self.stack.contact(contact).dim
        what = f"wrench of contact {contact!r} [N, N m]"
        self._wrenches[contact] = (
            np.zeros(size) if wrench is None else checked_target(wrench, size, what)
        )
        for _, forces in self._prepared.values():
            forces.set_references(self._wrenches)

    def reset(self) -> None:
        """Forgets the last command and targets taken from the robot.

        Contacts stay as loaded as they are.
        """
        super().reset()
        self._fallback = Fallback(self.robot, self.stack.torque_limit)
        self._torque_step.reset()

    def _set_stack(self, stack: Stack) -> None:
        if not stack.levels:
            raise ConfigurationError(
                "the operational space formulation has nothing to do",
                got=[],
                wanted="at least one level with a task",
            )
        stack.bind(self.robot)
        self._scales.learn(stack)
        self.stack = stack
        self._prepared: dict[tuple[Contact, ...], tuple[OperationalFormulation, ContactForces]] = {}
        self._current = self._prepare(self._active_contacts())
        self._missing = np.zeros(len(self._current[0].rows.reference))
        self._held = np.zeros(self.robot.nj, dtype=np.bool_)
        self._bounds, self._bound_error = np.zeros(self.robot.nj), 0.0

    def _active_contacts(self) -> tuple[Contact, ...]:
        return tuple(c for c in self.stack.contacts if c.active)

    def _prepare(
        self, contacts: tuple[Contact, ...]
    ) -> tuple[OperationalFormulation, ContactForces]:
        # Kept per set of contacts: switching back to one allocates nothing.
        pair = self._prepared.get(contacts)
        if pair is None:
            pair = (
                OperationalFormulation(self.robot, self.stack, contacts, self._scales),
                ContactForces(self.robot, self.stack, contacts),
            )
            pair[1].set_references(self._wrenches)
            self._prepared[contacts] = pair
        return pair

    def _switch(self) -> tuple[Task, ...]:
        current = self._prepare(self._active_contacts())
        if current is self._current:
            return ()
        self._current = current
        return current[0].suspended

    def _assemble(self) -> None:
        self._current[0].fill(self.dynamics)
        self.stack.joint_limit.evaluate(self.dynamics)

    def _solve(self) -> Float64[np.ndarray, " nv"]:
        formulation, forces = self._current
        jacobian = formulation.rows.jacobian[: formulation.contact_dim]
        acceleration = self._resolve(formulation.rows)
        if not forces.solve(acceleration, self.dynamics, jacobian):
            acceleration = shed(
                self._recursion.steps(), lambda a: forces.solve(a, self.dynamics, jacobian)
            )
        return acceleration

    def _resolve(self, rows: LevelRows) -> Float64[np.ndarray, " nv"]:
        """Accelerations of all levels, with joints held that would leave their limits."""
        limit, base = self.stack.joint_limit, self.robot.base_dofs
        acceleration = self._recursion.resolve(rows, self.dynamics)
        self._held = np.zeros(self.robot.nj, dtype=np.bool_)
        for _ in range(_LIMIT_ROUNDS):
            joints = acceleration[base:]
            outside = (joints < limit.lower - _SLACK) | (joints > limit.upper + _SLACK)
            outside &= ~self._held
            if not outside.any():
                break
            target = np.clip(joints, limit.lower, limit.upper)
            self._bounds = np.where(self._held, self._bounds, target)
            self._held |= outside
            index = np.flatnonzero(self._held)
            acceleration = self._recursion.resolve(
                rows.with_joints(
                    index + base, self._bounds[index], self._scales.joints[index + base]
                ),
                self.dynamics,
            )
        return acceleration

    def _command(self, answer: Float64[np.ndarray, " nv"], state: RobotState) -> Command:
        formulation, forces = self._current
        if not np.isfinite(np.add.reduce(forces.torque)):
            return self._safe(CommandStatus.SOLVER_FAILED, state)
        limit = self.stack.torque_limit
        torque, _ = self._torque_step.limited(np.clip(forces.torque, limit.lower, limit.upper))
        self._fallback.remember(torque, state.time)
        return Command(
            status=CommandStatus.OK,
            torque=torque.copy(),
            acceleration=answer,
            wrenches={
                c.name: forces.wrench[rows]
                for c, rows in zip(forces.contacts, forces.slices, strict=True)
            },
            residuals=self._measure(formulation, forces, answer),
        )

    def _measure(
        self,
        formulation: OperationalFormulation,
        forces: ContactForces,
        acceleration: Float64[np.ndarray, " nv"],
    ) -> tuple[float, ...]:
        rows = formulation.rows
        target = rows.reference - rows.drift
        limit, joints = self.stack.joint_limit, acceleration[self.robot.base_dofs :]
        outside = np.maximum(joints - limit.upper, limit.lower - joints)
        self._bound_error = max(float(outside.max()), 0.0) / limit.acceleration_max
        self._missing = rows.jacobian @ acceleration
        self._missing -= target
        physics = slice(0, formulation.contact_dim)
        levels = [_relative(self._missing[s], target[s]) for s in rows.slices[1:]]
        contact = _relative(self._missing[physics], target[physics])
        return (
            max(forces.base_error, forces.torque_error),
            max(contact, forces.cone_error, self._bound_error),
            *levels,
        )

    def _safe(self, status: CommandStatus, state: object) -> Command:
        v, time = (state.v, state.time) if isinstance(state, RobotState) else (None, None)
        torque = self._fallback.torque(v, time)
        self._torque_step.remember(torque)
        return Command(status=status, torque=torque)

    def _task_residuals(self) -> dict[str, float]:
        return {
            task.name: float(np.linalg.norm(self._missing[rows]))
            for task, rows in self._current[0].task_rows
        }

    def _explain(self) -> str:
        forces, notes = self._current[1], list[str]()
        names = [self.robot.joint_names[i] for i in np.flatnonzero(self._held)]
        if names:
            notes.append("held at their limits: " + ", ".join(names))
        for error, what in (
            (forces.base_error, "base dynamics miss {:.2g} of the weight"),
            (forces.cone_error, "contacts are asked for {:.2g} of the weight outside their cones"),
            (forces.torque_error, "a torque limit is exceeded by {:.2g} of itself"),
            (self._bound_error, "joints leave their acceleration bounds by {:.2g} of the largest"),
        ):
            if error > TOLERANCE:
                notes.append(what.format(error))
        return "; ".join(notes) or "contacts and limits hold"


def _relative(missing: Float64[np.ndarray, " m"], target: Float64[np.ndarray, " m"]) -> float:
    return math.sqrt(missing.dot(missing)) / max(1.0, math.sqrt(target.dot(target)))
