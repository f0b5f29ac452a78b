"""Strategy `cascade`: one QP a level, in the null space of the equalities solved before.

The sequential method of (Herzog et al. 2016, "Momentum control with hierarchical inverse dynamics
on a torque-controlled humanoid") and (Ahn et al. 2024, section 4.1): each level's QP has the slack
as a variable,

    min_(z, w) |w|^2   s.t.   l <= W (A (x + N z)) - w <= u,   earlier inequalities hard, widened by
                              the slack they got,

and its equalities leave the null space N for the next.
"""

from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np
import scipy.linalg
import scipy.optimize
from jaxtyping import Bool, Float64, Int

from poise.hqp._backends import QP
from poise.hqp._cold import ColdSolver
from poise.hqp._measure import measure_point, row_sizes
from poise.hqp._problem import HierarchicalProblem
from poise.hqp._solution import Solution, SolveStatus
from poise.hqp._tolerances import (
    ACCURACY,
    CERTIFIED,
    COARSE,
    FACTOR_TOLERANCE,
    MET_TOLERANCE,
    OPTIMALITY_TOLERANCE,
    RANK_TOLERANCE,
    SLOPS,
)

_linalg: Any = scipy.linalg  # its stubs do not distinguish the modes of qr


@dataclass(frozen=True, slots=True)
class TwoSidedRows:
    """Two-sided rows `lower <= A y <= upper`."""

    A: Float64[np.ndarray, "k d"]
    lower: Float64[np.ndarray, " k"]
    upper: Float64[np.ndarray, " k"]


class Reduction:
    """Remaining freedom below the levels resolved so far."""

    def __init__(self, problem: HierarchicalProblem) -> None:
        n = problem.n
        self.problem = problem
        self.coefficients = np.vstack([np.eye(n), problem.A])
        self.norms = np.linalg.norm(self.coefficients, axis=1)
        self.bounded = np.isfinite(problem.lower) | np.isfinite(problem.upper)
        self.point = np.zeros(n)  # meets all rows held so far; `y = 0`
        self.basis = np.eye(n)  # orthonormal directions of y
        self.held = np.zeros(0, dtype=np.int64)  # stacked indices of inequalities that must hold
        self.fixed = np.zeros(n + problem.m, dtype=np.bool_)  # rows that hold as equalities

    @property
    def freedom(self) -> int:
        """Number of directions left."""
        return self.basis.shape[1]

    def level_rows(self, level: int) -> Int[np.ndarray, " k"]:
        """Return the stacked indices of a level's bounded rows."""
        return np.flatnonzero((self.problem.level_of == level) & self.bounded)

    def rows(self, indices: Int[np.ndarray, " k"]) -> TwoSidedRows:
        """Return rows in y; those of dependent rows are exactly zero."""
        A = self.coefficients[indices] @ self.basis
        gone = np.linalg.norm(A, axis=1) <= FACTOR_TOLERANCE * self.norms[indices]
        A[gone] = 0.0
        offset = self.coefficients[indices] @ self.point
        return TwoSidedRows(
            A, self.problem.lower[indices] - offset, self.problem.upper[indices] - offset
        )

    def held_rows(self, slop: float = 0.0) -> TwoSidedRows:
        """Return the held inequalities in y, widened by rounding so that `y = 0` meets them."""
        rows = self.rows(self.held)
        room = slop * np.maximum(1.0, self.norms[self.held] * float(np.linalg.norm(self.point)))
        return TwoSidedRows(
            rows.A, np.minimum(rows.lower, 0.0) - room, np.maximum(rows.upper, 0.0) + room
        )

    def move(self, y: Float64[np.ndarray, " d"]) -> None:
        """Make `point + basis y` the new point."""
        self.point = self.point + self.basis @ y

    def fix(self, indices: Int[np.ndarray, " k"]) -> None:
        """Make rows equalities at their value at the point, and shrink the basis."""
        self.fixed[indices] = True
        self.held = self.held[~self.fixed[self.held]]
        A = self.rows(indices).A
        sizes = np.linalg.norm(A, axis=1)
        normals = A[sizes > 0.0] / sizes[sizes > 0.0, None]
        if len(normals) == 0:
            return
        q, r, _ = _linalg.qr(normals.T, pivoting=True, check_finite=False)
        rank = int(np.count_nonzero(np.abs(np.diagonal(r)) > RANK_TOLERANCE))
        self.basis = self.basis @ q[:, rank:]

    def hold(self, indices: Int[np.ndarray, " k"], equality: Bool[np.ndarray, " k"]) -> None:
        """Fix equalities and hold inequalities from now on."""
        self.held = np.concatenate([self.held, indices[~equality]])
        if equality.any():
            self.fix(indices[equality])


_SHORT = 1e-4
"""Length of a weighted row below which its slack is measured by its length."""


class CascadeSolver(ColdSolver):
    """Solve level by level with any QP backend."""

    strategy = "cascade"

    def _solve(self, problem: HierarchicalProblem, start: float, deadline: float) -> Solution:
        space = Reduction(problem)
        count = len(problem.levels)
        reached = np.zeros(count)
        status = SolveStatus.OPTIMAL
        timings: dict[str, float] = {}
        for level in range(count + 1):
            before = perf_counter()
            if before > deadline:
                status = SolveStatus.TIME_LIMIT
                break
            if not self._solve_level(space, level, deadline):
                late = perf_counter() > deadline
                status = SolveStatus.TIME_LIMIT if late else SolveStatus.INACCURATE
                break
            if level < count:
                reached[level] = measure_point(problem, space.point).residuals[level]
            name = f"level {level}" if level < count else "final"
            timings[name] = perf_counter() - before
        measure = measure_point(problem, space.point)
        accuracy = ACCURACY[self.backend]
        if status.ok and bool((measure.residuals > reached + accuracy * measure.scales).any()):
            status = SolveStatus.INACCURATE
        timings["total"] = perf_counter() - start
        return Solution(
            status=status,
            x=space.point,
            slacks=measure.slacks,
            residuals=measure.residuals,
            relative_residuals=measure.relative,
            strategy=self.name,
            relaxed=bool((measure.residuals > accuracy * measure.scales).any()),
            timings=timings,
        )

    def _solve_level(self, space: Reduction, level: int, deadline: float) -> bool:
        """Solve one level, or the final cost after the last; return the backend's success."""
        problem = space.problem
        indices = space.level_rows(level)
        if space.freedom == 0:
            space.hold(indices, problem.lower[indices] == problem.upper[indices])
            return True
        final = level == len(problem.levels)
        if not final and len(indices) == 0:
            return True
        for slop in SLOPS:
            qp = _final_qp(space, slop) if final else _level_qp(space, level, slop)
            solved = self._solve_qp(qp, deadline - perf_counter())
            if solved is not None and self._holds(space, solved[: space.freedom]):
                space.move(solved[: space.freedom])
                break
            if perf_counter() > deadline:
                return False
        else:
            return False
        _settle(space, indices)
        return True

    def _holds(self, space: Reduction, y: Float64[np.ndarray, " d"]) -> bool:
        """Check that a backend's point is finite and meets the held rows."""
        held = space.held_rows()
        values = held.A @ y
        sizes = row_sizes(space.problem, space.point + space.basis @ y)[space.held]
        violation = np.maximum(values - held.upper, held.lower - values)
        return bool(np.isfinite(y).all() and (violation <= ACCURACY[self.backend] * sizes).all())


def _settle(space: Reduction, indices: Int[np.ndarray, " k"]) -> None:
    """Hold a solved level: fix its equalities, hold its inequalities, widened by their slack.

    Where the level has slack, its violated rows and the held rows that oppose them have the same
    value at every optimum. As inequalities they would leave a set without interior, which no
    backend handles well, so they are fixed as well if the multipliers are certain.
    """
    problem = space.problem
    equality = problem.lower[indices] == problem.upper[indices]
    slacks = measure_point(problem, space.point).slacks[indices]
    sizes = row_sizes(problem, space.point)
    violated = np.abs(slacks) > MET_TOLERANCE * sizes[indices]
    forced = np.zeros(0, dtype=np.int64)
    if violated.any() and len(space.held):
        forced = _forced_rows(space, indices, np.where(violated, slacks, 0.0), sizes)
    space.hold(indices, equality | violated)
    space.fix(forced)


def _forced_rows(
    space: Reduction,
    indices: Int[np.ndarray, " k"],
    slacks: Float64[np.ndarray, " k"],
    sizes: Float64[np.ndarray, " nm"],
) -> Int[np.ndarray, " f"]:
    """Return the held rows that carry a clear multiplier of the level just solved."""
    forces = space.problem.weights[indices] ** 2 * slacks
    unit = float(np.abs(forces * space.norms[indices]).max())
    held = space.held_rows()
    near = OPTIMALITY_TOLERANCE * sizes[space.held]
    upper, lower = np.flatnonzero(held.upper <= near), np.flatnonzero(held.lower >= -near)
    normals = np.concatenate([held.A[upper], -held.A[lower]])
    norms = np.linalg.norm(normals, axis=1)
    seen = norms > 0.0
    if unit == 0.0 or not seen.any():
        return np.zeros(0, dtype=np.int64)
    gradient = space.rows(indices).A.T @ forces
    found, error = scipy.optimize.nnls(
        (normals[seen] / norms[seen, None]).T, -gradient / unit, maxiter=1000
    )
    clear = found > COARSE
    if error > CERTIFIED:
        return np.zeros(0, dtype=np.int64)
    return np.unique(space.held[np.concatenate([upper, lower])[seen][clear]])


def _level_qp(space: Reduction, level: int, slop: float) -> QP:
    """Set up a level's QP in (z, w), with the slack in the user's weighted units.

    Where some row is very short in these, its length is the unit: the tolerances of backends are
    absolute, and its slack would count as none.
    """
    indices = space.level_rows(level)
    weights = space.problem.weights[indices]
    lengths = weights * space.norms[indices]
    shortest = float(lengths.min(initial=1.0, where=lengths > 0.0))
    if shortest < _SHORT:
        weights = weights / shortest
    soft, held = space.rows(indices), space.held_rows(slop)
    d, k, h = space.freedom, len(indices), len(held.lower)
    A = np.zeros((k + h, d + k))
    A[:k, :d] = soft.A * weights[:, None]
    A[:k, d:] = -np.eye(k)
    A[k:, :d] = held.A
    return QP(
        P=np.diag(np.concatenate([np.zeros(d), np.ones(k)])),
        q=np.zeros(d + k),
        A=A,
        lower=np.concatenate([soft.lower * weights, held.lower]),
        upper=np.concatenate([soft.upper * weights, held.upper]),
    )


def _final_qp(space: Reduction, slop: float) -> QP:
    """Set up the final cost over the remaining freedom."""
    problem, held = space.problem, space.held_rows(slop)
    P = space.basis.T @ problem.H @ space.basis
    return QP(
        P=0.5 * (P + P.T),
        q=space.basis.T @ (problem.H @ space.point + problem.g),
        A=held.A,
        lower=held.lower,
        upper=held.upper,
    )
