"""`find_base`: pose and velocity of the base from those of the inertial unit on it."""

import math

import numpy as np
from jaxtyping import Float64

from poise._compiled import part
from poise.estimation._group import turn, turn_back
from poise.estimation._memory import GYRO, POSITION, VELOCITY, EstimatorMemory


@part
def find_base(m: EstimatorMemory) -> None:
    """Fill in pose and velocity of the base in Poise's conventions: in `q`, `v` and `pose`."""
    f, q, v, R, p = m.filter, m.q, m.v, m.base_R_unit, m.base_p_unit
    position, velocity, rate = f.x[POSITION], f.x[VELOCITY], f.bias[GYRO]
    world_R_base = f.turned[0]
    for i in range(3):
        row = turn(R, f.R[i, 0], f.R[i, 1], f.R[i, 2])
        world_R_base[i, 0], world_R_base[i, 1], world_R_base[i, 2] = row
        q[i] = position[i] - (row[0] * p[0] + row[1] * p[1] + row[2] * p[2])
    _set_quaternion(world_R_base, q)
    for i in range(7):
        m.pose[i] = q[i]
    w = m.before
    wx, wy, wz = turn(R, w[0] - rate[0], w[1] - rate[1], w[2] - rate[2])
    v[3], v[4], v[5] = wx, wy, wz
    x, y, z = turn_back(world_R_base, velocity[0], velocity[1], velocity[2])
    # The base against the unit: omega x (-p) = p x omega.
    v[0] = x + (p[1] * wz - p[2] * wy)
    v[1] = y + (p[2] * wx - p[0] * wz)
    v[2] = z + (p[0] * wy - p[1] * wx)


@part
def _set_quaternion(R: Float64[np.ndarray, "3 3"], q: Float64[np.ndarray, " nq"]) -> None:
    """Write the quaternion x, y, z, w of a rotation, found by its largest component."""
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
