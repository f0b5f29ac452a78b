"""`OperationalRecursion`: prioritised accelerations, with no projected Jacobian differentiated."""

import numpy as np
from jaxtyping import Float64

from poise._compiled import say_if_slow
from poise.control._osf._kernels import Bounds, find_rest, make_work, resolve, sum_levels
from poise.control._osf._limits import DemandLimit
from poise.control._osf._rows import LevelRows
from poise.control._rank import HELD_RANK, PHYSICS_RANK, RankTreatment, rank_of
from poise.dynamics import Dynamics


class OperationalRecursion:
    """The operational space formulation with its bias velocity terms cancelled.

    With N_1 = I, J_i|p = J_i N_i, Jbar_i = M^-1 J_i|p^T Lambda_i|p and N_i+1 = N_i - Jbar_i J_i|p
    as in eqs (5) to (8) of (Park, Jin, Kang 2022), the sum of the torques (17) under the bias
    acceleration (23) or (31) is

        alpha_i = xdd_i,ref - Jdot_i v - J_i S_i-1        S_0 = 0
        S_i     = S_i-1 + Jbar_i alpha_i
        Gamma   = M S_k + h - N_k+1^T h                   h = V + G

    because alpha_i equals xdd_i|p,ref - Jdot_i|p v: what the projected Jacobian's derivative adds
    to the bias acceleration it takes away again in mu_i|p.

    With M = L^T L and rows J~ = J L^-1, all projections are orthogonal ones. Levels that the robot
    can follow without loss of rank need no projector at all: their stacked rows are J~ = [L_J 0] Q,
    the squares of L_J's diagonal blocks are the Lambda_i|p^-1, and the recursion above is the
    substitution with L_J. From the first level that loses rank on, levels are taken one by one in
    the basis of what is left, with activations of directions as `RankTreatment` has them; both ways
    give the same numbers where both apply. The first way is compiled.

    Args:
        n: number of generalized coordinates.
        rank: what happens where a level below the physics loses rank.
        demand: what happens where a level asks for too much; None for nothing.

    Attributes:
        regular: number of leading levels that kept their rank, and asked for no more than is
            allowed, at the last state.
    """

    def __init__(self, n: int, rank: RankTreatment, demand: DemandLimit | None = None) -> None:
        self._rank, self._demand = rank, demand
        most, base = (np.inf, 0) if demand is None else (demand.acceleration, demand.base)
        self._bounds = Bounds(PHYSICS_RANK.high, HELD_RANK.high, rank.high, float(most), int(base))
        self._work = make_work(n)
        self.regular = 0
        self._compile(n)

    def resolve(self, levels: LevelRows, dynamics: Dynamics) -> Float64[np.ndarray, " n"]:
        """The acceleration of one state.

        Directions that no level decides are left without force: they accelerate by -M^-1 h.

        Args:
            levels: rows of the state, the physics first.
            dynamics: the state.

        Returns:
            The generalized acceleration dv; the force is `M dv + h`.
        """
        self._levels, self._h = levels, dynamics.h
        dv = np.empty(len(dynamics.h))
        self.regular, done = resolve(dynamics.M, self._h, levels, self._bounds, self._work, dv)
        return dv if done else self._settle(self._tail())[-1]

    def steps(self) -> list[Float64[np.ndarray, " n"]]:
        """Accelerations of the last state with one more level each time, `resolve`'s at the end.

        The first has the physics only; directions that later levels decide are held without
        acceleration in it, not let go.
        """
        first: list[Float64[np.ndarray, " n"]] = []
        for count in range(1, self.regular + 1):
            first.append(np.empty(len(self._h)))
            sum_levels(self._levels, self._work, count, first[-1])
        find_rest(self._work, int(self._levels.ends[self.regular]))
        return self._settle([*first, *self._tail()])

    def _compile(self, n: int) -> None:
        """Resolves nothing once, so that nothing is compiled in a tick."""
        nothing, zero = LevelRows.nothing(n), np.zeros(n)
        say_if_slow(resolve, "operational space control")
        resolve(np.eye(n), zero, nothing, self._bounds, self._work, zero)
        find_rest(self._work, 0)
        sum_levels(nothing, self._work, 0, zero)

    def _tail(self) -> list[Float64[np.ndarray, " n"]]:
        """S after each level from the first on that is no ordinary one."""
        levels, S = self._levels, self._work.S.copy()
        left = len(S) - int(levels.ends[self.regular])
        self._basis = self._work.B[:left].T
        # What is left of each direction of the basis: N in the mass metric.
        self._left = np.eye(left)
        found: list[Float64[np.ndarray, " n"]] = []
        for i, level in enumerate(levels.slices[self.regular :], start=self.regular):
            rank = rank_of(i, levels.constraints, self._rank)
            scale = levels.scale[level]
            rows, target = levels.jacobian[level] * scale[:, None], levels.target[level] * scale
            A = (rows @ self._basis) @ self._left
            squares, V = np.linalg.eigh(A.T @ A)
            activation, gain = rank.activate(squares)
            projection = V.T @ (A.T @ (target - rows @ S))
            motion = self._basis @ V
            if self._demand is not None and i >= levels.constraints:
                gain = self._demand.tempered(activation, gain, projection, motion)
            S = S + motion @ (gain * projection)
            self._left -= (V * activation) @ V.T
            found.append(S)
        return found

    def _settle(self, found: list[Float64[np.ndarray, " n"]]) -> list[Float64[np.ndarray, " n"]]:
        """Accelerations dv = S - N M^-1 h: what no level decides is let go."""
        let_go = self._basis @ (self._left @ (self._basis.T @ self._h))
        return [S - let_go for S in found]
