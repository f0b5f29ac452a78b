"""`InertialUnit`: what an ideal inertial unit on the base would measure of the simulated motion."""

import math

import mujoco
import numpy as np
from jaxtyping import Float64

from poise.robots import GRAVITY


class InertialUnit:
    """Angular velocity now, and the mean specific force since it was last asked.

    Units integrate at many kHz inside and give increments of velocity, so an impact between two
    readings is in the later one. The unit sits at the base's origin, along its axes.
    """

    def __init__(self) -> None:
        self._velocity: Float64[np.ndarray, "3"] = np.zeros(3)
        self._turn: Float64[np.ndarray, "4"] = np.zeros(4)
        self.reset()

    def reset(self) -> None:
        """Forgets the motion so far."""
        self._time = math.nan

    def read(
        self,
        qpos: Float64[np.ndarray, " nq"],
        qvel: Float64[np.ndarray, " nv"],
        time: float,
    ) -> tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3"]]:
        """Looks at the base."""
        spin, force, turn = qvel[3:6].copy(), np.array([0.0, 0.0, GRAVITY]), self._turn
        turn[:] = qpos[3:7]
        elapsed = time - self._time
        if elapsed > 0.0:
            force += (qvel[:3] - self._velocity) / elapsed
            # Along the axes that the base had in the middle of the time that has passed.
            mujoco.mju_quatIntegrate(turn, spin, -0.5 * elapsed)
        self._time = time
        self._velocity[:] = qvel[:3]
        mujoco.mju_negQuat(turn, turn)
        felt = np.empty(3)
        mujoco.mju_rotVecQuat(felt, force, turn)
        return spin, felt
