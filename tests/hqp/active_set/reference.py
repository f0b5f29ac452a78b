"""The algorithm of the active-set solver in plain NumPy, to be read and to be compared with.

It follows Escande, Mansard, Wieber 2014 ("Hierarchical quadratic programming: Fast online
humanoid-robot motion generation") and Dimitrov, Sherikov, Wieber 2015 ("Efficient resolution of
potentially conflicting linear constraints in robotics"): one active set for all levels, one
factorisation a step. `search.py` is the same with loops written out, and with less work done twice,
but that it guards nearly dependent rows.
"""

from dataclasses import dataclass, field

import numpy as np
import scipy.linalg
from jaxtyping import Bool, Float64, Int64

from poise.hqp import HierarchicalProblem
from poise.hqp._active_set.multipliers import FIRST, LARGEST
from poise.hqp._active_set.workspace import EQUALITY, GUESS, LAST, NOTHING
from poise.hqp._tolerances import (
    ADD_RATIOS,
    ASTRAY,
    CANCELLATION,
    COLD_CHANGES,
    DEPENDENCE_TOLERANCE,
    DROP_RATIOS,
    DUAL_TOLERANCE,
    FEASIBILITY_TOLERANCE,
    FLAT_TOLERANCE,
    LEAP_PATIENCE,
    MANY,
    MOST_EXCHANGES,
    MOST_LEAPS,
    MOVE_TOLERANCE,
    OPTIMALITY_TOLERANCE,
    PATIENCE,
    RANK_TOLERANCE,
    RESIGNED,
    SAME_TOLERANCE,
    SLACK_TOLERANCE,
    STEEP,
    WARM_CHANGES,
    changes_allowed,
)

from .reference_guess import guess


@dataclass(slots=True)
class _LevelFactor:
    """What one level's active rows are in the coordinates y = Q^T x.

    Attributes:
        rows: active rows; the first `rank` of them are the pivots.
        first: how many coordinates the levels above have taken.
        rank: how many this level takes.
        R: the rows in y, times their weights: zero from column `first + rank` on.
        slack: weighted slack of the rows at the optimum.
    """

    rows: Int64[np.ndarray, " k"]
    first: int
    rank: int
    R: Float64[np.ndarray, "k n"]
    slack: Float64[np.ndarray, " k"] = field(default_factory=lambda: np.zeros(0))

    @property
    def triangle(self) -> Float64[np.ndarray, "r r"]:
        """The pivots' own lower triangle."""
        return self.R[: self.rank, self.first : self.first + self.rank]


@dataclass(frozen=True, slots=True)
class Found:
    """Where the search ended.

    Attributes:
        x: the point.
        side: of every bound and row: 1 active at its upper bound, -1 at its lower one,
            2 an equality, 0 inactive.
        multipliers: of every level, then of the final cost, over bounds and rows.
        changes: of the active set, or factorisations.
        converged: whether the conditions hold that make x the optimum.
    """

    x: Float64[np.ndarray, " n"]
    side: Int64[np.ndarray, " nm"]
    multipliers: Float64[np.ndarray, "p1 nm"]
    changes: int
    converged: bool


def search(
    problem: HierarchicalProblem,
    side: Int64[np.ndarray, " nm"] | None = None,
    damping: float = 0.0,
) -> Found:
    """Solve a sound problem.

    Args:
        problem: finite coefficients, bounds that do not cross.
        side: active set to begin with, as in `Found`.
        damping: of all levels.
    """
    return _Search(problem, side, damping).run()


class _Search:
    def __init__(
        self,
        problem: HierarchicalProblem,
        side: Int64[np.ndarray, " nm"] | None,
        damping: float,
    ) -> None:
        self.problem = problem
        n, m = problem.n, problem.m
        self.a = np.vstack([np.eye(n), problem.A])
        self.norms = np.linalg.norm(self.a, axis=1)
        self.lower, self.upper = problem.lower, problem.upper
        self.side = np.zeros(n + m, dtype=np.int64) if side is None else side.copy()
        self.side[(self.side == 1) & (self.upper == np.inf)] = 0
        self.side[(self.side == -1) & (self.lower == -np.inf)] = 0
        self.side[self.side == EQUALITY] = 0
        self.side[problem.equality] = EQUALITY
        # Rows whose multiplier has the right sign already may have any sign further down.
        self.sign_free = problem.equality.copy()
        # Rows that came back at once when they were deactivated, until the point has moved.
        self.locked = np.zeros(n + m, dtype=np.bool_)
        self.released = self.locked.copy()
        self.deactivated = -1
        self.multipliers = np.zeros((len(problem.levels) + 1, n + m))
        self.needed_by = np.zeros(n + m, dtype=np.int64)
        self.x, self.values = np.zeros(n), np.zeros(n + m)
        self.blocked = self.doubt = False
        self.fewest = self.since = self.idle = self.turn = 0
        known = bool((np.abs(self.side) == 1).any())
        self.origin, self.guess_at = LAST, WARM_CHANGES if known else COLD_CHANGES
        if damping > 0.0:
            self._damp_equalities(damping)

    def run(self) -> Found:
        """Go to the optimum of one active set after the other."""
        limit = changes_allowed(self.problem.n, self.problem.m)
        self.change = self._begin
        for changes in range(1, limit + 1):
            self.changes = changes
            self.target = self._optimum()
            self.goal = self.a @ self.target
            optimal = self.change()
            if optimal and (self.origin == NOTHING or not self.doubt):
                x, side, found = self.target, self.side, self.multipliers
                return Found(x, side, found, changes, not self.doubt)
            if self.origin == LAST and (optimal or changes == self.guess_at):
                self.side = guess(self.problem, self.lower, self.upper, self.side, self.needed_by)
                self.origin = GUESS
            elif self.origin == GUESS and (optimal or changes >= ASTRAY):
                self.side = np.where(self.side == EQUALITY, EQUALITY, 0)
                self.origin = NOTHING
            else:
                continue
            self.sign_free = self.problem.equality.copy()
            self.idle, self.turn, self.since, self.deactivated = 0, 0, 0, -1
            self.locked[:] = self.released[:] = False
            self.change = self._begin
        return Found(self.x, self.side, self.multipliers, limit, False)

    def _begin(self) -> bool:
        """Choose how to go on by how much is wrong; return whether nothing is."""
        violations, before = self._violations(self.target, self.goal), self.side.copy()
        self._deactivate_wrong_signs(0.0)
        wrong_sign = np.count_nonzero((before != 0) & (self.side != before))
        wrong = np.count_nonzero(violations) + wrong_sign
        # Slack makes any point one to begin from.
        if wrong == 0 or self._is_better():
            self.x, self.values = self.target, self.goal
        self.change, self.turn = self._step, 1
        if 0 < wrong <= MANY and wrong_sign == 0 and self.origin != NOTHING:
            self.change = self._exchange
            self._activate(violations, 0.0)
        elif wrong <= MANY or self.origin == NOTHING:
            self._activate(self._violations(self.x, self.values), 0.0)
        else:
            if self.origin == LAST:
                # One leap may do where rows are only missing.
                self.guess_at = self.changes + (wrong_sign == 0)
            self.change, self.fewest = self._leap, wrong
            self._activate(violations, ADD_RATIOS[0])
        return bool(wrong == 0)

    # --- exchanges and leaps ------------------------------------------------------------------

    def _exchange(self) -> bool:
        """Drop the largest multiplier of the wrong sign, or else add the worst violation."""
        violations = self._violations(self.target, self.goal)
        dropped = self._deactivate_wrong_signs(LARGEST)
        optimal = not dropped and not violations.any()
        if optimal or self._is_better():
            self.x, self.values = self.target, self.goal
        if optimal:
            return True
        self.turn += 1
        if self.turn == MOST_EXCHANGES:
            self._begin_steps()
        elif not dropped:
            self._activate(violations, 1.0)
        return False

    def _leap(self) -> bool:
        """Change many rows at once; return whether there was nothing to change."""
        turn, before = self.turn, self.side.copy()
        self.turn += 1
        violations = self._violations(self.target, self.goal)
        dropped = self._deactivate_wrong_signs(DROP_RATIOS[turn % len(DROP_RATIOS)])
        if not dropped and not violations.any():
            return True
        if self._is_better():
            self.x, self.values = self.target, self.goal
        wrong = np.count_nonzero(violations) + np.count_nonzero(
            (before != 0) & (self.side != before)
        )
        self.since = self.since + 1
        if wrong < self.fewest:
            self.fewest, self.since = wrong, 0
        if turn + 1 < MOST_LEAPS and self.since < LEAP_PATIENCE:
            self._activate(violations, ADD_RATIOS[turn % len(ADD_RATIOS)])
            return False
        self._begin_steps()
        return False

    def _begin_steps(self) -> None:
        """Make active what the point violates, and nothing that it keeps away from."""
        self.change = self._step
        room = FEASIBILITY_TOLERANCE * self.norms * np.linalg.norm(self.x)
        inside = (self.values > self.lower + room) & (self.values < self.upper - room)
        inside &= self.side != EQUALITY
        self.side[inside], self.sign_free[inside] = 0, False
        self._activate(self._violations(self.x, self.values), 0.0)

    def _violations(
        self, x: Float64[np.ndarray, " n"], values: Float64[np.ndarray, " nm"]
    ) -> Float64[np.ndarray, " nm"]:
        """How far, signed, a point violates each inactive row."""
        far = np.maximum(values - self.upper, 0.0) - np.maximum(self.lower - values, 0.0)
        room = FEASIBILITY_TOLERANCE * self.norms * np.linalg.norm(x)
        far[(np.abs(far) <= room) | (self.side != 0)] = 0.0
        return far / np.where(self.norms > 0.0, self.norms, 1.0)

    def _activate(self, violations: Float64[np.ndarray, " nm"], ratio: float) -> None:
        """Make rows active that are violated by at least this part of the largest violation."""
        sizes = np.abs(violations)
        found = (sizes > 0.0) & (sizes >= ratio * sizes.max())
        self.side[found] = np.sign(violations[found]).astype(np.int64)
        self.sign_free[found] = False

    def _is_better(self) -> bool:
        """Whether the target meets the levels better than the point."""
        problem = self.problem
        reach = max(float(np.linalg.norm(self.x)), float(np.linalg.norm(self.target)))
        for level in range(len(problem.levels)):
            mine = problem.level_of == level
            size = float((self.norms * problem.weights)[mine].max(initial=0.0))
            old, new = (
                float(np.linalg.norm((v - v.clip(problem.lower, problem.upper))[mine] * w))
                for v, w in (
                    (self.values, problem.weights[mine]),
                    (self.goal, problem.weights[mine]),
                )
            )
            # A level that both meet is met to rounding.
            room = max(SAME_TOLERANCE * max(old, new), SLACK_TOLERANCE * size * reach)
            if abs(old - new) > room:
                return new < old
        return True

    # --- single steps -------------------------------------------------------------------------

    def _step(self) -> bool:
        """Go on to the optimum of the active set; return whether there is nothing to drop."""
        moved = self._step_until_blocked()
        self.idle = 0 if moved else self.idle + 1
        if moved:
            self.locked[:] = self.released[:] = False
        if self.blocked:
            return False
        return not self._deactivate_wrong_signs(FIRST if self.idle > PATIENCE else LARGEST)

    def _step_until_blocked(self) -> bool:
        """Go towards the optimum of the active set until a row stops it; return if x moved."""
        target, goal = self.target, self.goal
        size = max(float(np.linalg.norm(target)), float(np.linalg.norm(self.x)))
        room = FEASIBILITY_TOLERANCE * self.norms * size
        rate = goal - self.values
        length, stop, side = 1.0, -1, 0
        for row in np.flatnonzero(self.side == 0):
            over = goal[row] > self.upper[row] + room[row]
            under = goal[row] < self.lower[row] - room[row]
            if not (over or under):
                continue
            bound = self.upper[row] if over else self.lower[row]
            ratio = max((bound - self.values[row]) / rate[row], 0.0)
            if ratio < length:
                length, stop, side = ratio, int(row), 1 if over else -1
        self.blocked = stop >= 0
        if self.blocked:
            if stop == self.deactivated or self.released[stop]:
                self.locked[stop] = True
            self.side[stop] = side
            self.sign_free[stop] = False
        step = length * (target - self.x)
        moved = float(np.linalg.norm(step)) > MOVE_TOLERANCE * size
        self.x = target if not self.blocked else self.x + step
        self.values = goal if not self.blocked else self.values + length * rate
        return moved

    # --- damping ------------------------------------------------------------------------------

    def _damp_equalities(self, damping: float) -> None:
        """Move the bounds of equalities whose level is nearer to a singularity than its damping."""
        problem, side, shift = self.problem, self.side, np.zeros(len(self.side))
        self.side, self.Q = np.where(problem.equality, EQUALITY, 0), np.eye(problem.n)
        y, first = np.zeros(problem.n), 0
        for level in range(len(problem.levels)):
            factor = self._factor(level, first)
            rows, rank = factor.rows, factor.rank
            least = float(np.linalg.svd(factor.triangle, compute_uv=False).min(initial=damping))
            if least < damping:
                own, weights = factor.R[:, first : first + rank], problem.weights[rows]
                rest = problem.lower[rows] * weights - factor.R[:, :first] @ y[:first]
                system = np.vstack([own, np.sqrt(damping**2 - least**2) * np.eye(rank)])
                z = np.linalg.lstsq(system, np.append(rest, np.zeros(rank)), rcond=None)[0]
                y[first : first + rank] = z
                shift[rows] = (own @ z - rest) / weights
            else:
                self._solve_level(factor, y)
            first += rank
        self.side = side
        self.lower, self.upper = problem.lower + shift, problem.upper + shift

    # --- the optimum of an active set ---------------------------------------------------------

    def _optimum(self) -> Float64[np.ndarray, " n"]:
        """The lexicographic optimum with the active rows as equalities, all others left out."""
        problem = self.problem
        n = problem.n
        self.Q = np.eye(n)
        self.factors: list[_LevelFactor] = []
        y, first = np.zeros(n), 0
        for level in range(len(problem.levels)):
            factor = self._factor(level, first)
            self._solve_level(factor, y)
            self.factors.append(factor)
            first += factor.rank
        self._solve_cost(first, y)
        return self.Q @ y

    def _factor(self, level: int, first: int) -> _LevelFactor:
        """Turn the free coordinates so that a level's rows become a trapezoid, pivot by pivot."""
        problem, Q = self.problem, self.Q
        rows = np.flatnonzero((problem.level_of == level) & (self.side != 0))
        rows = rows[np.argsort(~self.sign_free[rows], kind="stable")]
        weights = problem.weights[rows]
        R = (self.a[rows] @ Q) * weights[:, None]
        sizes = self.norms[rows] * weights
        rank, sign_free = 0, int(np.count_nonzero(self.sign_free[rows]))
        for end in (sign_free, len(rows)):
            while rank < end and first + rank < problem.n:
                left = np.linalg.norm(R[rank:end, first + rank :], axis=1)
                left /= np.maximum(sizes[rank:end], 1e-300)
                # Large rows first, so that the others are combinations with small coefficients.
                worth = np.where(left > RANK_TOLERANCE, sizes[rank:end] * left**2, 0.0)
                best = rank + int(worth.argmax())
                if not worth[best - rank] > 0.0:
                    break
                swap = [rank, best], [best, rank]
                R[swap[0]], rows[swap[0]], sizes[swap[0]] = (
                    R[swap[1]],
                    rows[swap[1]],
                    sizes[swap[1]],
                )
                v = R[rank, first + rank :].copy()
                v[0] += np.copysign(np.linalg.norm(v), v[0])
                v /= np.linalg.norm(v)
                for matrix in (R, Q):
                    part = matrix[:, first + rank :]
                    part -= np.outer(part @ v, 2.0 * v)
                rank += 1
        return _LevelFactor(rows, first, rank, R)

    def _solve_level(self, factor: _LevelFactor, y: Float64[np.ndarray, " n"]) -> None:
        """Give a level the least slack that is left to it."""
        rows, first, rank = factor.rows, factor.first, factor.rank
        weights = self.problem.weights[rows]
        bounds = np.where(self.side[rows] > 0, self.upper[rows], self.lower[rows]) * weights
        factor.R[rank:, first + rank :] = 0.0
        rest = bounds - factor.R[:, :first] @ y[:first]
        own = factor.R[:rank, first : first + rank]
        others = factor.R[rank:, first : first + rank]
        z = scipy.linalg.solve_triangular(own, rest[:rank], lower=True) if rank else np.zeros(0)
        missed = others @ z - rest[rank:]
        sizes = self.norms[rows] * weights
        size = np.abs(bounds) + sizes * np.hypot(np.linalg.norm(y[:first]), np.linalg.norm(z))
        missed[np.abs(missed) <= SLACK_TOLERANCE * size[rank:]] = 0.0
        factor.slack = np.concatenate([np.zeros(rank), missed])
        if missed.any() and rank:
            C = self._combine(own, others, sizes[rank:])
            factor.slack = self._divide(C, missed)
            z = scipy.linalg.solve_triangular(own, rest[:rank] + factor.slack[:rank], lower=True)
        y[first : first + rank] = z

    def _combine(
        self,
        own: Float64[np.ndarray, "r r"],
        others: Float64[np.ndarray, "k r"],
        sizes: Float64[np.ndarray, " k"],
    ) -> Float64[np.ndarray, "k r"]:
        """Write dependent rows as combinations of the pivots."""
        C = others.copy()
        for k in range(len(own) - 1, -1, -1):
            C[np.abs(C[:, k]) <= DEPENDENCE_TOLERANCE * sizes, k] = 0.0
            C[:, k] /= own[k, k]
            C[:, :k] -= np.outer(C[:, k], own[k, :k])
        return C

    def _divide(
        self, C: Float64[np.ndarray, "k r"], missed: Float64[np.ndarray, " k"]
    ) -> Float64[np.ndarray, " rk"]:
        """If the pivots give u, the others miss w = C u + missed: (u, w), the least of all."""
        count, rank = C.shape
        Q = np.linalg.qr(np.vstack([C, np.eye(rank)]), mode="complete")[0][:, rank:]
        # What the columns of C over I leave of it: rounded as a whole, not one by one.
        # What depends on nothing has no part in it, nor in its rounding.
        leverage = np.linalg.norm(C, axis=1)
        tied = leverage > 0.0
        both = Q @ (Q[:count].T @ np.where(tied, missed, 0.0))
        w, u, norm = both[:count], both[count:], float(np.linalg.norm(both))
        u[np.abs(u) <= CANCELLATION * norm] = 0.0
        sums, sizes = C @ u + missed, np.abs(C) @ np.abs(u) + np.abs(missed)
        # Each is taken from there, or from the others, wherever less is lost by rounding.
        as_a_whole = tied & ((sizes > norm) | (leverage > STEEP))
        lost = np.where(as_a_whole, norm, sizes)
        w = np.where(as_a_whole, w, sums)
        w[np.abs(w) <= CANCELLATION * lost] = 0.0
        noise = np.abs(C).T @ lost
        u = np.where(noise > norm, u, -C.T @ w)
        u[np.abs(u) <= CANCELLATION * np.minimum(noise, norm)] = 0.0
        return np.concatenate([u, w])

    def _solve_cost(self, first: int, y: Float64[np.ndarray, " n"]) -> None:
        """Minimise the final cost over the coordinates that no level has taken."""
        problem = self.problem
        if first == problem.n:
            return
        Z = self.Q[:, first:]
        H = Z.T @ problem.H @ Z
        g = Z.T @ (problem.H @ (self.Q[:, :first] @ y[:first]) + problem.g)
        values, vectors = np.linalg.eigh(H)
        curved = values > FLAT_TOLERANCE * max(np.abs(problem.H).max(), 1e-300)
        vectors = vectors[:, curved]
        y[first:] = -vectors @ ((vectors.T @ g) / values[curved])

    # --- multipliers --------------------------------------------------------------------------

    def _deactivate_wrong_signs(self, ratio: float) -> bool:
        """Deactivate rows whose multiplier has the wrong sign; return whether there was any.

        Args:
            ratio: rows are dropped whose multiplier of the wrong sign is at least this part of the
                largest such, or `LARGEST`, or
                `FIRST`.
        """
        problem, side = self.problem, self.side
        count = len(problem.levels)
        self.multipliers[:] = 0.0
        self.deactivated, self.doubt = -1, False
        inequality = (side == 1) | (side == -1)
        sign_free = side == EQUALITY
        self.needed_by[side != 0] = 0
        for level in range(count + 1):
            found = self.multipliers[level]
            if level == count:
                size = self._cost_gradient()
            else:
                factor = self.factors[level]
                found[factor.rows] = factor.slack
                mine = factor.rows[inequality[factor.rows]]
                signed = found[mine] * side[mine]
                self.needed_by[mine[(signed > 0.0) & ~sign_free[mine]]] = level + 1
                size = self._level_gradient(factor)
                # Slack that is rounding has no sign.
                clear = self._is_clear(factor, size)[inequality[factor.rows]]
                forces = -signed * (self.norms * problem.weights)[mine]
                self.doubt |= bool(
                    (self.locked[mine] & (forces > OPTIMALITY_TOLERANCE * size)).any()
                )
                wrong = mine[(signed < 0.0) & clear & ~self.locked[mine]]
                self.released[wrong] |= self.change == self._step
                if len(wrong):
                    self._deactivate_slacks(wrong)
                    return True
                if not factor.slack.any():
                    continue
            self._balance(level)
            forces = found * self.norms * problem.weights
            if level < count:
                forces[problem.level_of == level] = 0.0
            noise = DUAL_TOLERANCE * max(size, float(np.abs(forces).max()))
            signed = forces * side
            self.needed_by[inequality & ~sign_free & (signed > noise)] = min(level + 1, count)
            wrong_sign = inequality & ~sign_free & (signed < -noise)
            # Kept in spite of their sign: the point may be optimal, but this does not say so.
            scale = noise / DUAL_TOLERANCE
            kept = wrong_sign & self.locked & (signed < -OPTIMALITY_TOLERANCE * scale)
            self.doubt |= bool(kept.any())
            wrong = np.flatnonzero(wrong_sign & ~self.locked)
            if len(wrong):
                if ratio > 1.0:
                    row = wrong[0] if ratio == FIRST else wrong[signed[wrong].argmin()]
                    wrong, self.deactivated = np.array([row]), int(row)
                    self.released[row] |= self.idle > RESIGNED
                else:
                    wrong = wrong[signed[wrong] <= ratio * signed[wrong].min()]
                    self.sign_free[wrong] = False
                side[wrong] = 0
                return True
            sign_free |= inequality & (np.abs(forces) > noise)
            if level < count:
                own = self.factors[level]
                sign_free[own.rows] |= inequality[own.rows] & self._is_clear(own, size)
            self.sign_free = sign_free.copy()
        # Weighted rows multiplier with weighted multipliers.
        self.multipliers *= problem.weights
        return False

    def _is_clear(self, factor: _LevelFactor, size: float) -> Bool[np.ndarray, " k"]:
        """Whether rows' own slack is more than rounding, by its force or in their own unit."""
        rows, weights = factor.rows, self.problem.weights[factor.rows]
        sizes, slack = self.norms[rows] * weights, np.abs(factor.slack)
        bounds = np.where(self.side[rows] > 0, self.upper[rows], self.lower[rows]) * weights
        own = np.abs(bounds) + sizes * np.linalg.norm(self.target)
        return (slack * sizes > DUAL_TOLERANCE * size) | (slack > DUAL_TOLERANCE * own)

    def _level_gradient(self, factor: _LevelFactor) -> float:
        """The force of a level's slack, in y; return its size before anything cancels in it."""
        self.gradient = factor.R[:, : factor.first].T @ factor.slack
        weights = self.problem.weights[factor.rows]
        return float(np.linalg.norm(factor.slack * self.norms[factor.rows] * weights))

    def _cost_gradient(self) -> float:
        """The force of the final cost, in y; return the size of what cancels in it."""
        H, g = self.problem.H, self.problem.g
        self.gradient = self.Q.T @ (H @ self.target + g)
        return float((np.abs(H) @ np.abs(self.target) + np.abs(g)).max())

    def _balance(self, level: int) -> None:
        """Find multipliers of the levels above that balance the force; only pivots have one."""
        found, rest = self.multipliers[level], self.gradient
        for factor in reversed(self.factors[:level]):
            own = slice(factor.first, factor.first + factor.rank)
            multiplier = scipy.linalg.solve_triangular(
                factor.triangle, -rest[own], lower=True, trans=1
            )
            found[factor.rows[: factor.rank]] = multiplier
            rest[: factor.first] += factor.R[: factor.rank, : factor.first].T @ multiplier

    def _deactivate_slacks(self, rows: Int64[np.ndarray, " k"]) -> None:
        """Make rows inactive whose slack has the wrong sign; some may have gone right through."""
        values = self.goal[rows]
        room = FEASIBILITY_TOLERANCE * self.norms[rows] * np.linalg.norm(self.target)
        above, below = values > self.upper[rows] + room, values < self.lower[rows] - room
        self.side[rows] = above.astype(np.int64) - below.astype(np.int64)
        self.sign_free[rows] = False
