"""Certificate of lexicographic optimality of a point, independent of the solver.

Every level's optimality conditions are checked on the problem's own numbers, with multipliers found
here by nonnegative least squares: for level k some `lambda` with

    sum_i lambda_i a_i = 0,   lambda_i = weight_i^2 w_i on the rows of level k, up to the rounding
                              of w_i where the row counts as met,
    lambda_i free on rows of earlier levels that hold as equalities at every optimum,
    lambda_i of the right sign on inequalities active there, and zero elsewhere,

and for the final cost the same with `H x + g` in place of level k's slack. The sums are convex, so
these conditions are sufficient.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64

from poise.hqp._measure import measure_point, row_sizes, row_values
from poise.hqp._problem import HierarchicalProblem
from poise.hqp._tolerances import (
    CERTIFIED,
    FACTOR_TOLERANCE,
    OPTIMALITY_TOLERANCE,
    RANK_TOLERANCE,
)


@dataclass(frozen=True, slots=True)
class Certificate:
    """Errors of the optimality conditions at a point."""

    # Of each level, then of the final cost: imbalance relative to the forces that should balance
    errors: Float64[np.ndarray, " p1"]
    multipliers: tuple[Float64[np.ndarray, " nm"], ...]  # of each level; zero if it is met

    @property
    def worst(self) -> float:
        """The largest of `errors`."""
        return float(self.errors.max())


def certify_point(problem: HierarchicalProblem, x: Float64[np.ndarray, " n"]) -> Certificate:
    """Check the optimality conditions of every level and of the final cost at a point."""
    return _Certifier(problem, x).run()


class _Certifier:
    def __init__(self, problem: HierarchicalProblem, x: Float64[np.ndarray, " n"]) -> None:
        self.problem, self.x = problem, x
        self.rows = np.vstack([np.eye(problem.n), problem.A])
        self.norms = np.linalg.norm(self.rows, axis=1)
        values = row_values(problem, x)
        sizes = row_sizes(problem, x)
        slacks = measure_point(problem, x).slacks
        self.rounding = OPTIMALITY_TOLERANCE * sizes
        self.slacks = np.where(np.abs(slacks) > self.rounding, slacks, 0.0)
        near = CERTIFIED * sizes
        self.at_upper = values >= problem.upper - near
        self.at_lower = values <= problem.lower + near
        self.equality = problem.lower == problem.upper
        self.free = np.zeros(len(values), dtype=np.bool_)

    def run(self) -> Certificate:
        errors: list[float] = []
        multipliers: list[Float64[np.ndarray, " nm"]] = []
        problem = self.problem
        for level in range(len(problem.levels)):
            mine = problem.level_of == level
            stiffness = np.where(mine, problem.weights**2, 0.0)
            forces = stiffness * self.slacks
            size = float(np.linalg.norm(forces * self.norms))
            # The slack of a row that counts as met is uncertain, and may balance others.
            most = np.where(self.slacks == 0.0, stiffness * self.rounding, 0.0)
            most[problem.level_of < level] = np.inf
            error, found = self._balance(self.rows.T @ forces, size, most)
            errors.append(error)
            multipliers.append(found + forces)
            self._settle(mine, found, float(np.abs(forces * self.norms).max(initial=0.0)))
        size = max(float(np.abs(problem.g).max()), float(np.abs(problem.H @ self.x).max()), 1.0)
        gradient = problem.H @ self.x + problem.g
        error, _ = self._balance(gradient, size, np.full(len(self.slacks), np.inf))
        errors.append(error)
        return Certificate(np.array(errors), tuple(multipliers))

    def _settle(
        self, mine: Bool[np.ndarray, " nm"], found: Float64[np.ndarray, " nm"], size: float
    ) -> None:
        """Mark the rows that hold as equalities at every optimum of the level."""
        self.free |= mine & (self.equality | (self.slacks != 0.0))
        self.free |= np.abs(found * self.norms) > CERTIFIED * size

    def _balance(
        self, gradient: Float64[np.ndarray, " n"], size: float, most: Float64[np.ndarray, " nm"]
    ) -> tuple[float, Float64[np.ndarray, " nm"]]:
        """Find multipliers that cancel the gradient as far as possible."""
        found = np.zeros(len(self.slacks))
        if size == 0.0 or not np.any(gradient):
            return 0.0, found
        free = np.flatnonzero(self.free & (most > 0.0))
        signed = ~self.free & (most > 0.0)
        upper = np.flatnonzero(signed & self.at_upper)
        lower = np.flatnonzero(signed & self.at_lower)
        null = _null_space(self.rows[free], self.norms[free])
        # Normals of active bounds, outwards, and the sign of their multipliers.
        columns = np.concatenate([self.rows[upper], -self.rows[lower]]).T
        signs = np.concatenate([np.ones(len(upper)), -np.ones(len(lower))])
        within = most[np.concatenate([upper, lower])]
        scaled = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        error, sizes = _nearest(null, columns / scaled, -gradient / size, within * scaled / size)
        np.add.at(found, np.concatenate([upper, lower]), size * sizes / scaled * signs)
        if len(free):
            rest = gradient + self.rows.T @ found
            unit = self.rows[free] / np.maximum(self.norms[free], 1e-300)[:, None]
            forces = np.linalg.lstsq(unit.T, rest, rcond=FACTOR_TOLERANCE)[0]
            found[free] -= forces / np.maximum(self.norms[free], 1e-300)
        return error, found


def _nearest(
    null: Float64[np.ndarray, "n d"],
    columns: Float64[np.ndarray, "n k"],
    target: Float64[np.ndarray, " n"],
    most: Float64[np.ndarray, " k"],
) -> tuple[float, Float64[np.ndarray, " k"]]:
    """Find `0 <= sizes <= most`, clipped in turn, whose columns come near a target along `null`."""
    # SciPy's optimizers take long to import, and no tick needs them.
    from scipy.optimize import nnls

    outside, left = null.T @ columns, null.T @ target
    # Rounding times a huge multiplier would balance anything.
    outside[:, np.linalg.norm(outside, axis=0) <= RANK_TOLERANCE] = 0.0
    sizes, open_ = np.zeros(len(most)), np.ones(len(most), dtype=np.bool_)
    while len(left) and open_.any():
        sizes[open_], _ = nnls(outside[:, open_], left, maxiter=30 * len(most) + 300)
        over = open_ & (sizes > most)
        if not over.any():
            break
        sizes[over], open_ = most[over], open_ & ~over
        left = left - outside[:, over] @ sizes[over]
    return float(np.linalg.norm(null.T @ target - outside @ sizes)), sizes


def _null_space(
    rows: Float64[np.ndarray, "k n"], norms: Float64[np.ndarray, " k"]
) -> Float64[np.ndarray, "n d"]:
    """Return an orthonormal basis of the null space of the rows."""
    kept = norms > 0.0
    if not kept.any():
        return np.eye(rows.shape[1])
    unit = rows[kept] / norms[kept, None]
    _, singular, V = np.linalg.svd(unit)
    return V[np.count_nonzero(singular > RANK_TOLERANCE * singular[0]) :].T
