"""`find_base`: from what an invariant filter knows of the unit to the base's pose and velocity."""

import math

import numpy as np
from jaxtyping import Float64

from poise._compiled import compiled, part, view
from poise.estimation._memory import POSITION, VELOCITY, FilterMemory


@compiled
def find_base(
    address: int,
    base_R_unit: Float64[np.ndarray, "3 3"],
    base_p_unit: Float64[np.ndarray, "3"],
    turning: Float64[np.ndarray, "3"],
    q: Float64[np.ndarray, " nq"],
    v: Float64[np.ndarray, " nv"],
) -> None:
    """Pose and velocity of the base in Poise's conventions: the velocity in the base's own frame.

    Args:
        address: of the filter's `FilterMemory`.
        base_R_unit: the unit's axes in the base.
        base_p_unit: its origin in the base [m].
        turning: what the gyro says [rad/s].
        q: receives the base's pose.
        v: receives its velocity.
    """
    m = view(FilterMemory, address)
    position, velocity, p = m.x[POSITION], m.x[VELOCITY], base_p_unit
    world_R_base = m.turned[0]
    for i in range(3):
        for k in range(3):
            world_R_base[i, k] = 0.0
            for j in range(3):
                world_R_base[i, k] += m.R[i, j] * base_R_unit[k, j]
        lever = 0.0
        for k in range(3):
            lever += world_R_base[i, k] * p[k]
        q[i] = position[i] - lever
    _set_quaternion(world_R_base, q)
    for i in range(3):
        v[3 + i] = 0.0
        for k in range(3):
            v[3 + i] += base_R_unit[i, k] * (turning[k] - m.bias[0, k])
    wx, wy, wz = v[3], v[4], v[5]
    # The base against the unit: omega x (-p) = p x omega.
    v[0], v[1], v[2] = p[1] * wz - p[2] * wy, p[2] * wx - p[0] * wz, p[0] * wy - p[1] * wx
    for i in range(3):
        for k in range(3):
            v[i] += world_R_base[k, i] * velocity[k]


@part
def _set_quaternion(R: Float64[np.ndarray, "3 3"], q: Float64[np.ndarray, " nq"]) -> None:
    """Writes the quaternion x, y, z, w of a rotation, found by its largest component."""
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    if trace > 0.0:
        twice = math.sqrt(1.0 + trace)
        q[6] = 0.5 * twice
        rest = 0.5 / twice
        q[3] = rest * (R[2, 1] - R[1, 2])
        q[4] = rest * (R[0, 2] - R[2, 0])
        q[5] = rest * (R[1, 0] - R[0, 1])
        return
    i = 0
    if R[1, 1] > R[0, 0]:
        i = 1
    if R[2, 2] > R[i, i]:
        i = 2
    j, k = (i + 1) % 3, (i + 2) % 3
    twice = math.sqrt(1.0 + R[i, i] - R[j, j] - R[k, k])
    q[3 + i] = 0.5 * twice
    rest = 0.5 / twice
    q[3 + j] = rest * (R[j, i] + R[i, j])
    q[3 + k] = rest * (R[k, i] + R[i, k])
    q[6] = rest * (R[k, j] - R[j, k])
