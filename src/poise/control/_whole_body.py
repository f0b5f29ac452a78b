"""`WholeBodyController`: strictly prioritised torque control over the full dynamics."""

import numpy as np

from poise.control._formulation import FullFormulation
from poise.control._resolver import PHYSICS_LEVELS, Answer
from poise.control._torque_controller import TorqueController
from poise.dynamics import Dynamics
from poise.hqp import Solution, Solver
from poise.stack import Contact, Task


class WholeResolver:
    """One hierarchical problem over all accelerations and wrenches, with a solver of its own.

    Args:
        formulation: the rows.
        solver: solves them.

    Attributes:
        formulation: the rows.
        solution: of the last solve, None before.
    """

    def __init__(self, formulation: FullFormulation, solver: Solver) -> None:
        self.formulation, self._solver = formulation, solver
        self.solution: Solution | None = None

    @property
    def suspended(self) -> tuple[Task, ...]:
        """Tasks that a contact stands in for."""
        return self.formulation.suspended

    @property
    def size(self) -> tuple[int, int]:
        """Number of variables and of rows, finite bounds on single variables among them."""
        return self.formulation.problem.size

    def assemble(self, dynamics: Dynamics) -> None:
        """Writes one state's rows."""
        self._dynamics = dynamics
        self.formulation.fill(dynamics)

    def solve(self) -> Answer:
        """Solves what was assembled."""
        formulation = self.formulation
        self.solution = solution = self._solver.solve(formulation.problem)
        return Answer(
            solution.status,
            formulation.acceleration(solution.x),
            formulation.torque(solution.x, self._dynamics),
            formulation.wrenches(solution.x),
            tuple(solution.relative_residuals.tolist()),
        )

    def reset(self) -> None:
        """Forgets the last solution."""
        self.solution = None
        self._solver.reset()

    def task_residuals(self) -> dict[str, float]:
        """Norm of what each task could not meet at the last solve [unit/s^2]."""
        if self.solution is None:
            return {}
        problem, residuals = self.formulation.problem, dict[str, float]()
        slacks = self.solution.slacks[problem.n :]
        for i, tasks in enumerate(self.formulation.levels):
            row = problem.level(PHYSICS_LEVELS + i).slice.start
            for task in tasks:
                residuals[task.name] = float(np.linalg.norm(slacks[row : row + task.dim]))
                row += task.dim
        return residuals

    def explain(self) -> str:
        """Which rows conflict and with what, in words."""
        if self.solution is None:
            return "nothing solved yet"
        return self.solution.explain(self.formulation.problem)


class WholeBodyController(TorqueController[WholeResolver]):
    """Tasks in strict priority in, joint torques out: the conventional formulation.

    Variables are accelerations and contact wrenches, torques follow from the actuated rows; see
    `FullFormulation` for the rows and Ahn et al. 2024, section 2 and Table 1, for their source.
    What is common to all controllers by quadratic programs is said of `TorqueController`.
    """

    @property
    def solution(self) -> Solution | None:
        """Solution of the last tick that was solved."""
        return None if self._last is None else self._last.solution

    @property
    def formulation(self) -> FullFormulation | None:
        """Rows of the last tick that was solved."""
        return None if self._last is None else self._last.formulation

    def _make_resolver(self, contacts: tuple[Contact, ...]) -> WholeResolver:
        return WholeResolver(FullFormulation(self.robot, self.stack, contacts), self._make_solver())
