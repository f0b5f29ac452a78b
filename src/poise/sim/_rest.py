"""`find_rest`: a robot that touches the ground, put where soft contacts just carry it."""

import math

import mujoco
import numpy as np
from jaxtyping import Float64

from poise.sim._mapping import StateMap

# A robot that the ground carries nowhere within this height [m] of where it was put was put into
# the air, or into the ground, on purpose. One that has to be turned by more than this [rad] leans,
# and would tip over.
_REACH, _MOST_TILT = 1e-3, 5e-3

_STEP = 1e-7  # of finite differences [m, rad, m/s, rad/s]; a hundredth of what a foot sinks in
_TOLERANCE = 1e-9  # rounding of wrenches on the base, over the weight, and of velocities


def find_rest(
    model: mujoco.MjModel, data: mujoco.MjData, mapping: StateMap
) -> Float64[np.ndarray, " nj"] | None:
    """Move a robot's base to where it rests on the ground; return torques that hold it [N m].

    None where nothing carries the robot, which stays.
    """
    # No force and no moment on the base at zero acceleration, for six unknowns: displacement along
    # the ground's normal and rotation about two axes along the ground, which normal forces depend
    # on, and velocities in the other three directions, which friction depends on: MuJoCo's creeps
    # under load, by micrometres a second. By Newton's method with differences of `mj_inverse`.
    if mapping.free_joint is None:
        return None
    base = _Base(model, data, mapping.free_joint)
    if not base.find_height():
        base.put_back()
        return None
    x = np.zeros(6)
    residual = base.unbalanced(x)
    for _ in range(30):
        if np.abs(residual).max() < _TOLERANCE:
            break
        jacobian = np.column_stack(
            [(base.unbalanced(x + step) - residual) / _STEP for step in _STEP * np.eye(6)]
        )
        step = np.linalg.lstsq(jacobian, -residual)[0]
        # The longest of the step, its half, its quarter ... that leaves less unbalanced.
        for halvings in range(12):
            there = x + 0.5**halvings * step
            left = base.unbalanced(there)
            if np.linalg.norm(left) < np.linalg.norm(residual):
                x, residual = there, left
                break
    if np.abs(residual).max() > math.sqrt(_TOLERANCE) or base.far(x):
        base.put_back()
        return None
    base.unbalanced(np.where(np.abs(x) < _TOLERANCE, 0.0, x))
    return data.qfrc_inverse[mapping.dof_order[6:]]


class _Base:
    """A floating base that is tried out in other places, its joints held."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, free_joint: int) -> None:
        self._model, self._data = model, data
        place, dof = int(model.jnt_qposadr[free_joint]), int(model.jnt_dofadr[free_joint])
        self._qpos, self._qvel = data.qpos[place : place + 7], data.qvel[dof : dof + 6]
        self._force = data.qfrc_inverse[dof : dof + 6]
        self._start, self._begin = self._qpos.copy(), self._qpos.copy()
        body = int(model.jnt_bodyid[free_joint])
        self._weight = float(model.body_subtreemass[body] * np.linalg.norm(model.opt.gravity))
        # Two axes along the ground and its normal; the world's until contacts are known.
        self._axes = np.eye(3)

    def find_height(self) -> bool:
        """Bisect for the height at which the ground carries the weight."""
        low, high = -_REACH, _REACH
        if not self._weight > 0.0 or self._lift(low) < 0.0 or self._lift(high) > 0.0:
            return False
        # Until it is known to a ten-thousandth of a micrometre.
        for _ in range(24):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self._lift(middle) > 0.0 else (low, middle)
        self._lift(low)
        self._begin[2] += low
        # A contact's normal points from its first body to its second, so maybe downwards.
        normals = self._data.contact.frame[:, :3]
        normal = (normals * np.sign(normals[:, 2:])).sum(axis=0)
        normal /= np.linalg.norm(normal)
        along = np.array([1.0, 0.0, 0.0]) - normal[0] * normal
        along /= np.linalg.norm(along)
        self._axes = np.array([along, np.cross(normal, along), normal])
        return True

    def unbalanced(self, x: Float64[np.ndarray, "6"]) -> Float64[np.ndarray, "6"]:
        """Residual force and moment on the base at rest, over the weight [-, m]."""
        along, across, normal = self._axes
        self._qpos[:3] = self._begin[:3] + x[0] * normal
        turn, turned, spin = np.empty(4), np.empty(4), np.empty(3)
        rotation = x[1] * along + x[2] * across
        angle = float(np.linalg.norm(rotation))
        mujoco.mju_axisAngle2Quat(turn, rotation / angle if angle else along, angle)
        mujoco.mju_mulQuat(turned, turn, self._begin[3:])
        self._qpos[3:] = turned
        mujoco.mju_negQuat(turn, turned)
        mujoco.mju_rotVecQuat(spin, x[5] * normal, turn)
        self._qvel[:3], self._qvel[3:] = x[3] * along + x[4] * across, spin
        return self._forces()

    def far(self, x: Float64[np.ndarray, "6"]) -> bool:
        """Return True where a place is too far from where the robot was put."""
        height = abs(self._begin[2] - self._start[2]) + abs(x[0])
        return height > 2.0 * _REACH or float(np.abs(x[1:3]).max()) > _MOST_TILT

    def put_back(self) -> None:
        """Put the base where it was, at rest."""
        self._qpos[:], self._qvel[:] = self._start, 0.0

    def _lift(self, height: float) -> float:
        """Upward force on the base that is too much, over the weight, at a height off the start."""
        self._qpos[:] = self._begin
        self._qpos[2] += height
        return -float(self._forces()[2])

    def _forces(self) -> Float64[np.ndarray, "6"]:
        self._data.qacc[:] = 0.0
        mujoco.mj_inverse(self._model, self._data)
        return self._force / self._weight
