"""`ServoSteps`: physics steps short enough for a servo that gives all it has."""

import math

import mujoco
import numpy as np
from jaxtyping import Float64, Int

_MOST = 32
"""A physics step is divided into no more than this."""


class ServoSteps:
    """Divides a physics step while a servo is at its torque limit.

    MuJoCo takes a servo's damping at the end of the step, so that a stiff one is stable in steps of
    any length; at the limit of its torque it cannot. There the torque is that at the beginning of
    the step, and a joint that is light beside its servo's damping is thrown through the band
    within which the servo is not at its limit, to the other side of it, and back in the next step,
    for ever: with a millisecond G1's hips rattled so from the first hard landing on.

    So steps are divided that begin with a servo at its limit, until that is short for the fastest
    joints: dt times the largest eigenvalue of D M^-1 is 1 or less, with the servos' damping D [N m
    s/rad] and the joint space inertia M.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        self._model, self._dt = model, float(model.opt.timestep)
        joints = model.actuator_trnid[:, 0]
        self._at_q: Int[np.ndarray, " nu"] = model.jnt_qposadr[joints]
        self._at_v: Int[np.ndarray, " nu"] = model.jnt_dofadr[joints]
        self._stiffness: Float64[np.ndarray, " nu"] = model.actuator_gainprm[:, 0].copy()
        self._damping: Float64[np.ndarray, " nu"] = -model.actuator_biasprm[:, 2]
        self._limit = np.where(model.actuator_forcelimited, model.actuator_forcerange[:, 1], np.inf)
        self.parts = self._parts(data)

    def advance(self, data: mujoco.MjData) -> None:
        """One physics step, in one or in `parts`."""
        model = self._model
        if self.parts == 1 or not self._at_limit(data):
            mujoco.mj_step(model, data)
            return
        model.opt.timestep = self._dt / self.parts
        mujoco.mj_step(model, data, self.parts)
        model.opt.timestep = self._dt

    def _at_limit(self, data: mujoco.MjData) -> bool:
        error = data.ctrl - data.qpos[self._at_q]
        torque = self._stiffness * error - self._damping * data.qvel[self._at_v]
        return bool((np.abs(torque) >= self._limit).any())

    def _parts(self, data: mujoco.MjData) -> int:
        """Into how many parts a step is divided."""
        if not np.isfinite(self._damping).all():
            return 1
        mujoco.mj_forward(self._model, data)
        inertia = np.zeros((self._model.nv, self._model.nv))
        mujoco.mj_fullM(self._model, data, inertia)
        inverse = np.linalg.inv(inertia)[np.ix_(self._at_v, self._at_v)]
        root = np.sqrt(self._damping)
        fastest = float(np.linalg.eigvalsh(root[:, None] * inverse * root).max())
        return min(_MOST, max(1, math.ceil(self._dt * fastest)))
