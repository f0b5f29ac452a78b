"""`ReducedController`: strictly prioritised torque control over the reduced robot.

`ReducedProgram`: LQP 1, then the unconstrained chain, then both chains' torques.
"""

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float64

from poise.control._controller import Controller
from poise.control._full_problem import FullProblem
from poise.control._reduced._assignment import AssignedRows
from poise.control._reduced._elimination import ChainElimination, announce
from poise.control._reduced._problems import ConstraintChainProblem, UnconstrainedChainProblem
from poise.control._strategy import (
    PHYSICS_LEVELS,
    UNSOFTENED,
    USABLE,
    Answer,
    Programs,
    bound_stack,
    solver_maker,
)
from poise.control._whole_body import FullProgram
from poise.dynamics import Dynamics, Partition, Partitions, ReducedDynamics
from poise.hqp import Solution, Solver
from poise.robots import Robot
from poise.stack import Contact, PostureTask, Stack, StackRows, Task

_TOLERANCE = 1e-8
"""Relative residual, or increase of one, above which LQP 2 is no solution."""

_MORE_ENERGY = 1e-3
"""Fraction of the acceleration energy by which LQP 2 may exceed that of LQP 1, which no solution is
below. Beyond, a chain may move much for a centroid that the whole problem would have chosen
elsewhere."""

PATIENCE = 20
"""Ticks for which the whole problem alone is solved after LQP 1 and LQP 2 failed: an arm at its
limit seldom leaves it within a tick, and three problems in one tick cost most."""


class ReducedProgram:
    """Section 4.2 of Ahn et al. 2024 with exact dynamics, for one set of active contacts.

    LQP 1 decides contacts, balance, the constraint chain and the centroids; it has the conditions
    of tasks in the unconstrained chain on them (`ChainElimination`), so that levels keep the order
    of the stack whichever chain their tasks are in. The unconstrained chain's joints then follow in
    closed form. That is the solution of the whole problem, unless those joints exceed their limits,
    which are not in LQP 1. Then LQP 2 finds another motion of the chain under that of LQP 1, within
    the limits. If it costs no level anything, and hardly more energy, it is the solution. If it
    does, if links would come too near each other, or if a level is softened (`SoftenedSolver`),
    `FullProblem`, the whole problem, is solved, then and for the next `PATIENCE` ticks.

    Attributes:
        chain: the unconstrained chain, eliminated.
        tasks: assignment of the stack's rows to the problems.
        second: LQP 2; None without an unconstrained chain.
        whole: the whole problem.
    """

    def __init__(
        self,
        robot: Robot,
        stack: Stack,
        contacts: Sequence[Contact],
        partition: Partition,
        make_solver: Callable[[], Solver],
    ) -> None:
        self._robot, self._stack, self._make_solver = robot, stack, make_solver
        self.rows = StackRows(robot, stack, contacts, balance="before", collisions="behind")
        self.tasks = AssignedRows(self.rows, robot, partition)
        self.reduced = ReducedDynamics(robot, partition)
        self.chain = ChainElimination(self.reduced, self.tasks)
        # One for each shape: it changes only where tasks of the unconstrained chain lose rank.
        self._firsts: dict[tuple[int, ...], tuple[ConstraintChainProblem, Solver]] = {}
        self.second: UnconstrainedChainProblem | None = None
        self._solved = self._used_second = False
        self.whole = FullProgram(FullProblem(robot, stack, contacts), make_solver)
        self._solved_whole, self._whole_ticks = False, 0
        self._current = self._prepare()
        if partition.nu:
            self.second = UnconstrainedChainProblem(robot, stack, self.tasks, self.reduced)
            self._second_solver = make_solver()
            self._second_solver.prepare(self.second.problem)
            # What is compiled is compiled now, not in the tick that needs it.
            self.second.fill(np.zeros(partition.nr))

    @property
    def suspended(self) -> tuple[Task, ...]:
        return self.rows.suspended

    @property
    def softened(self) -> dict[int, float]:
        return self.whole.softened if self._solved_whole else {}

    @property
    def first(self) -> ConstraintChainProblem:
        """LQP 1 of the last state."""
        return self._current[0]

    @property
    def first_solution(self) -> Solution | None:
        """Solution of LQP 1 at the last solve; None before, or where it was not solved."""
        return self._current[1].report() if self._solved else None

    @property
    def second_solution(self) -> Solution | None:
        """Solution of LQP 2; None where the last solve did not need it."""
        return self._second_solver.report() if self._used_second else None

    @property
    def size(self) -> tuple[int, int]:
        if self._solved_whole:
            return self.whole.size
        n, m = self.first.problem.size
        if self.second is not None and self._used_second:
            n2, m2 = self.second.problem.size
            n, m = n + n2, m + m2
        return n, m

    def follow(self, last: "ReducedProgram") -> None:
        problem, solver = self._current
        solver.follow(problem.problem, last._current[1])
        self.whole.follow(last.whole)

    def assemble(self, dynamics: Dynamics) -> None:
        """Write one state's rows: the reduced dynamics, the eliminated chain, LQP 1."""
        self._dynamics = dynamics
        self._solved_whole = self._whole_ticks > 0
        if self._solved_whole:
            self.whole.assemble(dynamics)
            return
        self.rows.update(dynamics)
        if not self.first.assemble(dynamics):
            self._current = self._first_for(self.chain.shape)
            self.first.fill()

    def solve(self) -> Answer:
        self._solved, self._used_second = not self._solved_whole, False
        if self._solved_whole:
            self._whole_ticks -= 1
            return self._answer_of_whole()
        problem, solver = self._current
        status = solver.run(problem.problem)
        x = solver.x.copy()
        joined = problem.follow(x)
        physics = solver.relative_residuals[:PHYSICS_LEVELS]
        levels = self.rows.measure(joined.acceleration)[1:].tolist()
        if self.second is not None and status in USABLE and not joined.within:
            if not status.ok:
                # A point that is no solution is no measure of the cost of LQP 2.
                return self._solve_whole()
            self.second.fill(x[: self.reduced.partition.nr])
            second, self._used_second = self._second_solver, True
            found = second.run(self.second.problem)
            free, joined = joined.acceleration, problem.join(x, second.x)
            costs = max(second.relative_residuals[:PHYSICS_LEVELS])
            bounded = self.rows.measure(joined.acceleration)[1:].tolist()
            costs = max([costs, *(b - f for f, b in zip(levels, bounded, strict=True))])
            energy = self._energy(joined.acceleration) / self._energy(free)
            if not (found.ok and costs <= _TOLERANCE and energy <= 1.0 + _MORE_ENERGY):
                return self._solve_whole()
            physics = np.maximum(physics, second.relative_residuals[:PHYSICS_LEVELS])
        if self.rows.excess(joined.acceleration, self.rows.collision_rows) > _TOLERANCE:
            return self._solve_whole()
        found = joined.acceleration, self._robot.base_dofs
        if self.rows.softening.find(self._dynamics.v, *found) > UNSOFTENED:
            return self._solve_whole()
        return Answer(
            status,
            joined.torque,
            (*physics.tolist(), *levels),
            joined.acceleration,
            problem.wrenches(x),
            self.rows.is_held(joined.acceleration),
        )

    def reset(self) -> None:
        for _, solver in self._firsts.values():
            solver.reset()
        if self.second is not None:
            self._second_solver.reset()
        self.whole.reset()
        self._solved = self._used_second = False
        self._whole_ticks = 0

    def task_residuals(self) -> dict[str, float]:
        if self._solved_whole:
            return self.whole.task_residuals()
        return self.rows.task_residuals()

    def explain(self) -> str:
        if self._solved_whole:
            return self.whole.explain()
        first, second = self.first_solution, self.second_solution
        if first is None:
            return "nothing solved yet"
        unnumbered = self.whole.full.unnumbered
        words = [first.explain(self.first.problem, unnumbered)]
        if self.second is not None and second is not None:
            words.append(second.explain(self.second.problem))
        return "; ".join(words)

    def _energy(self, dv: Float64[np.ndarray, " nv"]) -> float:
        """Return twice the acceleration energy (27), above zero."""
        return float(dv.dot(self._dynamics.M).dot(dv)) + 1e-300

    def _solve_whole(self) -> Answer:
        self._solved_whole, self._whole_ticks = True, PATIENCE
        self.whole.assemble(self._dynamics)
        return self._answer_of_whole()

    def _answer_of_whole(self) -> Answer:
        answer = self.whole.solve()
        if self.whole.softened:
            self._whole_ticks = PATIENCE
        return answer

    @property
    def whole_solution(self) -> Solution | None:
        """Solution of the whole problem at the last state; None where it was not needed."""
        return self.whole.solution if self._solved_whole else None

    def _prepare(self) -> tuple[ConstraintChainProblem, Solver]:
        """Make LQP 1 for the case that no task loses rank, before the first tick."""
        # Tasks are not evaluated: they might take the state for their target.
        constant = self.tasks.J.copy()
        self.tasks.J[:] = np.random.default_rng(0).normal(size=constant.shape)
        self.chain.update(Dynamics(self._robot))
        self.tasks.J[:] = constant
        pair = self._first_for(self.chain.shape)
        # What is compiled is compiled now, not in the tick that needs another shape.
        pair[0].fill()
        return pair

    def _first_for(self, shape: tuple[int, ...]) -> tuple[ConstraintChainProblem, Solver]:
        pair = self._firsts.get(shape)
        if pair is None:
            problem = ConstraintChainProblem(
                self._robot, self._stack, self.tasks, self.reduced.partition, self.chain
            )
            solver = self._make_solver()
            solver.prepare(problem.problem)
            pair = self._firsts[shape] = (problem, solver)
        return pair


class ReducedController(Controller):
    """Joint torques of tasks in strict priority, with contacts and balance on a small model.

    The formulation of Ahn et al. 2024, section 4, with exact dynamics, see `ReducedProgram`. It
    takes the same stacks as `WholeBodyController` and finds the same torques, in less time the more
    joints hang free.

    Args:
        robot: the robot.
        stack: contacts, limits and tasks; `default_stack(robot)` when None.
        strategy: of the hierarchies: "direct", "cascade" or "weighted".
        backend: QP solver of the cascade and weighted strategies.
        time_limit: cap of one solve [s], beyond which the command is the fallback's; none when
            None.
        dynamics: shared with the estimator of the state, see `Controller`; its own when None.

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
        dynamics: Dynamics | None = None,
    ) -> None:
        announce()
        stack = bound_stack(robot, stack)
        partitions, make_solver = Partitions(robot), solver_maker(strategy, backend, time_limit)

        def make(contacts: tuple[Contact, ...]) -> ReducedProgram:
            partition = partitions.of([c.frame for c in contacts])
            return ReducedProgram(robot, stack, contacts, partition, make_solver)

        self._programs = Programs(robot, stack, make)
        super().__init__(self._programs, dynamics=dynamics)
        _rehearse(robot, partitions, make_solver)

    @property
    def strategy(self) -> Programs[ReducedProgram]:
        """The two problems and their solutions, for each set of active contacts."""
        return self._programs


def _rehearse(robot: Robot, partitions: Partitions, make_solver: Callable[[], Solver]) -> None:
    """Run everything compiled once, before the first tick."""
    # Without contacts the free chain is as long as it can be.
    stack = Stack(levels=[[PostureTask()]])
    stack.bind(robot)
    program = ReducedProgram(robot, stack, (), partitions.of(()), make_solver)
    program.assemble(Dynamics(robot))
    program.solve()
