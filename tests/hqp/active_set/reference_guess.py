"""`guess.py` in plain NumPy, to be read and to be compared with."""

import numpy as np
import scipy.linalg
from jaxtyping import Bool, Float64, Int64

from poise.hqp._tolerances import (
    CORRECTIONS,
    FIRM_SHARE,
    FLOOR,
    GUESS_TOLERANCE,
    HARD,
    MET_SHARE,
    MET_TOLERANCE,
    RIDGE,
    SOFT,
)
from poise.hqp._active_set.workspace import EQUALITY
from poise.hqp import HierarchicalProblem


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
        self.size = np.linalg.norm(self.M, axis=1)
        self.values_0 = a @ -scipy.linalg.cho_solve((C, True), problem.g)
        self.D, self.gap, self.settled = np.zeros(len(a)), np.zeros(len(a)), np.zeros(len(a))
        self.side = np.zeros(len(a), dtype=np.int64)
        self.firm = problem.equality.copy()
        self.active: list[int] = []
        self.pushes = np.zeros(len(a))
        self.y = np.zeros(n)

    def run(
        self, side: Int64[np.ndarray, " nm"], needed: Int64[np.ndarray, " nm"]
    ) -> Int64[np.ndarray, " nm"]:
        """Add level after level."""
        problem, last = self.problem, len(self.problem.levels)
        known = np.where(needed == 0, last, needed) * (np.abs(side) == 1)
        for level in range(last):
            mine = problem.level_of == level
            sizes = self.size[mine] * problem.weights[mine]
            if not (sizes > 0.0).any():
                continue
            unit = float(np.mean(sizes[sizes > 0.0] ** 2)) / problem.weights[mine] ** 2
            self.D[mine] = SOFT * unit
            equalities = mine & problem.equality
            self._add(equalities | ((known == level + 1) & (problem.level_of <= level)), side)
            self._drop_wrong()
            self._converge(level)
            slack = self._slack(mine)
            if slack > 0.0:
                self._correct(np.zeros(len(side), dtype=np.bool_))
                self._converge(level)
                if self._slack(mine) > MET_SHARE * slack:
                    for _ in range(CORRECTIONS):
                        self._correct(mine)
                        self._converge(level)
            self._settle(mine)
            self.D[mine] = HARD * self.size[mine] ** 2
            self._move_bounds(np.zeros(len(side), dtype=np.bool_))
        self.side[problem.equality] = EQUALITY
        return self.side

    def _converge(self, level: int) -> None:
        """Let rows down to a level enter until none is violated."""
        for _ in range(2 * len(self.side)):
            self.y = -self.M.T @ self.pushes
            row = self._most_violated(self.problem.level_of <= level)
            if row < 0 or len(self.active) == self._room():
                break
            self._enter(row)

    def _correct(self, left_out: Bool[np.ndarray, " nm"]) -> None:
        """Take back what rows give way, but for some."""
        self._move_bounds(left_out)
        self._drop_wrong()

    def _move_bounds(self, left_out: Bool[np.ndarray, " nm"]) -> None:
        moved = self.settled - np.where(left_out, 0.0, self.D * self.pushes)
        self.gap[self.active] = moved[self.active]

    def _missed(self) -> Float64[np.ndarray, " nm"]:
        """How far rows are from their bounds."""
        return self.D * self.pushes + self.gap

    def _slack(self, mine: Bool[np.ndarray, " nm"]) -> float:
        """What a level's active rows miss, weighted; zero where that is next to nothing."""
        own, weights = [row for row in self.active if mine[row]], self.problem.weights
        slack = float(np.linalg.norm((self._missed() * weights)[own]))
        size = float((self.size * weights)[own].max(initial=0.0))
        return slack if slack > MET_TOLERANCE * size * np.linalg.norm(self.y) else 0.0

    def _room(self) -> int:
        return min(3 * self.problem.n, len(self.side))

    def _add(self, rows: Bool[np.ndarray, " nm"], side: Int64[np.ndarray, " nm"]) -> None:
        """Make rows active, equalities and those that were."""
        found = np.flatnonzero(rows & (self.side == 0) & (self.size > 0.0))
        found = found[: self._room() - len(self.active)]
        self.side[found] = np.where(self.problem.equality[found], EQUALITY, side[found])
        self.active += found.tolist()

    def _drop_wrong(self) -> None:
        """Find the multipliers, and let go of rows until none of them has the wrong sign."""
        found = self._solve()
        while (wrong := (found * self.side < 0.0) & ~self.firm).any():
            for row in np.flatnonzero(wrong).tolist():
                self._drop(row)
            found = self._solve()
        self.pushes = found

    def _solve(self) -> Float64[np.ndarray, " nm"]:
        """Multipliers of the active rows, zero for the others."""
        rows, found = np.array(self.active, dtype=np.int64), np.zeros(len(self.side))
        if len(rows) == 0:
            return found
        bound = np.where(self.side > 0, self.upper, self.lower) + self.gap
        L = self._factor(rows)
        found[rows] = scipy.linalg.cho_solve((L, True), (self.values_0 - bound)[rows])
        return found

    def _factor(self, rows: Int64[np.ndarray, " k"]) -> Float64[np.ndarray, "k k"]:
        """Cholesky factor of the active rows' system, with pivots that are not too small."""
        M, L = self.M[rows], np.zeros((len(rows), len(rows)))
        for k in range(len(rows)):
            if k > 0:
                L[k, :k] = scipy.linalg.solve_triangular(L[:k, :k], M[:k] @ M[k], lower=True)
            square = self.size[rows[k]] ** 2
            left = square + self.D[rows[k]] - L[k, :k] @ L[k, :k]
            L[k, k] = np.sqrt(max(left, FLOOR * square))
        return L

    def _most_violated(self, allowed: Bool[np.ndarray, " nm"]) -> int:
        """The inactive row that is violated most, relative to its size; or -1."""
        values = self.values_0 + self.M @ self.y
        over = np.maximum(values - self.problem.upper, self.problem.lower - values)
        open_to = allowed & (self.side == 0) & (self.size > 0.0)
        over[~open_to] = -np.inf
        share = over / np.where(self.size > 0.0, self.size, 1.0)
        row = int(share.argmax())
        if not share[row] > GUESS_TOLERANCE * np.linalg.norm(self.y):
            return -1
        self.sign = 1 if values[row] > self.problem.upper[row] else -1
        return row

    def _enter(self, row: int) -> None:
        """Make a violated row active, and let go of those whose multipliers turn on the way."""
        self.side[row] = self.sign
        self.active.append(row)
        while True:
            step = self._solve() - self.pushes
            turning = ((self.pushes + step) * self.side < 0.0) & ~self.firm
            turning[row] = False
            if not turning.any():
                self.pushes += step
                return
            rows = np.flatnonzero(turning)
            shares = self.pushes[rows] / -step[rows]
            self.pushes += shares.min() * step
            self._drop(int(rows[shares.argmin()]))

    def _drop(self, row: int) -> None:
        self.active.remove(row)
        self.side[row], self.pushes[row] = 0, 0.0
        self.gap[row] = self.settled[row]

    def _settle(self, mine: Bool[np.ndarray, " nm"]) -> None:
        """Hold what a level reached: where it has slack, its rows and those in its way stay."""
        weights = self.problem.weights
        active = np.zeros(len(self.side), dtype=np.bool_)
        active[self.active] = True
        own = mine & active
        missed, slack = self._missed(), self._slack(mine)
        if slack == 0.0:
            return
        strength = np.abs(self.pushes) * self.size
        self.firm |= active & (strength > FIRM_SHARE * strength[own].max())
        self.firm |= own & (np.abs(missed) * weights > FIRM_SHARE * slack)
        self.settled[own] = missed[own]
