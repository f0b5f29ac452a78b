"""`FilterMemory`: state and covariance of an invariant filter, as compiled code has them."""

import math

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import Block, compiled, part, view

VELOCITY, POSITION, CONTACTS = 0, 1, 2
"""Rows of the vectors of the group's element; contact points are the last ones."""


class FilterMemory(Block):
    """What the compiled functions work on.

    The error's coordinates stand in blocks of three: orientation, velocity, position, contact
    points, gyro bias, accelerometer bias.

    Attributes:
        R: world_R_imu.
        x: rows: velocity, position, contact points, along the world's axes [m/s, m].
        bias: rows: of the gyro [rad/s], of the accelerometer [m/s^2].
        P: covariance of the error.
        active: which contact points are held.
        imu: angular velocity [rad/s], then specific force [m/s^2], along the unit's axes.
        density: of the noise: gyro, accelerometer, their biases.
        contact_density: of each contact point's walk [m/s/sqrt(Hz)].
        offset: a contact point seen from the unit, along its axes [m].
        spread: covariance of that [m^2].
        turned: scratch: rotations.
        G: scratch: how the gyro's noise reaches the error.
        W: scratch: covariance of the error with what is observed.
        S: scratch: covariance of the innovation, its inverse.
        r: scratch: innovation, and its inverse's image.
        K: scratch: the gain.
        delta: scratch: the correction.
    """

    R: Float64[np.ndarray, "3 3"]
    x: Float64[np.ndarray, "m 3"]
    bias: Float64[np.ndarray, "2 3"]
    P: Float64[np.ndarray, "n n"]
    active: Int64[np.ndarray, " contacts"]
    imu: Float64[np.ndarray, "2 3"]
    density: Float64[np.ndarray, "4"]
    contact_density: Float64[np.ndarray, " contacts"]
    offset: Float64[np.ndarray, "3"]
    spread: Float64[np.ndarray, "3 3"]
    turned: Float64[np.ndarray, "4 3 3"]
    G: Float64[np.ndarray, "n 3"]
    W: Float64[np.ndarray, "n 3"]
    S: Float64[np.ndarray, "2 3 3"]
    r: Float64[np.ndarray, "3"]
    K: Float64[np.ndarray, "n 3"]
    delta: Float64[np.ndarray, " n"]


@part
def set_rotation(R: Float64[np.ndarray, "3 3"], new: Float64[np.ndarray, "3 3"]) -> None:
    """R = new (3 I - new^T new) / 2: a step towards the nearest rotation, as rounding piles up."""
    for i in range(3):
        for k in range(3):
            total = 3.0 * new[i, k]
            for j in range(3):
                dot = new[0, j] * new[0, k] + new[1, j] * new[1, k] + new[2, j] * new[2, k]
                total -= new[i, j] * dot
            R[i, k] = 0.5 * total


@compiled
def is_sound(address: int) -> bool:
    """Whether all is finite and no variance is negative; NaN fails every comparison."""
    m = view(FilterMemory, address)
    for i in range(len(m.P)):
        if not 0.0 <= m.P[i, i] < math.inf:
            return False
    for i in range(3):
        if not (abs(m.bias[0, i]) < math.inf and abs(m.bias[1, i]) < math.inf):
            return False
        for k in range(3):
            if not abs(m.R[i, k]) <= 1.1:
                return False
    for i in range(len(m.x)):
        for k in range(3):
            if not abs(m.x[i, k]) < math.inf:
                return False
    return True
