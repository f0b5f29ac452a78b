"""`WholeBodyController`: strictly prioritised torque control over the full dynamics."""

from collections.abc import Callable, Sequence

from poise._checks import checked_kind
from poise.control._batch import Batch
from poise.control._command import Commands
from poise.control._controller import Controller
from poise.control._full_problem import FullProblem, SoftenedFull
from poise.control._strategy import Answer, Programs, bound_stack, softening_notes, solver_maker
from poise.dynamics import Dynamics, RobotState
from poise.errors import ConfigurationError
from poise.hqp import Solution, Solver
from poise.robots import Robot
from poise.stack import Stack, Task


class FullProgram:
    """The full problem of one set of active contacts with a solver of its own; a `Program`."""

    def __init__(self, full: FullProblem, make_solver: Callable[[], Solver]) -> None:
        self.full, self._solved = full, False
        self._solver = SoftenedFull(full, make_solver)

    @property
    def solution(self) -> Solution | None:
        return self._solver.report() if self._solved else None

    @property
    def softened(self) -> dict[int, float]:
        if not self._solved:
            return {}
        return self.full.rows.softening.by_level(self._solver.softened)

    @property
    def suspended(self) -> tuple[Task, ...]:
        return self.full.rows.suspended

    @property
    def size(self) -> tuple[int, int]:
        return self.full.problem.size

    def follow(self, last: "FullProgram") -> None:
        self._solver.follow(last._solver)

    def assemble(self, dynamics: Dynamics) -> None:
        self._dynamics = dynamics
        self.full.fill(dynamics)

    def solve(self) -> Answer:
        full, solver = self.full, self._solver
        status = solver.run()
        self._solved = True
        x, torque, held_back = full.answer(solver.x, self._dynamics)
        residuals = solver.relative_residuals.tolist()
        for level in full.unnumbered:
            del residuals[level]
        acceleration, wrenches = x[: len(full.velocity)], full.wrenches(x)
        return Answer(status, torque, tuple(residuals), acceleration, wrenches, held_back)

    def reset(self) -> None:
        self._solved = False
        self._solver.reset()

    def task_residuals(self) -> dict[str, float]:
        solution = self.solution
        return {} if solution is None else self.full.task_residuals(solution.slacks)

    def explain(self) -> str:
        solution, full = self.solution, self.full
        if solution is None:
            return "nothing solved yet"
        words = solution.explain(full.problem, full.unnumbered)
        return "\n".join([words, *softening_notes(self.softened)])


class WholeBodyController(Controller):
    """Joint torques of tasks in strict priority: the conventional formulation.

    Variables are accelerations and contact wrenches, torques follow from the actuated rows; see
    `FullProblem` for the rows and Ahn et al. 2024, section 2 and Table 1, for their source.

    Args:
        robot: the robot.
        stack: contacts, limits and tasks; `default_stack(robot)` when None.
        strategy: of the hierarchy: "direct", "cascade" or "weighted".
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
        stack = bound_stack(robot, stack)
        self._strategy_name, self._batch = strategy, Batch(robot, stack)
        make_solver = solver_maker(strategy, backend, time_limit)
        self._programs = Programs(
            robot,
            stack,
            lambda contacts: FullProgram(FullProblem(robot, stack, contacts), make_solver),
        )
        super().__init__(self._programs, dynamics=dynamics)

    @property
    def strategy(self) -> Programs[FullProgram]:
        """The full problem and its solution, one for each set of active contacts."""
        return self._programs

    def solve_batch(
        self,
        states: Sequence[RobotState],
        *,
        threads: int | None = None,
        before_each: Callable[[int], None] | None = None,
    ) -> Commands:
        """Compute the command of `step` for each of many states, independent of their order.

        For data, planning by sampling, learning: one compiled loop over the states, on threads. All
        have the stack's targets, and the loads of its contacts at the first state's time; a task
        without a target holds the pose of each state, and no last command bounds the change of
        torques. `before_each` may set targets for one state. Answers are those of `step` to
        rounding, whatever the number of threads; each search begins with the active set of the same
        place in the last batch, if that was as long. The controller's own last command, solution
        and status do not change.

        Args:
            states: the states.
            threads: number of threads; that of the processors when None.
            before_each: called before a state is taken up, with its number; one call at a time.

        Returns:
            The commands. A state that is not usable, or has no answer, gets the fallback of a
            controller without a last command.

        Raises:
            ConfigurationError: the strategy is not "direct", or a number of threads below one.
        """
        if self._strategy_name != "direct":
            raise ConfigurationError(
                "many states at once are solved by one strategy alone",
                got=self._strategy_name,
                wanted='strategy="direct"',
            )
        if threads is not None and checked_kind(threads, int, "threads of a batch") < 1:
            raise ConfigurationError(
                "a batch needs threads", got=threads, wanted="a whole number >= 1, or None"
            )
        return self._batch.solve(states, threads, before_each)

    def reset(self) -> None:
        """Forget the last command, the last solutions and targets taken from the robot.

        Contacts keep their loads.
        """
        super().reset()
        self._batch.reset()
