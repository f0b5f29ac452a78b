"""`OldGravityResolver`: the original formula on a planet that its bias term was not told of."""

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from benchmarks.fixed_base.plant import with_gravity
from poise.control import RankTreatment
from poise.control._osf._bias import bias_original
from poise.control._osf._levels import LevelRows
from poise.control._osf._recursion import PaperResolver
from poise.dynamics import Dynamics
from poise.robots import Robot


class OldGravityResolver(PaperResolver):
    """Eq. (23) whose own term mu_i + p_i keeps a gravity while everything else knows the true one.

    What (23) takes over from the torque (17), J_i|p, Lambda_i|p and mu_i|p + p_i|p, has the true
    gravity, as the torque itself. Two tasks only.

    Args:
        robot: whose bias term.
        gravity: vertical gravity that it keeps [m/s^2].
    """

    def __init__(self, robot: Robot, gravity: float) -> None:
        super().__init__("original", RankTreatment())
        self._old = with_gravity(robot, gravity)
        self._data = self._old.model.createData()

    def resolve(self, levels: LevelRows, dynamics: Dynamics) -> Float64[np.ndarray, " n"]:
        """The acceleration of one state, the levels with their exact `rates`."""
        super().resolve(levels, dynamics)
        _, first, second = self.tasks
        rows = levels.slices[2]
        Gamma = first.J_p.T @ (first.Lambda_p @ levels.reference[levels.slices[1]] + first.mu_p)
        state = dynamics.state
        h = pin.nonLinearEffects(self._old.model, self._data, state.q, state.v)
        wrong = bias_original(second, np.linalg.inv(dynamics.M), Gamma, h)
        # By (24) a bias acceleration that is too large is a reference that is too small.
        kept = levels.reference[rows].copy()
        levels.reference[rows] += self.bias[2] - wrong
        acceleration = super().resolve(levels, dynamics)
        levels.reference[rows] = kept
        self.bias[2] = wrong
        return acceleration
