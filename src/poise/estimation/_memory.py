"""`FilterMemory`: state and covariance of an invariant filter, as compiled code has them.

`EstimatorMemory`: what an estimator's tick reads and writes besides.
"""

import math

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import Block, part
from poise.dynamics import Frames, Motion

VELOCITY, POSITION, CONTACTS = 0, 1, 2
"""Rows of the vectors of the group's element; contact points are the last ones."""

GYRO, ACCELEROMETER = 0, 1
"""Rows of what an inertial unit measures, and of its biases."""

OFFSET, SPEED, TURNING, SPREAD, TURNING_SPREAD, SEEN = 0, 3, 6, 9, 18, 27
"""First number of each kind in a row of `EstimatorMemory.seen`, and their count: of a sole its
position from the unit, its velocity and angular velocity by those of the joints, all along the
unit's axes, and J J^T of both, by which a variance of the joints' angles becomes one of these."""


class FilterMemory(Block):
    """State and covariance of an invariant filter."""

    R: Float64[np.ndarray, "3 3"]  # world_R_imu
    # rows: velocity [m/s], position, contact points [m], in the world
    x: Float64[np.ndarray, "m 3"]
    bias: Float64[np.ndarray, "2 3"]  # rows: of the gyro [rad/s], of the accelerometer [m/s^2]
    # of the error: orientation, velocity, position, contact points, both biases
    P: Float64[np.ndarray, "n n"]
    active: Int64[np.ndarray, " contacts"]  # held contact points
    imu: Float64[np.ndarray, "2 3"]  # rows: rate [rad/s], force [m/s^2]
    density: Float64[np.ndarray, "4"]  # of gyro, accelerometer, their biases
    contact_density: Float64[np.ndarray, " contacts"]  # of walks [m/s/sqrt(Hz)]
    offset: Float64[np.ndarray, "3"]  # of a contact point, from the unit [m]
    spread: Float64[np.ndarray, "3 3"]  # its covariance [m^2]
    turned: Float64[np.ndarray, "4 3 3"]  # scratch: rotations
    G: Float64[np.ndarray, "n 3"]  # scratch: how the gyro's noise reaches the error
    W: Float64[np.ndarray, "n 3"]  # scratch: covariance with what is observed
    S: Float64[np.ndarray, "2 3 3"]  # scratch: covariance of the innovation, its inverse
    r: Float64[np.ndarray, "3"]  # scratch: innovation
    K: Float64[np.ndarray, "n 3"]  # scratch: gain
    delta: Float64[np.ndarray, " n"]  # scratch: correction


class EstimatorMemory(Block):
    """Memory of a `StateEstimator`'s tick."""

    filter: FilterMemory
    fresh: int  # whether the inertial unit says something of use now
    measured: int  # whether there are wrenches
    motion: Motion  # with the base at the origin
    frames: Frames  # the soles
    base_R_unit: Float64[np.ndarray, "3 3"]
    base_p_unit: Float64[np.ndarray, "3"]
    # `ContactBelief`, then `encoder`, `joint_velocity`, `point`, and the weight [N]
    belief: Float64[np.ndarray, " numbers"]
    leans: Int64[np.ndarray, " contacts"]  # soles that lean with their leg
    q: Float64[np.ndarray, " nq"]  # joints as measured; after a tick the estimate
    v: Float64[np.ndarray, " nv"]  # their velocities
    pose: Float64[np.ndarray, "7"]  # of the base, in the last sound estimate
    wrenches: Float64[np.ndarray, "contacts 6"]  # measured or estimated, or NaN [N, N m]
    sensed: Float64[np.ndarray, "6"]  # rate [rad/s], force [m/s^2]
    before: Float64[np.ndarray, "6"]  # the last ones of use
    axes: Float64[np.ndarray, "6"]  # scratch: how a joint moves and turns a sole
    seen: Float64[np.ndarray, "contacts 27"]  # see `OFFSET`
    probability: Float64[np.ndarray, " contacts"]  # of contact
    slip_end: Float64[np.ndarray, " contacts"]  # [s]
    fitted: Float64[np.ndarray, "1"]  # when a contact point was at rest last [s]
    airborne: Int64[np.ndarray, " contacts"]  # soles clear of the ground


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


@part
def is_sound(m: FilterMemory) -> bool:
    """Test that all is finite and no variance negative; NaN fails every comparison."""
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
