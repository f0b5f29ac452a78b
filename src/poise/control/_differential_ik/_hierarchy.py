"""`VelocityHierarchy`: the same levels as a hierarchical QP with hard joint limits."""

import numpy as np
from jaxtyping import Float64

from poise.control._differential_ik._formulation import ROW_WEIGHT, VelocityFormulation
from poise.control._resolver import PHYSICS_LEVELS
from poise.hqp import HierarchicalProblem, Solution, make_solver


class VelocityHierarchy:
    """Levels over joint velocities, solved exactly within their bounds.

        level 1   bounds of the joint velocities
        level 2   contacts that are held stay where they are
        level 3.. the user's tasks
        cost      |u|^2

    Args:
        formulation: its rows.
        joint_names: joints that may move.

    Attributes:
        problem: the problem of the last tick.
        solution: its solution, None before the first.
    """

    def __init__(self, formulation: VelocityFormulation, joint_names: list[str]) -> None:
        levels = formulation.levels
        tasks = formulation.level_tasks
        self.problem = HierarchicalProblem.allocate(
            len(joint_names),
            [0, *(len(level.velocity) for level in levels)],
            names=["joint limits", "contacts", *(", ".join(t.name for t in ts) for ts in tasks)],
            labels=[
                [],
                [(f"motion of contact {c.name}", c.dim) for c in formulation.held],
                *([(f"task {t.name}", t.dim) for t in ts] for ts in tasks),
            ],
        )
        self.problem.labels[:1] = [(f"limit of {name}", 1) for name in joint_names]
        self.solution: Solution | None = None
        self._rows = formulation
        self._solver = make_solver()

    def solve(self, lower: Float64[np.ndarray, " n"], upper: Float64[np.ndarray, " n"]) -> Solution:
        """Solves for the rows as they are.

        Args:
            lower: lower bounds of the joint velocities [rad/s].
            upper: upper bounds.
        """
        problem = self.problem
        problem.x_lower[:], problem.x_upper[:] = lower, upper
        problem.A[:] = self._rows.jacobian
        problem.lower[problem.n :] = self._rows.velocity
        problem.upper[problem.n :] = self._rows.velocity
        for i, level in enumerate(self._rows.levels[1:]):
            weights = problem.level(PHYSICS_LEVELS + i).weights
            np.sqrt(level.weight / ROW_WEIGHT, out=weights)
        self.solution = self._solver.solve(problem)
        return self.solution

    def reset(self) -> None:
        """Forgets the last solution."""
        self._solver.reset()
        self.solution = None
