"""`ReducedResolver`: LQP 1, then the unconstrained chain, then both chains' torques."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from poise.contacts.contact import Contact
from poise.control.formulation import PHYSICS_LEVELS, FullFormulation
from poise.control.reduced.assignment import assign
from poise.control.reduced.constraint_chain import ConstraintChainProblem
from poise.control.reduced.elimination import ChainElimination
from poise.control.reduced.unconstrained_chain import UnconstrainedChainProblem
from poise.control.stack import Stack
from poise.dynamics import Dynamics, Partition, ReducedDynamics
from poise.hqp import Solution, Solver
from poise.robots.robot import Robot
from poise.tasks import FrameTask, Task

_TOLERANCE = 1e-8
"""Relative residual above which LQP 2 does not keep to the centroids, or to its limits."""

_SLOP = 1e-9
"""Excess of an acceleration bound that is rounding, as a solver's own [rad/s^2]."""


class ReducedAnswer(NamedTuple):
    """What the two problems say together.

    Attributes:
        acceleration: generalized acceleration.
        torque: joint torques [N m]; finite and within limits only as far as the solutions are.
        wrenches: wrench at each active contact, by the contact's name [N, N m].
        first: solution of LQP 1.
        second: solution of LQP 2; None where it was not needed.
        whole: solution of the whole problem; None where it was not needed.
    """

    acceleration: Float64[np.ndarray, " nv"]
    torque: Float64[np.ndarray, " nj"]
    wrenches: dict[str, Float64[np.ndarray, " m"]]
    first: Solution
    second: Solution | None = None
    whole: Solution | None = None


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
            t for _, t in stack.tasks() if isinstance(t, FrameTask) and _is_held(t, contacts)
        )
        self._assignments = [
            [assign(t, robot, partition) for t in level if t not in self.suspended]
            for level in stack.levels
        ]
        self._tasks = [a.task for level in self._assignments for a in level]
        self._joints_u = partition.u.index - robot.base_dofs
        self.reduced = ReducedDynamics(robot, partition)
        self.chain = ChainElimination(self.reduced, self._assignments)
        # One for each shape: it changes only where tasks of the unconstrained chain lose rank.
        self._firsts: dict[tuple[int, ...], tuple[ConstraintChainProblem, Solver]] = {}
        self.first: ConstraintChainProblem | None = None
        self.second: UnconstrainedChainProblem | None = None
        if partition.nu:
            self.second = UnconstrainedChainProblem(robot, stack, self._assignments, self.reduced)
            self._second_solver = make_solver()
            self._whole = FullFormulation(robot, stack, contacts)
            self._whole_solver = make_solver()

    def resolve(self, dynamics: Dynamics) -> ReducedAnswer:
        """Solves one state; nothing raises on numbers.

        Args:
            dynamics: the state, up to date.
        """
        reduced, base = self.reduced, self._robot.base_dofs
        part = reduced.partition
        reduced.update(dynamics)
        self._stack.joint_limit.evaluate(dynamics)
        for task in self._tasks:
            task.evaluate(dynamics)
        self.chain.update()
        problem, solver = self._first_for(self.chain.shape)
        self.first = problem
        problem.fill(dynamics, self.chain)
        first = solver.solve(problem.problem)
        x = problem.acceleration(first.x)
        torque_a, wrenches = problem.torque(first.x), problem.wrenches(first.x)
        if self.second is None:
            return ReducedAnswer(x, torque_a[base:], wrenches, first)
        dv_a, dv_u, second = x[: part.na], self.chain.recover(x), None
        torque_u = reduced.torques_u(dv_a, dv_u)
        if first.ok and not self._is_within_limits(dv_u, torque_u):
            self.second.fill(x[: part.nr])
            second = self._second_solver.solve(self.second.problem)
            if not second.ok or max(second.relative_residuals[:PHYSICS_LEVELS]) > _TOLERANCE:
                return self._solve_whole(dynamics, first, second)
            dv_u = second.x
            torque_u = reduced.torques_u(dv_a, dv_u)
        dv, torque = part.merge(dv_a, dv_u), part.merge(torque_a, torque_u)[base:]
        return ReducedAnswer(dv, torque, wrenches, first, second)

    def _solve_whole(self, dynamics: Dynamics, first: Solution, second: Solution) -> ReducedAnswer:
        formulation = self._whole
        formulation.fill(dynamics)
        whole = self._whole_solver.solve(formulation.problem)
        return ReducedAnswer(
            formulation.acceleration(whole.x),
            formulation.torque(whole.x, dynamics),
            formulation.wrenches(whole.x),
            first,
            second,
            whole,
        )

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


def _is_held(task: FrameTask, contacts: Sequence[Contact]) -> bool:
    # A point contact decides where its frame is, but not how it is turned.
    return any(c.frame == task.frame and not (task.turns and c.dim < 6) for c in contacts)
