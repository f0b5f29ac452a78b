"""`ReducedResolver`: LQP 1, then the unconstrained chain, then both chains' torques."""

from collections.abc import Callable, Sequence
from math import sqrt

import numpy as np
from jaxtyping import Float64

from poise.contacts.contact import Contact
from poise.control.formulation import FullFormulation
from poise.control.held import is_held
from poise.control.reduced.assignment import assign
from poise.control.reduced.constraint_chain import ConstraintChainProblem
from poise.control.reduced.elimination import ChainElimination
from poise.control.reduced.unconstrained_chain import UnconstrainedChainProblem
from poise.control.resolver import PHYSICS_LEVELS, Answer
from poise.control.stack import Stack
from poise.control.whole_body import WholeResolver
from poise.dynamics import Dynamics, Partition, ReducedDynamics
from poise.hqp import Solution, Solver
from poise.robots.robot import Robot
from poise.tasks import Task

_TOLERANCE = 1e-8
"""Relative residual above which LQP 2 does not keep to the centroids, or to its limits."""

_SLOP = 1e-9
"""Excess of an acceleration bound that is rounding, as a solver's own [rad/s^2]."""


class ReducedResolver:
    """Section 4.2 of Ahn et al. 2024 with exact dynamics, for one set of active contacts.

    LQP 1 decides contacts, balance, the constraint chain and the centroids; it knows what tasks of
    the unconstrained chain ask of them (`ChainElimination`), so that the order of the levels is
    that of the stack whichever chain their tasks are in. The unconstrained chain's joints then
    follow in closed form. That is the solution of the whole problem, unless those joints exceed
    their limits, which LQP 1 does not know. Then LQP 2 decides them within their limits, under what
    LQP 1 decided. And where they cannot move so, because the centroids of LQP 1 take more torque or
    acceleration than they have, what LQP 1 decided is worth nothing, and the whole problem is
    solved after all, `FullFormulation`.

    Args:
        robot: the robot.
        stack: contacts, limits and tasks, bound to the robot.
        contacts: those contacts of the stack that are active.
        partition: the chains for these contacts.
        make_solver: makes a solver with a workspace of its own.

    Attributes:
        reduced: the reduced dynamics.
        chain: the unconstrained chain, eliminated.
        first: LQP 1 of the last state, None before.
        second: LQP 2; None without an unconstrained chain.
        suspended: frame tasks that a contact stands in for; they have no rows.

    Raises:
        ConfigurationError: a task that cannot be assigned to one of the two.
    """

    def __init__(
        self,
        robot: Robot,
        stack: Stack,
        contacts: Sequence[Contact],
        partition: Partition,
        make_solver: Callable[[], Solver],
    ) -> None:
        self._robot, self._stack, self._contacts = robot, stack, tuple(contacts)
        self._make_solver = make_solver
        self.suspended: tuple[Task, ...] = tuple(
            t for _, t in stack.tasks() if is_held(t, contacts)
        )
        self._assignments = [
            [assign(t, robot, partition) for t in level if t not in self.suspended]
            for level in stack.levels
        ]
        self._levels = [[a.task for a in level] for level in self._assignments]
        self._tasks = [task for level in self._levels for task in level]
        self._joints_u = partition.u.index - robot.base_dofs
        self.reduced = ReducedDynamics(robot, partition)
        self.chain = ChainElimination(self.reduced, self._assignments)
        # One for each shape: it changes only where tasks of the unconstrained chain lose rank.
        self._firsts: dict[tuple[int, ...], tuple[ConstraintChainProblem, Solver]] = {}
        self.first: ConstraintChainProblem | None = None
        self.second: UnconstrainedChainProblem | None = None
        self.first_solution: Solution | None = None
        self.second_solution: Solution | None = None
        self.whole: WholeResolver | None = None
        self._acceleration = np.zeros(robot.nv)
        if partition.nu:
            self.second = UnconstrainedChainProblem(robot, stack, self._assignments, self.reduced)
            self._second_solver = make_solver()

    @property
    def size(self) -> tuple[int, int]:
        """Variables and rows of LQP 1, and of LQP 2 where the last state needed it."""
        n, m = (0, 0) if self.first is None else self.first.problem.size
        if self.second is not None and self.second_solution is not None:
            n2, m2 = self.second.problem.size
            n, m = n + n2, m + m2
        return n, m

    def assemble(self, dynamics: Dynamics) -> None:
        """Writes one state's rows: the reduced dynamics, the eliminated chain, LQP 1.

        Args:
            dynamics: the state, up to date.
        """
        self._dynamics = dynamics
        self.reduced.update(dynamics)
        self._stack.joint_limit.evaluate(dynamics)
        for task in self._tasks:
            task.evaluate(dynamics)
        self.chain.update()
        self.first, self._first_solver = self._first_for(self.chain.shape)
        self.first.fill(dynamics, self.chain)

    def solve(self) -> Answer:
        """Solves what was assembled; nothing raises on numbers."""
        reduced, base, problem = self.reduced, self._robot.base_dofs, self.first
        part = reduced.partition
        self.second_solution, self._solved_whole = None, False
        self.first_solution = first = self._first_solver.solve(problem.problem)
        x = problem.acceleration(first.x)
        torque_a, wrenches = problem.torque(first.x), problem.wrenches(first.x)
        if self.second is None:
            return self._answer(x, torque_a[base:], wrenches)
        dv_a, dv_u = x[: part.na], self.chain.recover(x)
        torque_u = reduced.torques_u(dv_a, dv_u)
        if first.ok and not self._is_within_limits(dv_u, torque_u):
            self.second.fill(x[: part.nr])
            self.second_solution = second = self._second_solver.solve(self.second.problem)
            if not second.ok or max(second.relative_residuals[:PHYSICS_LEVELS]) > _TOLERANCE:
                return self._solve_whole()
            dv_u = second.x
            torque_u = reduced.torques_u(dv_a, dv_u)
        dv, torque = part.merge(dv_a, dv_u), part.merge(torque_a, torque_u)[base:]
        return self._answer(dv, torque, wrenches)

    def reset(self) -> None:
        """Forgets the last solutions."""
        for _, solver in self._firsts.values():
            solver.reset()
        if self.second is not None:
            self._second_solver.reset()
        if self.whole is not None:
            self.whole.reset()
        self.first_solution = self.second_solution = None

    def task_residuals(self) -> dict[str, float]:
        """Norm of what each task could not meet at the last solve [unit/s^2]."""
        return {
            task.name: float(np.linalg.norm(self._missing(task)))
            for level in self._levels
            for task in level
        }

    def explain(self) -> str:
        """Which rows conflict and with what, in words."""
        if self.whole is not None and self._solved_whole:
            return self.whole.explain()
        if self.first is None or self.first_solution is None:
            return "nothing solved yet"
        words = [self.first_solution.explain(self.first.problem)]
        if self.second is not None and self.second_solution is not None:
            words.append(self.second_solution.explain(self.second.problem))
        return "; ".join(words)

    def _missing(self, task: Task) -> Float64[np.ndarray, " m"]:
        missing = task.jacobian.dot(self._acceleration)
        missing += task.drift
        missing -= task.reference
        return missing

    def _answer(
        self,
        dv: Float64[np.ndarray, " nv"],
        torque: Float64[np.ndarray, " nj"],
        wrenches: dict[str, Float64[np.ndarray, " m"]],
    ) -> Answer:
        self._acceleration = dv
        first, second = self.first_solution, self.second_solution
        physics = first.relative_residuals[:PHYSICS_LEVELS]
        if second is not None:
            physics = np.maximum(physics, second.relative_residuals[:PHYSICS_LEVELS])
        residuals = physics.tolist()
        for level in self._levels:
            missing = aimed = 0.0
            for task in level:
                one = task.weight * self._missing(task)
                other = task.weight * (task.reference - task.drift)
                missing, aimed = missing + one.dot(one), aimed + other.dot(other)
            residuals.append(sqrt(missing) / max(1.0, sqrt(aimed)))
        return Answer(first.status, dv, torque, wrenches, tuple(residuals))

    def _solve_whole(self) -> Answer:
        # Not made before it is needed, which may be never.
        if self.whole is None:
            self.whole = WholeResolver(
                FullFormulation(self._robot, self._stack, self._contacts), self._make_solver()
            )
        self._solved_whole = True
        self.whole.assemble(self._dynamics)
        answer = self.whole.solve()
        self._acceleration = answer.acceleration
        return answer

    @property
    def whole_solution(self) -> Solution | None:
        """Solution of the whole problem at the last state; None where it was not needed."""
        return self.whole.solution if self.whole is not None and self._solved_whole else None

    def _first_for(self, shape: tuple[int, ...]) -> tuple[ConstraintChainProblem, Solver]:
        pair = self._firsts.get(shape)
        if pair is None:
            problem = ConstraintChainProblem(
                self._robot, self._stack, self._contacts, self._assignments, self.reduced, shape
            )
            pair = self._firsts[shape] = (problem, self._make_solver())
        return pair

    def _is_within_limits(
        self, dv_u: Float64[np.ndarray, " nu"], torque_u: Float64[np.ndarray, " nu"]
    ) -> bool:
        torque, joint, u = self._stack.torque_limit, self._stack.joint_limit, self._joints_u
        return bool(
            (torque_u >= torque.lower[u]).all()
            and (torque_u <= torque.upper[u]).all()
            and (dv_u >= joint.lower[u] - _SLOP).all()
            and (dv_u <= joint.upper[u] + _SLOP).all()
        )
