"""`TaskWeights`: W_A, how much each task of the second level counts."""

import numpy as np
from jaxtyping import Float64

from poise.teleop.footing import Footing
from poise.teleop.parameters import TeleopParameters
from poise.teleop.rules import Rules

_PAPER_K1, _PAPER_K2, _PAPER_S2 = 4500.0, 7000.0, 100.0
"""k_1 and k_2 of (39c) and w_S2, as the paper has them; used where `Rules` ask for them."""

_UPRIGHT_WEIGHT = 100.0
"""Weight of the torso's angular velocity while the operator asks for an upright torso."""

_MOMENTUM, _TORSO, _FOOT = slice(0, 2), slice(2, 5), slice(5, 8)


class TaskWeights:
    """Eqs (39c) and (39d) of angular momentum, torso and foot.

    Args:
        parameters: weights.
        rules: departures from the paper.
        rotator: whether the body rotator acts.
    """

    def __init__(self, parameters: TeleopParameters, rules: Rules, *, rotator: bool) -> None:
        self._parameters, self._rules, self._rotator = parameters, rules, rotator

    def at(
        self, footing: Footing, zmp: Float64[np.ndarray, "2"], *, upright: bool
    ) -> Float64[np.ndarray, "8"]:
        """The weights.

        Args:
            footing: of the tick.
            zmp: measured [m].
            upright: whether the operator asks for an upright torso.
        """
        p, weights = self._parameters, np.empty(8)
        if footing.mode.single:
            weights[_FOOT] = self._swing(footing)
            self._turn(weights, footing, zmp)
            if upright:
                weights[_TORSO] = _UPRIGHT_WEIGHT
        else:
            weights[_MOMENTUM], weights[_TORSO] = p.epsilon, p.w_B
            weights[_FOOT] = p.w_S2 if self._rules.firm_feet else _PAPER_S2
        return weights

    def _turn(
        self,
        weights: Float64[np.ndarray, "8"],
        footing: Footing,
        zmp: Float64[np.ndarray, "2"],
    ) -> None:
        """Weights of angular momentum and torso on one foot."""
        p = self._parameters
        if not self._rotator:
            weights[_MOMENTUM], weights[_TORSO] = p.epsilon, p.w_B
        elif self._rules.constant_weights:
            weights[_MOMENTUM], weights[_TORSO] = p.w_L, p.w_B1
            if self._rules.bounded_tilt:
                weights[_TORSO] *= 1.0 + (footing.tilt / p.tilt_soft) ** 4
        else:
            x, y = (footing.zmp_reference - zmp).tolist()
            weights[0] = max(_PAPER_K1 * y * y, p.epsilon)
            weights[1] = max(_PAPER_K2 * x * x, p.epsilon)
            weights[_TORSO] = p.epsilon

    def _swing(self, footing: Footing) -> float:
        """Weight of the swing foot: firm on the ground, the paper's from `clear_height` on."""
        p = self._parameters
        if not self._rules.firm_lift:
            return p.w_S1
        clear = footing.clearance(footing.lowest_ground, p.clear_height)
        return p.w_S2 ** (1.0 - clear) * p.w_S1**clear
