"""Conflicts solved fast: the levels that must give one after the other, all others as hard rows.

A posture at the bottom of a stack can never be met, so this is what a controller solves tick by
tick. With the levels above it as hard rows, the least squares of a level is a QP of its own,

    min |W (A x - b)|^2 / 2 + rho (x^T H x / 2 + g^T x),

whose first minimiser is off by O(rho). Proximal steps remove that error: with

    x+ = argmin |W (A x - b)|^2 / 2 + rho (x - x0)^T H (x - x0) / 2

the slack converges to the least one at a rate of rho / (rho + lambda), and what the level leaves
open keeps the choice of the final cost, because H (x+ - x0) is orthogonal to it; unless a hard row
of inequality pushes, whose force may change from step to step: then the final cost chooses
anew. When a step no longer moves x, its own multipliers certify the level: its gradient is balanced
by the hard rows alone. The next level is solved in the null space of all equality rows so far: held
as rows they would depend on each other, which rounding turns into a contradiction.
"""

from typing import Any, cast

import numpy as np
from jaxtyping import Float64
from scipy.linalg import blas, qr

from poise.hqp.hard import HardQP
from poise.hqp.problem import HierarchicalProblem

_norm: Any = cast("Any", blas).dnrm2  # SciPy's stubs do not know the wrapped routines

RHO = 1e-5
"""Weight of the final cost and of the proximal term, relative to the level's own curvature."""

MAX_STEPS = 6
"""Proximal steps; more are only needed where the level is close to losing rank."""

STEP_TOLERANCE = 1e-9
"""A proximal force this small, relative to the gradient of the level's slack, counts as none."""

ROUNDING = 1e-14
"""A proximal force this small, relative to the terms of that gradient, is rounding."""

RANK_TOLERANCE = 1e-10
"""Rows whose part outside the others is smaller than this, relative to the largest, depend on them.
"""


class SoftLevels:
    """QPs, one a soft level and one for the final cost, warm from call to call."""

    def __init__(self) -> None:
        self._stages: dict[int, _Stage] = {}

    def reset(self) -> None:
        """Forget everything, so that the next solve starts cold."""
        self._stages.clear()

    def solve(
        self, problem: HierarchicalProblem, soft: tuple[int, ...], time_limit: float = 0.0
    ) -> tuple[Float64[np.ndarray, " n"], int] | None:
        """Return the lexicographic point and the iterations, or None if another level conflicts.

        Whether the other levels' rows hold at the point is for the caller to check.

        Args:
            problem: the problem.
            soft: the levels that give, in order, each of equality rows alone; see `can_give`.
            time_limit: cap on each QP [s]; 0 for none.
        """
        total = 0
        space = _Space(problem, -1, np.zeros(problem.n))
        for level in soft:
            stage = self._stages.setdefault(level, _Stage())
            found = stage.least_slack(problem, level, space, time_limit)
            if found is None:
                return None
            x, iterations, pushed = found
            total += iterations
            if level == len(problem.levels) - 1 and not pushed:
                return x, total
            space = _Space(problem, level, x)
        stage = self._stages.setdefault(len(problem.levels), _Stage())
        found = stage.final_cost(problem, space, time_limit)
        return None if found is None else (found[0], total + found[1])


def can_give(problem: HierarchicalProblem, level: int) -> bool:
    """Whether a level can be solved here: equality rows alone, below the simple bounds' level."""
    view = problem.levels[level]
    return (
        level > problem.bounds_level
        and len(view.lower) > 0
        and bool((view.lower == view.upper).all())
    )


class _Space:
    """What the equality rows of the levels so far leave free: x = point + basis z.

    Args:
        problem: the problem.
        done: the last level that is resolved, -1 for none.
        point: meets the equality rows of the levels up to it, at the values they are to keep.
    """

    def __init__(
        self, problem: HierarchicalProblem, done: int, point: Float64[np.ndarray, " n"]
    ) -> None:
        self.point = point
        self.basis: Float64[np.ndarray, "n f"] | None = None
        self._kept = np.ones(problem.n + problem.m, dtype=np.bool_)
        if done < 0:
            return
        gone = (problem.lower == problem.upper) & (problem.level_of <= done)
        self._kept = ~gone
        n = problem.n
        E = np.concatenate((np.eye(n)[gone[:n]], problem.A[gone[n:]]))
        # SciPy's stubs do not follow its options, here one more factor for the pivots.
        factors: Any = qr(E.T, pivoting=True, check_finite=False)
        sizes = np.abs(np.diag(factors[1]))
        rank = int((sizes > RANK_TOLERANCE * sizes[0]).sum()) if len(sizes) else 0
        self.basis = np.ascontiguousarray(factors[0][:, rank:])

    def hard_rows(
        self, problem: HierarchicalProblem, level: int
    ) -> tuple[Float64[np.ndarray, "r f"], Float64[np.ndarray, " k"], Float64[np.ndarray, " k"]]:
        """Rows of the levels above one, in z: without a basis the bounds stay simple bounds."""
        n = problem.n
        if self.basis is None:
            end = problem.levels[level].slice.start if level < len(problem.levels) else problem.m
            return problem.A[:end], problem.lower[: n + end], problem.upper[: n + end]
        kept = self._kept & (problem.level_of < level)
        bounds, rows = kept[:n], kept[n:]
        A = problem.A[rows]
        shift = np.concatenate((self.point[bounds], A @ self.point))
        coefficients = np.concatenate((self.basis[bounds], A @ self.basis))
        return coefficients, problem.lower[kept] - shift, problem.upper[kept] - shift

    def lift(self, z: Float64[np.ndarray, " f"]) -> Float64[np.ndarray, " n"]:
        """The point of z."""
        return z if self.basis is None else self.point + self.basis @ z

    def matrix(self, H: Float64[np.ndarray, "n n"]) -> Float64[np.ndarray, "f f"]:
        """A Hessian in z."""
        return H if self.basis is None else self.basis.T @ H @ self.basis

    def vector(self, g: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " f"]:
        """A gradient in z."""
        return g if self.basis is None else self.basis.T @ g

    @property
    def fixed(self) -> bool:
        """Whether nothing is left free."""
        return self.basis is not None and self.basis.shape[1] == 0


class _Stage:
    """The QP of one level, or of the final cost, over the hard rows above it."""

    def __init__(self) -> None:
        # The level's curvature stands beside that of the final cost, which RHO makes small.
        self._qp = HardQP(refines=True)

    def least_slack(
        self, problem: HierarchicalProblem, level: int, space: _Space, time_limit: float
    ) -> tuple[Float64[np.ndarray, " n"], int, bool] | None:
        """Point, iterations, and whether a row of inequality pushed on the way; None for none."""
        if space.fixed:
            return space.point, 0, False
        view = problem.levels[level]
        A = view.A * view.weights[:, None]
        curvature = A.T @ A
        gradient = A.T @ (view.lower * view.weights)
        trace = float(np.vdot(A, A))
        if not trace > 0.0:
            return None
        rho = RHO * trace / max(float(problem.H.diagonal().sum()), 1e-300)
        H = rho * problem.H
        total = curvature + H
        # Constant in x, so that a gradient in z is one at z = 0.
        offset = (0.0 if space.basis is None else total @ space.point) - gradient
        floor = ROUNDING * _norm(gradient) + 1e-300
        rows = space.hard_rows(problem, level)
        point = self._qp.solve(
            space.matrix(total), space.vector(offset + rho * problem.g), *rows, time_limit
        )
        if point is None:
            return None
        iterations, x = point.iterations, space.lift(point.x)
        one_sided = rows[1] < rows[2]
        pushed = bool(point.multipliers[one_sided].any())
        for _ in range(MAX_STEPS):
            pull = H @ x
            point = self._qp.again(space.vector(offset - pull))
            if point is None:
                return None
            iterations += point.iterations
            x = space.lift(point.x)
            pushed = pushed or bool(point.multipliers[one_sided].any())
            force = space.vector(H @ x - pull)
            left = space.vector(curvature @ x - gradient)
            if _norm(force) <= max(STEP_TOLERANCE * _norm(left), floor):
                return x, iterations, pushed
        return None

    def final_cost(
        self, problem: HierarchicalProblem, space: _Space, time_limit: float
    ) -> tuple[Float64[np.ndarray, " n"], int] | None:
        if space.fixed:
            return space.point, 0
        H = problem.H
        offset = problem.g if space.basis is None else H @ space.point + problem.g
        rows = space.hard_rows(problem, len(problem.levels))
        point = self._qp.solve(space.matrix(H), space.vector(offset), *rows, time_limit)
        return None if point is None else (space.lift(point.x), point.iterations)
