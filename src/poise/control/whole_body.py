"""`WholeBodyController`: strictly prioritised torque control over the full dynamics."""

from math import isfinite
from time import perf_counter

import numpy as np

from poise.checks import checked_kind, checked_number
from poise.contacts.contact import Contact
from poise.control.command import Command, CommandStatus
from poise.control.fallback import Fallback
from poise.control.formulation import PHYSICS_LEVELS, FullFormulation
from poise.control.stack import Stack, default_stack
from poise.control.state_check import is_usable
from poise.control.status import ControllerStatus, task_statuses
from poise.dynamics.dynamics import Dynamics
from poise.dynamics.state import RobotState
from poise.hqp import Solution, Solver, SolveStatus, make_solver
from poise.robots.robot import Robot
from poise.tasks import Task

_PHYSICS_TOLERANCE = 1e-6
"""Relative residual of dynamics and torque limits above which torques cannot be trusted."""

_USABLE = (SolveStatus.OPTIMAL, SolveStatus.INACCURATE)
"""A point cut short by the time cap is not: it may meet the dynamics and know no contact yet."""


class WholeBodyController:
    """Tasks in strict priority in, joint torques out: the conventional formulation.

    Variables are accelerations and contact wrenches, torques follow from the actuated rows; see
    `FullFormulation` for the rows and Ahn et al. 2024, section 2 and Table 1, for their source.

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
        self.robot = checked_kind(robot, Robot, "the controller's robot")
        stack = default_stack(robot) if stack is None else stack
        self.stack = checked_kind(stack, Stack, "the controller's stack")
        self.stack.bind(robot)
        self.dynamics = Dynamics(robot)
        self.timings: dict[str, float] = {}
        self._solver_settings = (strategy, backend, time_limit)
        self._formulations: dict[tuple[Contact, ...], tuple[FullFormulation, Solver]] = {}
        self._fallback = Fallback(robot, self.stack.torque_limit)
        self._solution: Solution | None = None
        self._formulation: FullFormulation | None = None
        self._last_status = CommandStatus.OK
        # Made now, so that a wrong strategy is refused before the first tick.
        self._formulation_for(self._active_contacts())

    @property
    def solution(self) -> Solution | None:
        """Solution of the last tick that was solved."""
        return self._solution

    @property
    def formulation(self) -> FullFormulation | None:
        """Rows of the last tick that was solved."""
        return self._formulation

    @property
    def suspended(self) -> tuple[Task, ...]:
        """Tasks that a contact stood in for at the last tick that was solved."""
        return () if self._formulation is None else self._formulation.suspended

    @property
    def size(self) -> tuple[int, int]:
        """Number of variables and of rows, finite bounds on single variables among them."""
        if self._formulation is None:
            return 0, 0
        problem = self._formulation.problem
        bounded = np.isfinite(problem.x_lower) | np.isfinite(problem.x_upper)
        return problem.n, problem.m + int(bounded.sum())

    def step(self, state: RobotState) -> Command:
        """One tick: from state to torques.

        Args:
            state: the robot's state.

        Returns:
            Torques with the status that says how they came about.
        """
        if not is_usable(state, self.robot):
            return self._safe(CommandStatus.BAD_STATE, state)
        begin = perf_counter()
        self.dynamics.update(state)
        for contact in self.stack.contacts:
            contact.advance(state.time)
        formulation, solver = self._formulation_for(self._active_contacts())
        if formulation is not self._formulation:
            # A foot that landed holds its place when it is free again, not where it once was.
            for task in formulation.suspended:
                task.reset()
        after_dynamics = perf_counter()
        formulation.fill(self.dynamics)
        after_assembly = perf_counter()
        solution = solver.solve(formulation.problem)
        after_solve = perf_counter()
        self._formulation, self._solution = formulation, solution
        command = self._command(formulation, solution, state)
        self.timings = {
            "dynamics": after_dynamics - begin,
            "assembly": after_assembly - after_dynamics,
            "solve": after_solve - after_assembly,
            "command": perf_counter() - after_solve,
        }
        return command

    def reset(self) -> None:
        """Forgets the last command, the last solution and targets taken from the robot.

        Contacts stay as loaded as they are.
        """
        self._fallback = Fallback(self.robot, self.stack.torque_limit)
        self._solution, self._formulation = None, None
        for _, solver in self._formulations.values():
            solver.reset()
        for _, task in self.stack.tasks():
            task.reset()

    def status(self) -> ControllerStatus:
        """How each task stood at the last tick: level, error with unit, residual."""
        residuals: dict[str, float] = {}
        suspended: tuple[Task, ...] = ()
        explanation = "nothing solved yet"
        if self._solution is not None and self._formulation is not None:
            problem, suspended = self._formulation.problem, self._formulation.suspended
            slacks = self._solution.slacks[problem.n :]
            for i, tasks in enumerate(self.stack.levels):
                row = problem.level(PHYSICS_LEVELS + i).slice.start
                for task in tasks:
                    part = slacks[row : row + task.dim]
                    residuals[task.name] = float(np.linalg.norm(part))
                    row += task.dim
            explanation = self._solution.explain(problem)
        return ControllerStatus(
            command=self._last_status,
            tasks=task_statuses(self.stack, residuals, suspended),
            explanation=explanation,
        )

    def _active_contacts(self) -> tuple[Contact, ...]:
        return tuple([c for c in self.stack.contacts if c.active])

    def _formulation_for(self, contacts: tuple[Contact, ...]) -> tuple[FullFormulation, Solver]:
        # Kept per set of contacts: switching back to one allocates nothing.
        pair = self._formulations.get(contacts)
        if pair is None:
            strategy, backend, time_limit = self._solver_settings
            solver = make_solver(strategy, backend, time_limit=time_limit)
            pair = (FullFormulation(self.robot, self.stack, contacts), solver)
            self._formulations[contacts] = pair
        return pair

    def _command(
        self, formulation: FullFormulation, solution: Solution, state: RobotState
    ) -> Command:
        torque = formulation.torque(solution.x, self.dynamics)
        physics_ok = solution.relative_residuals[0] <= _PHYSICS_TOLERANCE
        if solution.status not in _USABLE or not physics_ok or not isfinite(np.add.reduce(torque)):
            late = solution.status is SolveStatus.TIME_LIMIT
            return self._safe(
                CommandStatus.TIME_LIMIT if late else CommandStatus.SOLVER_FAILED, state
            )
        limit = self.stack.torque_limit
        np.maximum(torque, limit.lower, out=torque)
        np.minimum(torque, limit.upper, out=torque)
        self._fallback.remember(torque, state.time)
        self._last_status = CommandStatus.OK
        return Command(
            status=CommandStatus.OK,
            torque=torque,
            acceleration=formulation.acceleration(solution.x),
            wrenches=formulation.wrenches(solution.x),
            residuals=tuple(solution.relative_residuals.tolist()),
        )

    def _safe(self, status: CommandStatus, state: object) -> Command:
        self._last_status = status
        v, time = (state.v, state.time) if isinstance(state, RobotState) else (None, None)
        return Command(status=status, torque=self._fallback.torque(v, time))
