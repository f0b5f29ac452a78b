"""`Motion`: Pinocchio's results for one state, as arrays that compiled code reads in place.

`Frames`: places of frames on the robot's joints, with compiled functions for their motion.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pinocchio as pin
from jaxtyping import Float64, Int64

from poise._compiled import MemoryBlock, compiled, part, view


class Motion(MemoryBlock):
    """Pinocchio's own memory after `crba` in the world's convention and `nonLinearEffects`.

    Spatial vectors put the linear part first. All arrays are views that the next update overwrites.
    """

    columns: Float64[np.ndarray, "nv 6"]  # of all joints' Jacobians, world's axes, at its origin
    placements: Float64[np.ndarray, "joints 12"]  # world_R_joint by columns, then the origin [m]
    velocities: Float64[np.ndarray, "joints 6"]  # along the joint's own axes [m/s, rad/s]
    accelerations: Float64[np.ndarray, "joints 6"]  # spatial, zero `dv`, less gravity, own axes
    forces: Float64[np.ndarray, "joints 6"]  # for all bodies on the joint, own axes [N, N m]
    momentum: Float64[np.ndarray, "nv 6"]  # columns of A_G, which maps `v` to the momentum
    com: Float64[np.ndarray, "3"]  # in the world [m]
    gravity: Float64[np.ndarray, "3"]  # [m/s^2]
    roots: Int64[np.ndarray, " roots"]  # joints on the world
    mass: Float64[np.ndarray, "1"]  # of the whole robot [kg]


def motion_of(model: pin.Model, data: pin.Data) -> Motion:
    """Make the arrays of some data, which must outlive them."""
    roots = [j for j in range(1, model.njoints) if model.parents[j] == 0]
    # A matrix of one column comes as a vector.
    columns, momentum = (matrix.reshape(6, -1, order="F").T for matrix in (data.J, data.Ag))
    return Motion(
        columns=columns,
        placements=_rows_of([place.rotation for place in data.oMi], 12),
        velocities=_rows_of([velocity.linear for velocity in data.v], 6),
        accelerations=_rows_of([acceleration.linear for acceleration in data.a_gf], 6),
        forces=_rows_of([force.linear for force in data.f], 6),
        momentum=momentum,
        com=data.com[0],
        gravity=model.gravity.linear,
        roots=np.array(roots, dtype=np.int64),
        mass=np.array([pin.computeTotalMass(model)]),
    )


def _rows_of(first: Sequence[Any], width: int) -> Float64[np.ndarray, "joints width"]:
    """View the elements of one of Pinocchio's vectors, which are contiguous, as one array."""
    places = [view.__array_interface__["data"][0] for view in first]
    step = np.dtype(np.float64).itemsize * width
    if any(b - a != step for a, b in pairwise(places)):
        raise RuntimeError(f"Pinocchio {pin.__version__} has another layout of its data")
    return np.lib.stride_tricks.as_strided(
        first[0].ravel(order="K"), shape=(len(first), width), strides=(step, step // width)
    )


class Frames(MemoryBlock):
    """Places of frames on their joints, and the coordinates that move them."""

    joints: Int64[np.ndarray, " frames"]  # that carries each frame
    placements: Float64[np.ndarray, "frames 12"]  # joint_R_frame by rows, then the origin [m]
    starts: Int64[np.ndarray, " ends"]  # of each frame's coordinates, and the end of the last's
    columns: Int64[np.ndarray, " columns"]  # coordinates of `v` that move the frames


def frames_of(model: pin.Model, frame_ids: Sequence[int]) -> Frames:
    """Make the table of some frames."""
    frames = [model.frames[i] for i in frame_ids]
    joints = [[j for j in model.supports[f.parentJoint] if j > 0] for f in frames]
    moved = [[model.idx_vs[j] + k for j in js for k in range(model.nvs[j])] for js in joints]
    placements = [np.append(f.placement.rotation, f.placement.translation) for f in frames]
    return Frames(
        joints=np.array([f.parentJoint for f in frames], dtype=np.int64),
        placements=np.array(placements).reshape(-1, 12),
        starts=np.cumsum([0, *map(len, moved)], dtype=np.int64),
        columns=np.array([i for columns in moved for i in columns], dtype=np.int64),
    )


POSITION, ROTATION, VELOCITY, BIAS, KINEMATICS = 0, 3, 12, 18, 24
"""First numbers of the parts of a frame that `place_frame` fills, and the number of all."""


@part
def place_frame(
    motion: Motion,
    frames: Frames,
    frame: int,
    out: Float64[np.ndarray, " k"],
    at: int,
) -> None:
    """Find pose, velocity and classical acceleration at zero `dv` of a frame."""
    joint = frames.joints[frame]
    R, P = motion.placements[joint], frames.placements[frame]
    for i in range(3):
        out[at + i] = R[9 + i] + R[i] * P[9] + R[3 + i] * P[10] + R[6 + i] * P[11]
        for k in range(3):
            out[at + ROTATION + 3 * i + k] = R[i] * P[k] + R[3 + i] * P[3 + k] + R[6 + i] * P[6 + k]
    g, V, A = motion.gravity, motion.velocities[joint], motion.accelerations[joint]
    px, py, pz = P[9], P[10], P[11]
    # Velocity and acceleration of the frame's origin, along the joint's axes.
    wx, wy, wz = V[3], V[4], V[5]
    vx, vy, vz = V[0] + wy * pz - wz * py, V[1] + wz * px - wx * pz, V[2] + wx * py - wy * px
    ax = A[0] + R[0] * g[0] + R[1] * g[1] + R[2] * g[2] + A[4] * pz - A[5] * py + wy * vz - wz * vy
    ay = A[1] + R[3] * g[0] + R[4] * g[1] + R[5] * g[2] + A[5] * px - A[3] * pz + wz * vx - wx * vz
    az = A[2] + R[6] * g[0] + R[7] * g[1] + R[8] * g[2] + A[3] * py - A[4] * px + wx * vy - wy * vx
    for k in range(3):
        x, y, z = P[k], P[3 + k], P[6 + k]
        out[at + VELOCITY + k] = x * vx + y * vy + z * vz
        out[at + VELOCITY + 3 + k] = x * wx + y * wy + z * wz
        out[at + BIAS + k] = x * ax + y * ay + z * az
        out[at + BIAS + 3 + k] = x * A[3] + y * A[4] + z * A[5]


@part
def turn_to_world(out: Float64[np.ndarray, " k"], at: int) -> None:
    """Turn the velocity and bias of `place_frame` from the frame's axes to the world's."""
    R = at + ROTATION
    for first in range(at + VELOCITY, at + KINEMATICS, 3):
        x, y, z = out[first], out[first + 1], out[first + 2]
        for i in range(3):
            out[first + i] = out[R + 3 * i] * x + out[R + 3 * i + 1] * y + out[R + 3 * i + 2] * z


@part
def column_at(
    motion: Motion, column: int, x: float, y: float, z: float
) -> tuple[float, float, float, float, float, float]:
    """Find the velocity of a point by a coordinate, along the world's axes, linear part first."""
    c = motion.columns[column]
    wx, wy, wz = c[3], c[4], c[5]
    return (
        c[0] + wy * z - wz * y,
        c[1] + wz * x - wx * z,
        c[2] + wx * y - wy * x,
        wx,
        wy,
        wz,
    )


class FrameMemory(MemoryBlock):
    """Memory of `evaluate_frame`."""

    motion: Motion
    frames: Frames  # of which the first is evaluated
    out: Float64[np.ndarray, " kinematics"]  # as `place_frame` fills it, along the world's axes
    jacobian: Float64[np.ndarray, "6 nv"]


@compiled
def evaluate_frame(address: int) -> None:
    """Fill in the kinematics of a frame along the world's axes."""
    m = view(FrameMemory, address)
    motion, frames, out = m.motion, m.frames, m.out
    place_frame(motion, frames, 0, out, 0)
    turn_to_world(out, 0)
    for k in range(frames.starts[0], frames.starts[1]):
        i = frames.columns[k]
        column = column_at(motion, i, out[0], out[1], out[2])
        for row in range(6):
            m.jacobian[row, i] = column[row]


@part
def momentum_rate(motion: Motion, out: Float64[np.ndarray, " k"], at: int) -> None:
    """Find the rate of the centroidal momentum at zero `dv`, linear then angular [N, N m]."""
    # The joints on the world carry that rate and the weight.
    for i in range(3):
        out[at + i] = motion.mass[0] * motion.gravity[i]
        out[at + 3 + i] = 0.0
    for root in motion.roots:
        R, f = motion.placements[root], motion.forces[root]
        fx = R[0] * f[0] + R[3] * f[1] + R[6] * f[2]
        fy = R[1] * f[0] + R[4] * f[1] + R[7] * f[2]
        fz = R[2] * f[0] + R[5] * f[1] + R[8] * f[2]
        x, y, z = R[9] - motion.com[0], R[10] - motion.com[1], R[11] - motion.com[2]
        out[at] += fx
        out[at + 1] += fy
        out[at + 2] += fz
        out[at + 3] += R[0] * f[3] + R[3] * f[4] + R[6] * f[5] + y * fz - z * fy
        out[at + 4] += R[1] * f[3] + R[4] * f[4] + R[7] * f[5] + z * fx - x * fz
        out[at + 5] += R[2] * f[3] + R[5] * f[4] + R[8] * f[5] + x * fy - y * fx


class StateNumbers(MemoryBlock):
    """State of a robot with its dynamics, for compiled functions."""

    q: Float64[np.ndarray, " nq"]
    v: Float64[np.ndarray, " nv"]
    M: Float64[np.ndarray, "nv nv"]
    h: Float64[np.ndarray, " nv"]
    motion: Motion
    centroid: Float64[np.ndarray, "12"]  # momentum, and its rate at zero `dv`


@compiled
def evaluate_centroid(address: int) -> None:
    """Fill in the centroidal momentum [kg m/s, kg m^2/s], then its rate at zero `dv` [N, N m]."""
    state = view(StateNumbers, address)
    motion, out = state.motion, state.centroid
    for i in range(6):
        out[i] = 0.0
    for k in range(len(state.v)):
        for i in range(6):
            out[i] += motion.momentum[k, i] * state.v[k]
    momentum_rate(motion, out, 6)
