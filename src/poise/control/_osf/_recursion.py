"""`PaperResolver`: the operational space formulation as its equations stand, for comparison."""

import numpy as np
from jaxtyping import Float64

from poise.control._osf._bias import PrioritisedTask, bias_original, bias_proposed
from poise.control._osf._levels import LevelRows
from poise.control._osf._limits import DemandLimit
from poise.control._osf._projected_rates import BackwardDifferences, ExactRates
from poise.control._osf._rank import RankTreatment, invert, rank_of
from poise.dynamics import Dynamics

BIAS_FORMULAS = ("fused", "original", "proposed", "numerical")
"""Ways to the bias acceleration by name; `fused` is the default and has a resolver of its own."""

DERIVATIVES = ("exact", "numerical")
"""Ways to the derivative of a projected Jacobian."""


class PaperResolver:
    """Eqs (5) to (24) of (Park, Jin, Kang 2022), matrix by matrix.

    Slower than `FusedResolver` and no better: it is what that one is tested and timed against, and
    what the paper's studies run. Rank is treated alike. Jdot_i|p is exact where the rows come with
    their rates, and found by backward differences, as in the paper, where they do not.

    Args:
        formula: "original" (23), "proposed" (31) or "numerical" (41).
        rank: what happens where a level below the physics loses rank.
        demand: what happens where a level asks for too much; None for nothing.

    Attributes:
        bias: bias acceleration of each level at the last state.
        tasks: what the recursion found for each level at the last state.
    """

    def __init__(
        self, formula: str, rank: RankTreatment, demand: DemandLimit | None = None
    ) -> None:
        self._formula, self._rank, self._demand = formula, rank, demand
        self._rates = BackwardDifferences()
        self._velocities = BackwardDifferences()
        self.bias: list[Float64[np.ndarray, " m"]] = []
        self.tasks: list[PrioritisedTask] = []

    def resolve(self, levels: LevelRows, dynamics: Dynamics) -> Float64[np.ndarray, " n"]:
        """The acceleration of one state.

        Args:
            levels: rows of the state, the physics first; with `rates` for exact derivatives.
            dynamics: the state.

        Returns:
            The generalized acceleration dv = M^-1 (Gamma - h).
        """
        v, h = dynamics.state.v, dynamics.h
        M_inverse = np.linalg.inv(dynamics.M)
        self._rates.begin(dynamics.state.time)
        self._velocities.begin(dynamics.state.time)
        exact = None
        if levels.rates is not None:
            exact = ExactRates(M_inverse, levels.rates.mass_matrix)
        N = np.eye(len(v))
        Gamma, S = np.zeros(len(v)), np.zeros(len(v))
        self.bias, self.tasks, sums = [], [], list[Float64[np.ndarray, " n"]]()
        for i, level in enumerate(levels.slices):
            J, drift = levels.jacobian[level], levels.drift[level]
            J_p = J @ N
            if exact is not None and levels.rates is not None:
                J_p_rate = exact.of(J, levels.rates.jacobian[level], N)
            else:
                J_p_rate = self._rates.of(J_p)
            rank = rank_of(i, levels.firm, self._rank)
            # Nothing is projected out of the first level: J_1|p is J_1.
            drift_p = J_p_rate @ v if i else drift
            task = _prioritise(J, J_p, M_inverse, h, drift, drift_p, levels.scale[level], rank)
            if i == 0:
                bias = np.zeros(len(J))
            elif self._formula == "original":
                bias = bias_original(task, M_inverse, Gamma, h)
            elif self._formula == "proposed":
                bias = bias_proposed(task, S)
            else:
                bias = self._velocities.of((J - J_p) @ v)
            # Eq. (24), then (14), (16) and (15).
            reference = levels.reference[level]
            if self._demand is not None and i >= levels.firm:
                reference = _moderate(reference, task, S, M_inverse, self._demand, rank)
            reference_p = reference - bias
            Gamma = Gamma + J_p.T @ (task.Lambda_p @ reference_p + task.mu_p)
            S = S + task.Jbar_p @ (reference_p - task.drift_p)
            if exact is not None:
                exact.pass_by(task, J_p_rate)
            N = N - task.Jbar_p @ J_p
            self.bias.append(bias)
            self.tasks.append(task)
            sums.append(S)
        let_go = M_inverse @ (N.T @ h)
        self._steps = [S - let_go for S in sums]
        return M_inverse @ (Gamma - h)

    def steps(self) -> list[Float64[np.ndarray, " n"]]:
        """Accelerations of the last state with one more level each time, as `FusedResolver`'s."""
        return self._steps


def _moderate(
    reference: Float64[np.ndarray, " m"],
    task: PrioritisedTask,
    S: Float64[np.ndarray, " n"],
    M_inverse: Float64[np.ndarray, "n n"],
    demand: DemandLimit,
    rank: RankTreatment,
) -> Float64[np.ndarray, " m"]:
    """The reference acceleration that a `DemandLimit` leaves of one."""
    known = task.J @ S + task.drift
    missing = reference - known
    if demand.is_kept(task.Jbar_p @ missing):
        return reference
    response = M_inverse @ (task.J_p.T * task.scale)
    squares, U = np.linalg.eigh((task.J_p * task.scale[:, None]) @ response)
    share, gain = rank.shares(squares)
    singular = np.sqrt(np.maximum(squares, rank.low * rank.low))
    c = U.T @ (missing * task.scale)
    tempered = demand.tempered(share, gain, singular * c, (response @ U) / singular)
    left = np.divide(tempered, gain, out=np.ones_like(gain), where=share > 0.0)
    return known + (U @ (left * c)) / task.scale


def _prioritise(
    J: Float64[np.ndarray, "m n"],
    J_p: Float64[np.ndarray, "m n"],
    M_inverse: Float64[np.ndarray, "n n"],
    h: Float64[np.ndarray, " n"],
    drift: Float64[np.ndarray, " m"],
    drift_p: Float64[np.ndarray, " m"],
    scale: Float64[np.ndarray, " m"],
    rank: RankTreatment,
) -> PrioritisedTask:
    J_Minv = J_p @ M_inverse
    Lambda_inverse = J_Minv @ J_p.T
    Lambda, Lambda_inverse = invert(Lambda_inverse, scale, rank)
    return PrioritisedTask(
        J=J,
        J_p=J_p,
        Lambda_p=Lambda,
        Lambda_p_inverse=Lambda_inverse,
        Jbar_p=J_Minv.T @ Lambda,
        drift=drift,
        drift_p=drift_p,
        mu_p=Lambda @ (J_Minv @ h - drift_p),
        scale=scale,
    )
