"""The `cascade` strategy: one QP a level, in the null space of the equalities solved before.

The sequential method of (Herzog et al. 2016, "Momentum control with hierarchical inverse dynamics
on a torque-controlled humanoid") and (Ahn et al. 2024, section 4.1): each level's QP has the slack
as a variable,

    min_(z, w) |w|^2   s.t.   l <= W (A (x + N z)) - w <= u,   earlier inequalities hard, widened by
                              the slack they got,

and its equalities leave the null space N for the next.
"""

from time import perf_counter

import numpy as np
import scipy.optimize
from jaxtyping import Float64, Int

from poise.hqp.backends import ACCURACY, QP, Backend, is_definite, make_backend
from poise.hqp.measure import (
    FEASIBILITY_TOLERANCE,
    level_norms,
    level_scales,
    row_sizes,
    row_values,
    signed_slacks,
)
from poise.hqp.problem import HierarchicalProblem
from poise.hqp.reduction import Reduction
from poise.hqp.solution import Solution, SolveStatus
from poise.hqp.status import failure, is_sound

_SLOPS = (0.0, 1e-10, 1e-9, 1e-8, 1e-7)
"""How far held rows are widened, relative to their size, when the backend finds no point: what
earlier levels left may be too thin for it to enter."""


_ACTIVE_TOLERANCE = 1e-8
"""Held rows this close to their bound, relative to their size, may carry a multiplier."""

_BALANCE_TOLERANCE = 1e-7
"""Forces that balance no better than this, relative to the largest, say nothing about rows."""

_CLEAR_MULTIPLIER = 1e-6
"""Multipliers above this share of the level's largest force are certainly positive."""


class CascadeSolver:
    """Solves level by level with any QP backend; one workspace a level persists.

    Args:
        backend: a name from `backends.ACCURACY`.
        time_limit: cap on a solve [s]; None for none. Kept between levels, and inside the
            level's QP by the backends that can (daqp, osqp).

    Raises:
        UnknownNameError: no such backend.
        MissingExtraError: the backend is not installed.
    """

    def __init__(self, backend: str = "osqp", time_limit: float | None = None) -> None:
        self.backend = backend
        self.time_limit = time_limit
        self.name = f"cascade/{backend}"
        self._make = make_backend(backend)
        self._workspaces: dict[int, Backend] = {}

    def reset(self) -> None:
        """Forget the last solution, so that the next solve starts cold."""
        self._workspaces.clear()

    def solve(self, problem: HierarchicalProblem) -> Solution:
        """Solve one problem; the answer owns its arrays."""
        start = perf_counter()
        if not is_sound(problem):
            return failure(problem, SolveStatus.BAD_PROBLEM, self.name, start)
        deadline = np.inf if self.time_limit is None else start + self.time_limit
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
                reached[level] = self._residuals(problem, space.point)[level]
            name = f"level {level}" if level < count else "final"
            timings[name] = perf_counter() - before
        return self._report(problem, space.point, status, reached, timings, start)

    def _solve_level(self, space: Reduction, level: int, deadline: float) -> bool:
        """Solve one level, or the final cost after the last; return whether the backend did."""
        problem = space.problem
        indices = space.level_rows(level)
        if space.freedom == 0:
            space.hold(indices, problem.lower[indices] == problem.upper[indices])
            return True
        final = level == len(problem.levels)
        if not final and len(indices) == 0:
            return True
        for slop in _SLOPS:
            qp = _final_qp(space, slop) if final else _level_qp(space, level, slop)
            workspace = self._workspaces.setdefault(level, self._make())
            solved = workspace.solve(qp, deadline - perf_counter())
            if solved is not None and self._holds(space, solved[: space.freedom]):
                space.move(solved[: space.freedom])
                break
            del self._workspaces[level]
            if perf_counter() > deadline:
                return False
        else:
            return False
        _settle(space, indices)
        return True

    def _holds(self, space: Reduction, y: Float64[np.ndarray, " d"]) -> bool:
        """Return whether a point that a backend calls solved is finite and meets the held rows."""
        held = space.held_rows()
        values = held.A @ y
        sizes = row_sizes(space.problem, space.point + space.basis @ y)[space.held]
        violation = np.maximum(values - held.upper, held.lower - values)
        return bool(np.isfinite(y).all() and (violation <= ACCURACY[self.backend] * sizes).all())

    def _residuals(
        self, problem: HierarchicalProblem, x: Float64[np.ndarray, " n"]
    ) -> Float64[np.ndarray, " p"]:
        return level_norms(problem, signed_slacks(problem, row_values(problem, x)))

    def _report(
        self,
        problem: HierarchicalProblem,
        x: Float64[np.ndarray, " n"],
        status: SolveStatus,
        reached: Float64[np.ndarray, " p"],
        timings: dict[str, float],
        start: float,
    ) -> Solution:
        slacks = signed_slacks(problem, row_values(problem, x))
        residuals = level_norms(problem, slacks)
        scales = level_scales(problem)
        accuracy = ACCURACY[self.backend]
        if status.ok and bool((residuals > reached + accuracy * scales).any()):
            status = SolveStatus.INACCURATE
        timings["total"] = perf_counter() - start
        return Solution(
            status=status,
            x=x,
            slacks=slacks,
            residuals=residuals,
            relative_residuals=residuals / scales,
            strategy=self.name,
            relaxed=bool((residuals > accuracy * scales).any()),
            timings=timings,
        )


def _settle(space: Reduction, indices: Int[np.ndarray, " k"]) -> None:
    """Hold a solved level: equalities leave the space, inequalities stay, widened by their slack.

    Where the level kept slack, its violated rows and the held rows that push against them have the
    same value at every optimum. Kept as inequalities they would leave a set without inside, which
    no backend handles well, so they leave the space too, if the forces balance well enough to tell.
    """
    problem = space.problem
    equality = problem.lower[indices] == problem.upper[indices]
    slacks = signed_slacks(problem, row_values(problem, space.point))[indices]
    sizes = row_sizes(problem, space.point)
    violated = np.abs(slacks) > FEASIBILITY_TOLERANCE * sizes[indices]
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
    near = _ACTIVE_TOLERANCE * sizes[space.held]
    upper, lower = np.flatnonzero(held.upper <= near), np.flatnonzero(held.lower >= -near)
    normals = np.concatenate([held.A[upper], -held.A[lower]])
    norms = np.linalg.norm(normals, axis=1)
    seen = norms > 0.0
    if unit == 0.0 or not seen.any():
        return np.zeros(0, dtype=np.int64)
    gradient = space.rows(indices).A.T @ forces
    pushes, error = scipy.optimize.nnls(
        (normals[seen] / norms[seen, None]).T, -gradient / unit, maxiter=1000
    )
    clear = pushes > _CLEAR_MULTIPLIER
    if error > _BALANCE_TOLERANCE:
        return np.zeros(0, dtype=np.int64)
    return np.unique(space.held[np.concatenate([upper, lower])[seen][clear]])


def _level_qp(space: Reduction, level: int, slop: float) -> QP:
    """Set up a level's QP in (z, w), the slack in the user's weighted units."""
    indices = space.level_rows(level)
    weights = space.problem.weights[indices]
    soft, held = space.rows(indices), space.held_rows(slop)
    d, k, h = space.freedom, len(indices), len(held.lower)
    A = np.zeros((k + h, d + k))
    A[:k, :d] = soft.A * weights[:, None]
    A[:k, d:] = -np.eye(k)
    A[k:, :d] = held.A
    A_pattern = np.zeros(A.shape, dtype=np.bool_)
    A_pattern[:, :d] = True
    A_pattern[:k, d:] = np.eye(k, dtype=np.bool_)
    P = np.diag(np.concatenate([np.zeros(d), np.ones(k)]))
    return QP(
        P=P,
        q=np.zeros(d + k),
        A=A,
        lower=np.concatenate([soft.lower * weights, held.lower]),
        upper=np.concatenate([soft.upper * weights, held.upper]),
        P_pattern=P > 0.0,
        A_pattern=A_pattern,
    )


def _final_qp(space: Reduction, slop: float) -> QP:
    """Set up the final cost over what all levels leave."""
    problem, held = space.problem, space.held_rows(slop)
    P = space.basis.T @ problem.H @ space.basis
    return QP(
        P=0.5 * (P + P.T),
        q=space.basis.T @ (problem.H @ space.point + problem.g),
        A=held.A,
        lower=held.lower,
        upper=held.upper,
        P_pattern=np.ones(P.shape, dtype=np.bool_),
        A_pattern=np.ones(held.A.shape, dtype=np.bool_),
        definite=is_definite(P),
    )
