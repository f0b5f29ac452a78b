"""The usual conflict, solved fast: every level met but the last, which gives what it must.

A posture at the bottom of a stack can never be met, so this is what a controller solves tick by
tick. With the levels above as hard rows, the last level's least squares is a QP of its own,

    min |W (A x - b)|^2 / 2 + rho (x^T H x / 2 + g^T x),

whose first minimiser is off by O(rho). Proximal steps remove that error: with

    x+ = argmin |W (A x - b)|^2 / 2 + rho (x - x0)^T H (x - x0) / 2

the slack converges to the least one at a rate of rho / (rho + lambda), and what the level leaves
open keeps the choice of the final cost, because H (x+ - x0) is orthogonal to it. When a step no
longer moves x, its own multipliers certify the last level: its gradient is balanced by the hard
rows alone.
"""

import daqp
import numpy as np
from jaxtyping import Float64

from poise.hqp.hard import PRIMAL_TOLERANCE
from poise.hqp.problem import HierarchicalProblem

RHO = 1e-5
"""Weight of the final cost and of the proximal term, relative to the level's own curvature."""

MAX_STEPS = 6
"""Proximal steps; more are only needed where the level is close to losing rank."""

STEP_TOLERANCE = 1e-9
"""Largest proximal force, relative to the gradient of the level's slack, that counts as none."""

ROUNDING = 1e-14
"""A proximal force this small, relative to the terms of that gradient, is rounding."""


class LastLevelQP:
    """A DAQP workspace for problems whose last level alone must give, warm from call to call."""

    def __init__(self) -> None:
        self._model = daqp.Model()
        self._shape = (-1, -1, -1)

    def reset(self) -> None:
        """Forget everything, so that the next solve starts cold."""
        self._model = daqp.Model()
        self._shape = (-1, -1, -1)

    def solve(
        self, problem: HierarchicalProblem, time_limit: float = 0.0
    ) -> tuple[Float64[np.ndarray, " n"], int] | None:
        """Return the lexicographic point and the iterations, or None where this does not apply.

        It applies where the last level holds equality rows alone, without the simple bounds, and
        every other level can be met. The point's hard rows are unchecked.

        Args:
            problem: the problem.
            time_limit: cap on each QP [s]; 0 for none.
        """
        rows = _soft_rows(problem)
        if rows is None:
            return None
        A, b = rows
        hard = problem.m - len(problem.levels[-1].lower)
        curvature = A.T @ A
        gradient = A.T @ b
        trace = float(np.trace(curvature))
        if not trace > 0.0:
            return None
        rho = RHO * trace / max(float(np.trace(problem.H)), 1e-300)
        H = rho * problem.H
        total = curvature + H
        floor = ROUNDING * float(np.abs(gradient).max()) + 1e-300
        x = self._first(problem, hard, total, rho * problem.g - gradient, time_limit)
        iterations = 0
        for _ in range(MAX_STEPS):
            if x is None:
                return None
            pull = H @ x
            x_next, count = self._again(-gradient - pull)
            iterations += count
            if x_next is None:
                return None
            force = H @ x_next
            force -= pull
            x = x_next
            left = curvature @ x
            left -= gradient
            if np.abs(force).max() <= max(STEP_TOLERANCE * float(np.abs(left).max()), floor):
                return x, iterations
        return None

    def _first(
        self,
        problem: HierarchicalProblem,
        hard: int,
        H: Float64[np.ndarray, "n n"],
        f: Float64[np.ndarray, " n"],
        time_limit: float,
    ) -> Float64[np.ndarray, " n"] | None:
        n = problem.n
        A = problem.A[:hard]
        lower, upper = problem.lower[: n + hard], problem.upper[: n + hard]
        shape = (n, hard, problem.m)
        if shape == self._shape:
            flag = self._model.update(H, f, A if hard else None, upper, lower)
        else:
            self._model = daqp.Model()
            self._model.settings = {"primal_tol": PRIMAL_TOLERANCE, "time_limit": time_limit}
            flag, _ = self._model.setup(H, f, A, upper, lower)
            self._shape = shape if flag >= 0 else (-1, -1, -1)
        if flag < 0:
            return None
        x, _, flag, _ = self._model.solve()
        return x.copy() if flag >= 1 else None

    def _again(self, f: Float64[np.ndarray, " n"]) -> tuple[Float64[np.ndarray, " n"] | None, int]:
        if self._model.update(None, f) < 0:
            return None, 0
        x, _, flag, info = self._model.solve()
        return (x.copy() if flag >= 1 else None), info["iterations"]


def _soft_rows(
    problem: HierarchicalProblem,
) -> tuple[Float64[np.ndarray, "m n"], Float64[np.ndarray, " m"]] | None:
    """The last level's weighted rows, or None where they are not equalities alone."""
    last = len(problem.levels) - 1
    level = problem.levels[last]
    if last == 0 or problem.bounds_level == last or not len(level.lower):
        return None
    if not (level.lower == level.upper).all():
        return None
    return level.A * level.weights[:, None], level.lower * level.weights
