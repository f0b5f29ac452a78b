"""`SoleKinematics`: where the soles are seen from the base, how fast, and how surely."""

from typing import NamedTuple

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._compiled import compiled
from poise.dynamics import Frames, Motion, column_at, frames_of, motion_of
from poise.robots import Robot

_POINT, _SPEED, _SPREAD, _NUMBERS = 0, 3, 9, 27
"""Where a sole's numbers begin in what `_see` fills, and how many they are."""


class SeenSole(NamedTuple):
    """A sole's centre, as seen from a unit on the base. Arrays are overwritten by the next look.

    Attributes:
        offset: from the unit, along its axes [m].
        speed: of the sole against the base by the joints' velocities, along the same axes [m/s].
        turning: its angular velocity, likewise [rad/s].
        spread: J J^T of the speed: a variance of the joints' angles becomes one of the offset.
        turning_spread: J J^T of the turning.
    """

    offset: Float64[np.ndarray, "3"]
    speed: Float64[np.ndarray, "3"]
    turning: Float64[np.ndarray, "3"]
    spread: Float64[np.ndarray, "3 3"]
    turning_spread: Float64[np.ndarray, "3 3"]


class SoleKinematics:
    """Looks from an inertial unit at the soles, whatever the base does.

    Args:
        robot: with a floating base.
        base_R_unit: the unit's axes in the base.
        base_p_unit: its origin in the base [m].
    """

    def __init__(
        self,
        robot: Robot,
        base_R_unit: Float64[np.ndarray, "3 3"],
        base_p_unit: Float64[np.ndarray, "3"],
    ) -> None:
        self._model, self._data = robot.model, robot.model.createData()
        self._frames = frames_of(robot.model, [robot.frame_id(name) for name in robot.soles])
        self._motion = motion_of(robot.model, self._data)
        self._R, self._p = np.ascontiguousarray(base_R_unit), np.array(base_p_unit)
        self._q, self._v = robot.q_home.copy(), np.zeros(robot.nv)
        self._q[:7] = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0
        self._seen = np.zeros((len(robot.soles), _NUMBERS))
        self.soles = [
            SeenSole(
                row[_POINT:_SPEED],
                row[_SPEED : _SPEED + 3],
                row[_SPEED + 3 : _SPREAD],
                row[_SPREAD : _SPREAD + 9].reshape(3, 3),
                row[_SPREAD + 9 :].reshape(3, 3),
            )
            for row in self._seen
        ]
        self.look(self._q[7:], self._v[6:])

    def look(self, joints: Float64[np.ndarray, " nj"], speeds: Float64[np.ndarray, " nj"]) -> None:
        """Sees all soles: `soles` follow.

        Args:
            joints: angles [rad].
            speeds: their velocities [rad/s].
        """
        self._q[7:], self._v[6:] = joints, speeds
        pin.computeJointJacobians(self._model, self._data, self._q)
        _see(self._motion, self._frames, self._v, self._R, self._p, self._seen)


@compiled
def _see(
    motion: Motion,
    frames: Frames,
    v: Float64[np.ndarray, " nv"],
    R: Float64[np.ndarray, "3 3"],
    p: Float64[np.ndarray, "3"],
    seen: Float64[np.ndarray, "soles 27"],
) -> None:
    """Position, velocities and J J^T of each frame, along the axes of R, about p.

    Args:
        motion: of the joints, with the base at the origin.
        frames: the soles.
        v: velocities; those of the base are passed over.
        R: base_R_unit.
        p: origin of the unit in the base [m].
        seen: receives the numbers, a row a sole.
    """
    for sole in range(len(seen)):
        out, place = seen[sole], motion.placements[frames.joints[sole]]
        local = frames.placements[sole]
        for i in range(_NUMBERS):
            out[i] = 0.0
        x = place[9] + place[0] * local[9] + place[3] * local[10] + place[6] * local[11]
        y = place[10] + place[1] * local[9] + place[4] * local[10] + place[7] * local[11]
        z = place[11] + place[2] * local[9] + place[5] * local[10] + place[8] * local[11]
        for i in range(3):
            out[i] = R[0, i] * (x - p[0]) + R[1, i] * (y - p[1]) + R[2, i] * (z - p[2])
        for k in range(frames.starts[sole], frames.starts[sole + 1]):
            column = frames.columns[k]
            if column < 6:
                continue
            jx, jy, jz, wx, wy, wz = column_at(motion, column, x, y, z)
            for i in range(3):
                a = R[0, i] * jx + R[1, i] * jy + R[2, i] * jz
                w = R[0, i] * wx + R[1, i] * wy + R[2, i] * wz
                out[_SPEED + i] += a * v[column]
                out[_SPEED + 3 + i] += w * v[column]
                for j in range(3):
                    b = R[0, j] * jx + R[1, j] * jy + R[2, j] * jz
                    u = R[0, j] * wx + R[1, j] * wy + R[2, j] * wz
                    out[_SPREAD + 3 * i + j] += a * b
                    out[_SPREAD + 9 + 3 * i + j] += w * u
