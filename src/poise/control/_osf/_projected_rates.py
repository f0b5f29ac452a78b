"""Derivatives of prioritised Jacobians along the motion."""

import numpy as np
from jaxtyping import Float64

from poise.control._osf._bias import PrioritisedTask


class ExactRates:
    """Exact Jdot_i|p of one state, task by task in the order of priority.

    From N_1 = I on, with d(M^-1) = -M^-1 Mdot M^-1 and d(Lambda) = -Lambda d(Lambda^-1) Lambda,

        Jdot_i|p = Jdot_i N_i + J_i Ndot_i
        Ndot_i+1 = Ndot_i - d(Jbar_i|p) J_i|p - Jbar_i|p Jdot_i|p

    Args:
        M_inverse: M^-1.
        M_rate: dM/dt.
    """

    def __init__(
        self, M_inverse: Float64[np.ndarray, "n n"], M_rate: Float64[np.ndarray, "n n"]
    ) -> None:
        self._M_inverse = M_inverse
        self._M_inverse_rate = -M_inverse @ M_rate @ M_inverse
        self._N_rate = np.zeros_like(M_inverse)

    def of(
        self,
        J: Float64[np.ndarray, "m n"],
        J_rate: Float64[np.ndarray, "m n"],
        N: Float64[np.ndarray, "n n"],
    ) -> Float64[np.ndarray, "m n"]:
        """Jdot_i|p of the next task.

        Args:
            J: J_i.
            J_rate: Jdot_i.
            N: N_i.
        """
        return J_rate @ N + J @ self._N_rate

    def pass_by(self, task: PrioritisedTask, J_p_rate: Float64[np.ndarray, "m n"]) -> None:
        """Propagates Ndot past a task.

        Args:
            task: the task.
            J_p_rate: its Jdot_i|p.
        """
        J_p, Lambda, M_inverse = task.J_p, task.Lambda_p, self._M_inverse
        half = J_p_rate @ M_inverse @ J_p.T
        rate = half + half.T + J_p @ self._M_inverse_rate @ J_p.T
        Lambda_rate = -Lambda @ rate @ Lambda
        Jbar_rate = self._M_inverse_rate @ J_p.T @ Lambda + M_inverse @ (
            J_p_rate.T @ Lambda + J_p.T @ Lambda_rate
        )
        self._N_rate = self._N_rate - Jbar_rate @ J_p - task.Jbar_p @ J_p_rate


class BackwardDifferences:
    """Backward differences over a tick, level by level; zero where there is no past."""

    def __init__(self) -> None:
        self._time: float | None = None
        self._before: list[np.ndarray] = []
        self._now: list[np.ndarray] = []
        self._dt = 0.0

    def begin(self, time: float) -> None:
        """Starts a new state at a time [s]."""
        self._before, self._now = self._now, []
        self._dt = 0.0 if self._time is None else time - self._time
        self._time = time

    def of(self, value: np.ndarray) -> np.ndarray:
        """Derivative of the next quantity; they must come in the same order every tick."""
        index = len(self._now)
        self._now.append(value)
        if self._dt <= 0.0 or index >= len(self._before):
            return np.zeros_like(value)
        before = self._before[index]
        # Another set of contacts or limits has other rows.
        return (value - before) / self._dt if before.shape == value.shape else np.zeros_like(value)
