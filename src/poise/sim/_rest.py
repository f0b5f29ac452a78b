"""`find_rest`: a robot that touches the ground, put where the ground just carries it.

MuJoCo's contacts are soft: a foot on the ground carries nothing until it has sunk in by some
hundredths of a millimetre. A robot that is put exactly on the ground falls by that much first.
"""

import math

import mujoco
import numpy as np
from jaxtyping import Float64

_REACH = 1e-3
"""A robot that the ground carries nowhere within this height [m] of where it was put was put into
the air, or into the ground, on purpose."""

_MOST_TILT = 5e-3
"""Nor is it turned by more than this [rad]: it leans, and would tip over."""

_STEP = 1e-7
"""Of finite differences [m, rad, m/s, rad/s]; a hundredth of what a foot sinks in."""

_TOLERANCE = 1e-9
"""Forces [N] and moments [N m] on the base that are left, over the weight."""

_MOST_ITERATIONS = 30
_MOST_HALVINGS = 12
_BISECTIONS = 24
"""Until the height is known to a ten-thousandth of a micrometre."""

_STILL = 1e-9
"""Velocities below this are rounding [m/s, rad/s]."""


def find_rest(
    model: mujoco.MjModel, data: mujoco.MjData, free_joint: int
) -> Float64[np.ndarray, " nv"] | None:
    """Moves a robot's base to where it rests on the ground with its joints held as they are.

    Six equations, no force and no moment on the base at zero acceleration, for six unknowns: the
    base's displacement along the ground's normal and its rotation about two axes along the ground,
    which normal forces depend on, and the velocities in the other three directions, which
    friction depends on: MuJoCo's friction creeps under load, by micrometres a second. On level
    ground these velocities are zero. The forces come from `mj_inverse`, the solution by Newton's
    method with differences.
    """
    base = _Base(model, data, free_joint)
    if not base.find_height():
        base.put_back()
        return None
    x, residual = np.zeros(6), base.unbalanced(np.zeros(6))
    for _ in range(_MOST_ITERATIONS):
        if np.abs(residual).max() < _TOLERANCE:
            break
        jacobian = np.column_stack(
            [(base.unbalanced(x + step) - residual) / _STEP for step in _STEP * np.eye(6)]
        )
        x, residual = _descend(base, x, residual, np.linalg.lstsq(jacobian, -residual)[0])
    if np.abs(residual).max() > math.sqrt(_TOLERANCE) or base.far(x):
        base.put_back()
        return None
    base.unbalanced(np.where(np.abs(x) < _STILL, 0.0, x))
    holding = data.qfrc_inverse.copy()
    holding[base.dofs] = 0.0
    return holding


def _descend(
    base: "_Base",
    x: Float64[np.ndarray, "6"],
    residual: Float64[np.ndarray, "6"],
    step: Float64[np.ndarray, "6"],
) -> tuple[Float64[np.ndarray, "6"], Float64[np.ndarray, "6"]]:
    """The longest of the step, its half, its quarter ... that leaves less unbalanced."""
    norm = np.linalg.norm(residual)
    for _ in range(_MOST_HALVINGS):
        there = base.unbalanced(x + step)
        if np.linalg.norm(there) < norm:
            return x + step, there
        step = 0.5 * step
    return x, residual


class _Base:
    """A floating base that is tried out in other places, its joints held."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, free_joint: int) -> None:
        self._model, self._data = model, data
        first, self._dof = int(model.jnt_qposadr[free_joint]), int(model.jnt_dofadr[free_joint])
        self._places = slice(first, first + 7)
        self.dofs = slice(self._dof, self._dof + 6)
        self._start = data.qpos[self._places].copy()
        self._begin = self._start.copy()
        body = int(model.jnt_bodyid[free_joint])
        self._weight = float(model.body_subtreemass[body] * np.linalg.norm(model.opt.gravity))
        # Along the ground, along the ground, off the ground; the world's until contacts are known.
        self._axes = np.eye(3)

    def find_height(self) -> bool:
        """Bisect for the height at which the ground carries the weight."""
        low, high = -_REACH, _REACH
        if not self._weight > 0.0 or self._lift(low) < 0.0 or self._lift(high) > 0.0:
            return False
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self._lift(middle) > 0.0 else (low, middle)
        self._lift(low)
        self._begin[2] += low
        # A contact's normal points from its first body to its second, so maybe downwards.
        normals = self._data.contact.frame[:, :3]
        normal = (normals * np.sign(normals[:, 2:])).sum(axis=0)
        self._axes = _axes_with(normal / np.linalg.norm(normal))
        return True

    def unbalanced(self, x: Float64[np.ndarray, "6"]) -> Float64[np.ndarray, "6"]:
        """Force and moment on the base that nothing balances at rest, over the weight [-, m]."""
        along, across, normal = self._axes
        qpos, turned = self._data.qpos[self._places], np.empty(4)
        qpos[:] = self._begin
        qpos[:3] += x[0] * normal
        turn = np.empty(4)
        rotation = x[1] * along + x[2] * across
        angle = float(np.linalg.norm(rotation))
        mujoco.mju_axisAngle2Quat(turn, rotation / angle if angle else along, angle)
        mujoco.mju_mulQuat(turned, turn, self._begin[3:])
        qpos[3:] = turned
        spin, unturn = np.empty(3), np.empty(4)
        mujoco.mju_negQuat(unturn, turned)
        mujoco.mju_rotVecQuat(spin, x[5] * normal, unturn)
        velocity = self._data.qvel[self.dofs]
        velocity[:3], velocity[3:] = x[3] * along + x[4] * across, spin
        return self._forces()

    def far(self, x: Float64[np.ndarray, "6"]) -> bool:
        """Whether a place is too far from where the robot was put."""
        height = abs(self._begin[2] - self._start[2]) + abs(x[0])
        return height > 2.0 * _REACH or float(np.abs(x[1:3]).max()) > _MOST_TILT

    def put_back(self) -> None:
        """Puts the base where it was, at rest."""
        self._data.qpos[self._places] = self._start
        self._data.qvel[self.dofs] = 0.0

    def _lift(self, height: float) -> float:
        """Upward force on the base that is too much, over the weight, at a height off the start."""
        self._data.qpos[self._places] = self._begin
        self._data.qpos[self._places][2] += height
        return -float(self._forces()[2])

    def _forces(self) -> Float64[np.ndarray, "6"]:
        self._data.qacc[:] = 0.0
        mujoco.mj_inverse(self._model, self._data)
        return self._data.qfrc_inverse[self.dofs] / self._weight


def _axes_with(normal: Float64[np.ndarray, "3"]) -> Float64[np.ndarray, "3 3"]:
    """Three orthogonal unit vectors as rows, the last of them given."""
    along = np.array([1.0, 0.0, 0.0]) - normal[0] * normal
    along /= np.linalg.norm(along)
    return np.array([along, np.cross(normal, along), normal])
