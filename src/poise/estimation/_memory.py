"""Memory of an invariant filter, and of an estimator's tick, for compiled code."""

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import MemoryBlock
from poise.dynamics import Frames, Motion

VELOCITY, POSITION, CONTACTS = 0, 1, 2
"""Rows of the vectors of the group's element; contact points are the last ones."""

GYRO, ACCELEROMETER = 0, 1
"""Rows of an inertial unit's readings, and of its biases."""


class FilterMemory(MemoryBlock):
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
    turned: Float64[np.ndarray, "2 3 3"]  # scratch: rotations
    A: Float64[np.ndarray, "n n"]  # of the error's dynamics
    Y: Float64[np.ndarray, "n n"]  # scratch: A's effect on P
    G: Float64[np.ndarray, "n 3"]  # scratch: from the gyro's noise to the error
    W: Float64[np.ndarray, "n 3"]  # scratch: covariance with what is observed
    S: Float64[np.ndarray, "3 3"]  # scratch: covariance of the innovation, its factor
    r: Float64[np.ndarray, "3"]  # scratch: innovation
    delta: Float64[np.ndarray, " n"]  # scratch: correction


class EstimatorMemory(MemoryBlock):
    """Memory of a `StateEstimator`'s tick."""

    filter: FilterMemory
    fresh: int  # 1 where the readings are usable
    measured: int  # 1 where there are wrenches
    motion: Motion  # with the base at the origin
    frames: Frames  # the soles
    base_R_unit: Float64[np.ndarray, "3 3"]
    base_p_unit: Float64[np.ndarray, "3"]
    # `ContactBelief`, then `encoder`, `joint_velocity`, `point`, and the weight [N]
    belief: Float64[np.ndarray, " numbers"]
    leans: Int64[np.ndarray, " contacts"]  # soles that lean with their leg
    q: Float64[np.ndarray, " nq"]  # joints as measured; the base's position after a tick
    v: Float64[np.ndarray, " nv"]  # their velocities; the base's after a tick
    world_R_base: Float64[np.ndarray, "3 3"]  # after a tick
    pose: Float64[np.ndarray, "7"]  # of the base, in the last sound estimate
    wrenches: Float64[np.ndarray, "contacts 6"]  # measured or estimated, or NaN [N, N m]
    sensed: Float64[np.ndarray, "6"]  # rate [rad/s], force [m/s^2]
    before: Float64[np.ndarray, "6"]  # the last usable ones
    room: Float64[np.ndarray, " room"]  # scratch: of one frame
    axes: Float64[np.ndarray, "6"]  # scratch: motion of a sole by a joint
    # of each sole from the unit, along its axes: position [m], velocity and angular velocity by the
    # joints, and J J^T of both, which turn a variance of the joints into one of these
    place: Float64[np.ndarray, "contacts 3"]
    speed: Float64[np.ndarray, "contacts 3"]
    turning: Float64[np.ndarray, "contacts 3"]
    spread: Float64[np.ndarray, "contacts 3 3"]
    turning_spread: Float64[np.ndarray, "contacts 3 3"]
    probability: Float64[np.ndarray, " contacts"]  # of contact
    slip_end: Float64[np.ndarray, " contacts"]  # [s]
    fitted: Float64[np.ndarray, "1"]  # last time of a contact point at rest [s]
    airborne: Int64[np.ndarray, " contacts"]  # soles clear of the ground
