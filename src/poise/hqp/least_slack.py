"""The least slack of one level: `min |w|^2` over soft rows, subject to hard inequalities.

    min_z  sum_i dist(s_i z, [sl_i, su_i])^2    s.t.   cl <= C z <= cu

A primal active-set method on the exact, merely semidefinite problem. The cost is a continuously
differentiable piecewise quadratic: at any moment the soft rows outside their interval (and the
equalities) form one least-squares problem, solved by an orthogonal factorisation in the null space
of the hard rows held at their bounds. No regulariser takes part, so none can swallow a task.
"""

from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np
import scipy.linalg
from jaxtyping import Bool, Float64, Int

_linalg: Any = scipy.linalg  # its stubs do not tell the modes of qr apart

RANK_TOLERANCE = 1e-10
"""Singular values below this, relative to the largest row of the level as the user wrote it, are
zero: what is left of an exactly dependent row after two projections is near 1e-15."""

_DUAL_TOLERANCE = 1e-10
"""Multipliers of the wrong sign below this, relative to the forces that balance, are zero."""

_CLEAR_MULTIPLIER = 1e-7
"""Multipliers above this share of the level's forces are certainly positive, so that their rows are
held at every optimum. Fixing fewer rows is safe, fixing one too many is not."""

_STEP_TOLERANCE = 1e-10
"""A row that a whole step would move by less than this share of its size does not block it."""


_CHANGES_A_ROW = 4
"""Active-set changes, for each row and variable, after which the search ends with the best point
so far: those seen took less than one, and one that cycles must not hold a controller for long."""


@dataclass(frozen=True, slots=True)
class Rows:
    """Two-sided rows `lower <= A z <= upper`."""

    A: Float64[np.ndarray, "m d"]
    lower: Float64[np.ndarray, " m"]
    upper: Float64[np.ndarray, " m"]


@dataclass(frozen=True, slots=True)
class LeastSlack:
    """Where the least slack is reached.

    Attributes:
        z: a minimiser.
        slack: signed distance of the soft rows outside their interval.
        held: signed side of each hard row that carries a clear multiplier: 1 upper, -1 lower.
        converged: whether the optimality conditions hold.
        iterations: active-set changes.
    """

    z: Float64[np.ndarray, " d"]
    slack: Float64[np.ndarray, " ms"]
    held: Int[np.ndarray, " mh"]
    converged: bool
    iterations: int


def least_slack(
    soft: Rows,
    hard: Rows,
    start: Float64[np.ndarray, " d"],
    sizes: Float64[np.ndarray, " ms"],
    deadline: float = np.inf,
    held: Int[np.ndarray, " mh"] | None = None,
) -> LeastSlack:
    """Minimise the soft rows' slack from a point that meets the hard rows.

    Args:
        soft: rows of the level, multiplied by their weights.
        hard: inequalities that must keep holding.
        start: a point that meets the hard rows.
        sizes: norms of the soft rows before any reduction, the unit of what is zero: what a
            reduction leaves of a dependent row is rounding, and so are the forces from it.
        deadline: `perf_counter` time after which the best point so far is returned [s].
        held: hard rows that are believed to be held at `start`: 1 upper, -1 lower, 0 not.
    """
    return _Search(soft, hard, start, sizes, held).run(deadline)


def predicted_slack(
    soft: Rows,
    hard: Rows,
    sizes: Float64[np.ndarray, " ms"],
    sides: Int[np.ndarray, " ms"],
    held: Int[np.ndarray, " mh"],
) -> LeastSlack | None:
    """Solve for the least slack on a predicted active set, without a search.

    The answer meets the level's optimality conditions, dual signs included, but for one: whether
    some point with this slack meets all hard rows and keeps the other soft rows inside. The caller
    has to find such a point.

    Args:
        soft: rows of the level, multiplied by their weights.
        hard: inequalities that must hold.
        sizes: norms of the soft rows before any reduction.
        sides: predicted side of each soft inequality: 1 above, -1 below, 0 inside.
        held: predicted side of each hard row that is held at a bound.

    Returns:
        The minimiser on this active set, or None if a sign says that the prediction is wrong.
    """
    search = _Search(soft, hard, np.zeros(soft.A.shape[1]), sizes, held)
    return search.settle(sides)


class _Search:
    """State of one active-set search."""

    def __init__(
        self,
        soft: Rows,
        hard: Rows,
        start: Float64[np.ndarray, " d"],
        sizes: Float64[np.ndarray, " ms"],
        held: Int[np.ndarray, " mh"] | None,
    ) -> None:
        self.soft, self.hard = soft, hard
        self.z = start.copy()
        self.sizes = sizes
        self.cutoff = RANK_TOLERANCE * float(sizes.max(initial=0.0))
        self.equality = soft.lower == soft.upper
        self.soft_norms = np.linalg.norm(soft.A, axis=1)
        self.hard_norms = np.linalg.norm(hard.A, axis=1)
        self.order: list[int] = []  # held hard rows, oldest first
        self.side = np.zeros(len(hard.lower), dtype=np.int64)
        values = soft.A @ self.z
        self.soft_side = np.where(values > soft.upper, 1, np.where(values < soft.lower, -1, 0))
        if held is not None:
            self._adopt(held)

    def run(self, deadline: float) -> LeastSlack:
        """Alternate least-squares steps and changes of the active set until nothing improves."""
        limit = 50 + _CHANGES_A_ROW * (len(self.side) + len(self.soft_side) + len(self.z))
        multipliers, force = np.zeros(0), 0.0
        converged = False
        iteration = 0
        for iteration in range(1, limit + 1):
            active = self.equality | (self.soft_side != 0)
            q1, q2, r = self._factor()
            step = self._step(active, q2)
            if self._advance(step, active):
                continue
            released = self._release_soft()
            multipliers, force = self._multipliers(q1, r, self._slack())
            # Rows released from the soft set change neither cost nor gradient at this point by
            # more than they should: look at hard rows only once the soft set has settled.
            if not released and not self._release_hard(multipliers, force, iteration > limit // 2):
                converged = True
                break
            if perf_counter() > deadline:
                break
        held = self._clear(multipliers, force) if converged else np.zeros_like(self.side)
        return LeastSlack(self.z, self._slack(), held, converged, iteration)

    def settle(self, sides: Int[np.ndarray, " ms"]) -> LeastSlack | None:
        """Take one step to the optimum of a given active set; None if its signs are wrong."""
        self.soft_side = np.where(self.equality, 0, sides)
        active = self.equality | (self.soft_side != 0)
        bounds = np.where(self.side > 0, self.hard.upper, self.hard.lower)[self.order]
        if not (np.isfinite(bounds).all() and np.isfinite(self._targets()[active]).all()):
            return None
        q1, q2, r = self._factor()
        if self.order:
            self.z = q1 @ _linalg.solve_triangular(r, bounds, trans=1, check_finite=False)
        self.z = self.z + self._step(active, q2)
        slack = np.where(active, self.soft.A @ self.z - self._targets(), 0.0)
        multipliers, force = self._multipliers(q1, r, slack)
        if (self.soft_side * slack <= 0.0)[self.soft_side != 0].any():
            return None
        if self._release_hard(multipliers, force, careful=False):
            return None
        return LeastSlack(self.z, slack, self._clear(multipliers, force), True, 1)

    def _adopt(self, held: Int[np.ndarray, " mh"]) -> None:
        """Hold the rows that the caller believes in, as far as they are independent."""
        candidates = np.flatnonzero(held)
        if len(candidates) == 0:
            return
        normals = self.hard.A[candidates] / np.maximum(self.hard_norms[candidates], 1e-300)[:, None]
        r, pivots = _linalg.qr(normals.T, mode="r", pivoting=True)
        diagonal = np.abs(np.diagonal(r))
        rank = int(np.count_nonzero(diagonal > 1e-8))
        self.order = [int(candidates[i]) for i in pivots[:rank]]
        self.side[self.order] = held[self.order]

    def _clear(
        self, multipliers: Float64[np.ndarray, " r"], force: float
    ) -> Int[np.ndarray, " mh"]:
        """Return the sides of the held rows whose multiplier is certainly positive."""
        held = np.zeros_like(self.side)
        if self.order:
            pushes = np.abs(multipliers) * self.hard_norms[self.order]
            clear = pushes > max(_CLEAR_MULTIPLIER * force, 100.0 * self._noise())
            rows = np.array(self.order)[clear]
            held[rows] = self.side[rows]
        return held

    def _factor(
        self,
    ) -> tuple[Float64[np.ndarray, "d r"], Float64[np.ndarray, "d k"], Float64[np.ndarray, "r r"]]:
        """Factor the held hard rows: range, null space and triangle."""
        d, count = len(self.z), len(self.order)
        if count == 0:
            return np.zeros((d, 0)), np.eye(d), np.zeros((0, 0))
        q, r = _linalg.qr(self.hard.A[self.order].T, check_finite=False)
        return q[:, :count], q[:, count:], r[:count]

    def _targets(self) -> Float64[np.ndarray, " ms"]:
        return np.where(self.soft_side >= 0, self.soft.upper, self.soft.lower)

    def _step(
        self, active: Bool[np.ndarray, " ms"], null: Float64[np.ndarray, "d k"]
    ) -> Float64[np.ndarray, " d"]:
        """Return the least-norm step to the minimum of the active rows' squares."""
        if null.shape[1] == 0 or not active.any():
            return np.zeros_like(self.z)
        rows = self.soft.A[active]
        residual = self._targets()[active] - rows @ self.z
        u, s, vt = np.linalg.svd(rows @ null, full_matrices=False)
        keep = s > self.cutoff
        return null @ (vt[keep].T @ ((u[:, keep].T @ residual) / s[keep]))

    def _advance(self, step: Float64[np.ndarray, " d"], active: Bool[np.ndarray, " ms"]) -> bool:
        """Move along the step as far as the rows allow; return whether a row stopped it."""
        length = float(np.linalg.norm(step))
        if length == 0.0:
            return False
        hard_alpha = _room(self.hard, self.hard_norms, self.z, step, self.side != 0)
        soft_alpha = _room(self.soft, self.soft_norms, self.z, step, active)
        best_hard = float(hard_alpha.min(initial=np.inf))
        best_soft = float(soft_alpha.min(initial=np.inf))
        alpha = min(1.0, best_hard, best_soft)
        self.z = self.z + alpha * step
        if alpha >= 1.0:
            return False
        if best_hard <= best_soft:
            row = int(hard_alpha.argmin())
            self.order.append(row)
            self.side[row] = 1 if float(self.hard.A[row] @ step) > 0.0 else -1
        else:
            row = int(soft_alpha.argmin())
            self.soft_side[row] = 1 if float(self.soft.A[row] @ step) > 0.0 else -1
        return True

    def _release_soft(self) -> bool:
        """Update the side of soft rows that left theirs; return whether there were any.

        A row may have come back inside, or have gone through to the other side.
        """
        values = self.soft.A @ self.z
        tolerance = 1e-13 * self.soft_norms * float(np.linalg.norm(self.z))
        left = (self.soft_side > 0) & (values < self.soft.upper - tolerance)
        left |= (self.soft_side < 0) & (values > self.soft.lower + tolerance)
        left &= ~self.equality
        above, below = values > self.soft.upper, values < self.soft.lower
        self.soft_side[left] = above[left].astype(np.int64) - below[left].astype(np.int64)
        return bool(left.any())

    def _multipliers(
        self,
        q1: Float64[np.ndarray, "d r"],
        r: Float64[np.ndarray, "r r"],
        slack: Float64[np.ndarray, " ms"],
    ) -> tuple[Float64[np.ndarray, " r"], float]:
        """Return the held rows' multipliers and the size of the forces that balance."""
        force = float(np.abs(slack * self.sizes).max(initial=0.0))
        if not self.order:
            return np.zeros(0), force
        gradient = self.soft.A.T @ slack
        return scipy.linalg.solve_triangular(r, -(q1.T @ gradient), check_finite=False), force

    def _release_hard(
        self, multipliers: Float64[np.ndarray, " r"], force: float, careful: bool
    ) -> bool:
        """Let go of one held row whose multiplier has the wrong sign; return whether there was."""
        if not self.order:
            return False
        signed = multipliers * self.side[self.order] * self.hard_norms[self.order]
        wrong = np.flatnonzero(signed < -max(_DUAL_TOLERANCE * force, self._noise()))
        if len(wrong) == 0:
            return False
        # The most negative is quickest; the lowest index (Bland) cannot cycle.
        if careful:
            position = min(wrong.tolist(), key=lambda i: self.order[i])
        else:
            position = int(signed.argmin())
        self.side[self.order.pop(position)] = 0
        return True

    def _noise(self) -> float:
        """Forces below this are rounding of the rows themselves."""
        size = float((np.abs(self.soft.A) @ np.abs(self.z)).max(initial=1.0))
        return 1e-12 * size * float(self.sizes.max(initial=0.0))

    def _slack(self) -> Float64[np.ndarray, " ms"]:
        values = self.soft.A @ self.z
        slack: Float64[np.ndarray, " ms"] = np.maximum(values - self.soft.upper, 0.0)
        slack -= np.maximum(self.soft.lower - values, 0.0)
        return slack


def _room(
    rows: Rows,
    norms: Float64[np.ndarray, " m"],
    z: Float64[np.ndarray, " d"],
    step: Float64[np.ndarray, " d"],
    ignored: Bool[np.ndarray, " m"],
) -> Float64[np.ndarray, " m"]:
    """Return how much of the step each row allows before it would leave its interval."""
    rate = rows.A @ step
    values = rows.A @ z
    moving = (np.abs(rate) > _STEP_TOLERANCE * norms * float(np.linalg.norm(step))) & ~ignored
    gap = np.where(rate > 0.0, rows.upper - values, values - rows.lower)
    alpha = np.full(len(rate), np.inf)
    alpha[moving] = np.maximum(gap[moving], 0.0) / np.abs(rate[moving])
    return alpha
