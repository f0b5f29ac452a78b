"""`TorqueController`: what controllers of torques by quadratic programs have in common."""

from abc import abstractmethod
from itertools import chain, combinations
from math import isfinite
from typing import Generic, TypeVar

import numpy as np

from poise._checks import checked_number
from poise.control._command import Command, CommandStatus
from poise.control._fallback import Fallback
from poise.control._resolver import Answer, Resolver
from poise.control._ticking import TickingController
from poise.dynamics import RobotState
from poise.hqp import Solver, SolveStatus, make_solver
from poise.robots import Robot
from poise.stack import Contact, Stack, Task

_PHYSICS_TOLERANCE = 1e-6
"""Relative residual of dynamics and torque limits above which torques cannot be trusted."""

_USABLE = (SolveStatus.OPTIMAL, SolveStatus.INACCURATE)
"""A point cut short by the time cap is not: it may meet the dynamics and know no contact yet."""

_PREPARED_CONTACTS = 3
"""Stacks of up to so many contacts have all their sets prepared before the first tick."""

R = TypeVar("R", bound=Resolver)


class TorqueController(TickingController[Answer], Generic[R]):
    """Tasks in strict priority in, joint torques out; a subclass says how rows are resolved.

    `step` never raises. On a solver failure, a state that is not finite, or a solve cut short by
    the time cap it returns the last good torque decayed towards damping, and says so in the
    command's status.

    Args:
        robot: the robot.
        stack: contacts, limits and tasks; `default_stack(robot)` when None.
        strategy: how the hierarchy is solved: "direct", "cascade" or "weighted".
        backend: QP solver of the cascade and weighted strategies.
        time_limit: cap of one solve [s]; none when None.

    Raises:
        PoiseError: a name that the robot does not have, or a setting that cannot be right.
    """

    def __init__(
        self,
        robot: Robot,
        stack: Stack | None = None,
        *,
        strategy: str = "direct",
        backend: str | None = None,
        time_limit: float | None = None,
    ) -> None:
        if time_limit is not None:
            checked_number(time_limit, "time_limit of the controller [s]", above=0.0)
        super().__init__(robot, stack)
        self._solver_settings = (strategy, backend, time_limit)
        self._fallback = Fallback(robot, self.stack.torque_limit)
        self._resolvers: dict[tuple[Contact, ...], R] = {}
        self._last: R | None = None
        # Made now, so that what is wrong is refused before the first tick.
        for contacts in self._contact_sets():
            self._resolver_for(contacts)
        self._current = self._resolver_for(self._active_contacts())
        # What is compiled is compiled now.
        self.stack.joint_limit.evaluate(self.dynamics)

    @property
    def suspended(self) -> tuple[Task, ...]:
        """Tasks that a contact stood in for at the last tick that was solved."""
        return () if self._last is None else self._last.suspended

    @property
    def size(self) -> tuple[int, int]:
        """Number of variables and of rows, finite bounds on single variables among them."""
        return (0, 0) if self._last is None else self._last.size

    def reset(self) -> None:
        """Forgets the last command, the last solution and targets taken from the robot.

        Contacts stay as loaded as they are.
        """
        super().reset()
        self._fallback = Fallback(self.robot, self.stack.torque_limit)
        self._last = None
        for resolver in self._resolvers.values():
            resolver.reset()

    @abstractmethod
    def _make_resolver(self, contacts: tuple[Contact, ...]) -> R:
        """The resolver for one set of active contacts."""

    def _make_solver(self) -> Solver:
        """A solver with a workspace of its own."""
        strategy, backend, time_limit = self._solver_settings
        return make_solver(strategy, backend, time_limit=time_limit)

    def _active_contacts(self) -> tuple[Contact, ...]:
        return tuple([c for c in self.stack.contacts if c.active])

    def _contact_sets(self) -> set[tuple[Contact, ...]]:
        """Those that are prepared: the active contacts, and where they are few all their sets."""
        contacts = self.stack.contacts
        sets = {self._active_contacts()}
        if len(contacts) <= _PREPARED_CONTACTS:
            sizes = range(len(contacts) + 1)
            sets.update(chain.from_iterable(combinations(contacts, k) for k in sizes))
        return sets

    def _resolver_for(self, contacts: tuple[Contact, ...]) -> R:
        # Kept per set of contacts: switching back to one allocates nothing.
        resolver = self._resolvers.get(contacts)
        if resolver is None:
            resolver = self._resolvers[contacts] = self._make_resolver(contacts)
        return resolver

    def _switch(self) -> tuple[Task, ...]:
        self._current = self._resolver_for(self._active_contacts())
        return () if self._current is self._last else self._current.suspended

    def _assemble(self) -> None:
        self._current.assemble(self.dynamics)

    def _solve(self) -> Answer:
        answer = self._current.solve()
        self._last = self._current
        return answer

    def _command(self, answer: Answer, state: RobotState) -> Command:
        torque = answer.torque
        physics_ok = answer.residuals[0] <= _PHYSICS_TOLERANCE
        if answer.status not in _USABLE or not physics_ok or not isfinite(np.add.reduce(torque)):
            late = answer.status is SolveStatus.TIME_LIMIT
            return self._safe(
                CommandStatus.TIME_LIMIT if late else CommandStatus.SOLVER_FAILED, state
            )
        limit = self.stack.torque_limit
        np.maximum(torque, limit.lower, out=torque)
        np.minimum(torque, limit.upper, out=torque)
        self._fallback.remember(torque, state.time)
        return Command(
            status=CommandStatus.OK,
            torque=torque,
            acceleration=answer.acceleration,
            wrenches=answer.wrenches,
            residuals=answer.residuals,
        )

    def _safe(self, status: CommandStatus, state: object) -> Command:
        v, time = (state.v, state.time) if isinstance(state, RobotState) else (None, None)
        return Command(status=status, torque=self._fallback.torque(v, time))

    def _task_residuals(self) -> dict[str, float]:
        return {} if self._last is None else self._last.task_residuals()

    def _explain(self) -> str:
        return "nothing solved yet" if self._last is None else self._last.explain()
