"""`guess.py` in plain NumPy, to be read and to be compared with."""

import numpy as np
import scipy.linalg
from jaxtyping import Bool, Float64, Int64

from poise.hqp import HierarchicalProblem
from poise.hqp._active_set.workspace import EQUALITY
from poise.hqp._tolerances import (
    CORRECTIONS,
    FLOOR,
    GUESS_SLACK_TOLERANCE,
    GUESS_TOLERANCE,
    HARD,
    HOLDING_RATIO,
    RIDGE,
    SOFT,
    UNMET_RATIO,
)


def guess(
    problem: HierarchicalProblem,
    lower: Float64[np.ndarray, " nm"],
    upper: Float64[np.ndarray, " nm"],
    side: Int64[np.ndarray, " nm"],
    needed: Int64[np.ndarray, " nm"],
) -> Int64[np.ndarray, " nm"]:
    """Guess the sides of all rows.

    Args:
        problem: the problem.
        lower: its lower bounds, moved by damping.
        upper: likewise.
        side: of all rows in the last active set.
        needed: which level, counted from one, needed them active; 0 where nobody knows.
    """
    return _Guess(problem, lower, upper).run(side, needed)


class _Guess:
    def __init__(
        self,
        problem: HierarchicalProblem,
        lower: Float64[np.ndarray, " nm"],
        upper: Float64[np.ndarray, " nm"],
    ) -> None:
        self.problem, self.lower, self.upper = problem, lower, upper
        n, trace = problem.n, float(np.trace(problem.H))
        ridge = RIDGE * trace / n if trace > 0.0 else 1.0
        C = np.linalg.cholesky(problem.H + ridge * np.eye(n))
        a = np.vstack([np.eye(n), problem.A])
        self.M = scipy.linalg.solve_triangular(C, a.T, lower=True).T
        self.norms = np.linalg.norm(self.M, axis=1)
        self.start = a @ -scipy.linalg.cho_solve((C, True), problem.g)
        self.compliance, self.moved, self.held = np.zeros((3, len(a)))
        self.side = np.zeros(len(a), dtype=np.int64)
        self.sign_free = problem.equality.copy()
        self.active: list[int] = []
        self.multipliers = np.zeros(len(a))
        self.y = np.zeros(n)

    def run(
        self, side: Int64[np.ndarray, " nm"], needed: Int64[np.ndarray, " nm"]
    ) -> Int64[np.ndarray, " nm"]:
        """Add level after level."""
        problem, last = self.problem, len(self.problem.levels)
        known = np.where(needed == 0, last, needed) * (np.abs(side) == 1)
        for level in range(last):
            mine = problem.level_of == level
            sizes = self.norms[mine] * problem.weights[mine]
            if not (sizes > 0.0).any():
                continue
            unit = float(np.mean(sizes[sizes > 0.0] ** 2)) / problem.weights[mine] ** 2
            self.compliance[mine] = SOFT * unit
            needed = (known == level + 1) & (problem.level_of <= level)
            self._activate_needed((mine & problem.equality) | needed, side)
            self._deactivate_wrong()
            self._activate_violated(level)
            slack = self._slack(mine)
            if slack > 0.0:
                self._correct(np.zeros(len(side), dtype=np.bool_))
                self._activate_violated(level)
                if self._slack(mine) > UNMET_RATIO * slack:
                    for _ in range(CORRECTIONS):
                        self._correct(mine)
                        self._activate_violated(level)
            self._hold(mine)
            self.compliance[mine] = HARD * self.norms[mine] ** 2
            self._move_bounds(np.zeros(len(side), dtype=np.bool_))
        self.side[problem.equality] = EQUALITY
        return self.side

    def _activate_violated(self, level: int) -> None:
        """Let rows down to a level enter until none is violated."""
        for _ in range(2 * len(self.side)):
            self.y = -self.M.T @ self.multipliers
            row = self._most_violated(self.problem.level_of <= level)
            if row < 0 or len(self.active) == self._room():
                break
            self._activate(row)

    def _correct(self, left_out: Bool[np.ndarray, " nm"]) -> None:
        """Move bounds by -D lambda, but for some."""
        self._move_bounds(left_out)
        self._deactivate_wrong()

    def _move_bounds(self, left_out: Bool[np.ndarray, " nm"]) -> None:
        moved = self.held - np.where(left_out, 0.0, self.compliance * self.multipliers)
        self.moved[self.active] = moved[self.active]

    def _missed(self) -> Float64[np.ndarray, " nm"]:
        """How far rows are from their bounds."""
        return self.compliance * self.multipliers + self.moved

    def _slack(self, mine: Bool[np.ndarray, " nm"]) -> float:
        """What a level's active rows miss, weighted; zero where that is next to nothing."""
        own, weights = [row for row in self.active if mine[row]], self.problem.weights
        slack = float(np.linalg.norm((self._missed() * weights)[own]))
        size = float((self.norms * weights)[own].max(initial=0.0))
        return slack if slack > GUESS_SLACK_TOLERANCE * size * np.linalg.norm(self.y) else 0.0

    def _room(self) -> int:
        return min(3 * self.problem.n, len(self.side))

    def _activate_needed(
        self, rows: Bool[np.ndarray, " nm"], side: Int64[np.ndarray, " nm"]
    ) -> None:
        """Make rows active, equalities and those that were."""
        found = np.flatnonzero(rows & (self.side == 0) & (self.norms > 0.0))
        found = found[: self._room() - len(self.active)]
        self.side[found] = np.where(self.problem.equality[found], EQUALITY, side[found])
        self.active += found.tolist()

    def _deactivate_wrong(self) -> None:
        """Find the multipliers, and deactivate rows until none of them has the wrong sign."""
        found = self._solve()
        while (wrong := (found * self.side < 0.0) & ~self.sign_free).any():
            for row in np.flatnonzero(wrong).tolist():
                self._deactivate(row)
            found = self._solve()
        self.multipliers = found

    def _solve(self) -> Float64[np.ndarray, " nm"]:
        """Multipliers of the active rows, zero for the others."""
        rows, found = np.array(self.active, dtype=np.int64), np.zeros(len(self.side))
        if len(rows) == 0:
            return found
        bound = np.where(self.side > 0, self.upper, self.lower) + self.moved
        L = self._factor(rows)
        found[rows] = scipy.linalg.cho_solve((L, True), (self.start - bound)[rows])
        return found

    def _factor(self, rows: Int64[np.ndarray, " k"]) -> Float64[np.ndarray, "k k"]:
        """Cholesky factor of the active rows' system, with pivots that are not too small."""
        M, L = self.M[rows], np.zeros((len(rows), len(rows)))
        for k in range(len(rows)):
            if k > 0:
                L[k, :k] = scipy.linalg.solve_triangular(L[:k, :k], M[:k] @ M[k], lower=True)
            square = self.norms[rows[k]] ** 2
            left = square + self.compliance[rows[k]] - L[k, :k] @ L[k, :k]
            L[k, k] = np.sqrt(max(left, FLOOR * square))
        return L

    def _most_violated(self, allowed: Bool[np.ndarray, " nm"]) -> int:
        """The inactive row that is violated most, relative to its size; or -1."""
        values = self.start + self.M @ self.y
        over = np.maximum(values - self.problem.upper, self.problem.lower - values)
        open_to = allowed & (self.side == 0) & (self.norms > 0.0)
        over[~open_to] = -np.inf
        ratio = over / np.where(self.norms > 0.0, self.norms, 1.0)
        row = int(ratio.argmax())
        if not ratio[row] > GUESS_TOLERANCE * np.linalg.norm(self.y):
            return -1
        self.sign = 1 if values[row] > self.problem.upper[row] else -1
        return row

    def _activate(self, row: int) -> None:
        """Make a violated row active, and deactivate those whose multiplier changes its sign."""
        self.side[row] = self.sign
        self.active.append(row)
        while True:
            step = self._solve() - self.multipliers
            turning = ((self.multipliers + step) * self.side < 0.0) & ~self.sign_free
            turning[row] = False
            if not turning.any():
                self.multipliers += step
                return
            rows = np.flatnonzero(turning)
            ratios = self.multipliers[rows] / -step[rows]
            self.multipliers += ratios.min() * step
            self._deactivate(int(rows[ratios.argmin()]))

    def _deactivate(self, row: int) -> None:
        self.active.remove(row)
        self.side[row], self.multipliers[row] = 0, 0.0
        self.moved[row] = self.held[row]

    def _hold(self, mine: Bool[np.ndarray, " nm"]) -> None:
        """Hold what a level reached: where it has slack, its rows and those holding it up stay."""
        weights = self.problem.weights
        active = np.zeros(len(self.side), dtype=np.bool_)
        active[self.active] = True
        own = mine & active
        missed, slack = self._missed(), self._slack(mine)
        if slack == 0.0:
            return
        strength = np.abs(self.multipliers) * self.norms
        self.sign_free |= active & (strength > HOLDING_RATIO * strength[own].max())
        self.sign_free |= own & (np.abs(missed) * weights > HOLDING_RATIO * slack)
        self.held[own] = missed[own]
