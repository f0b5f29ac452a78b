"""Forces of the soles, momentum and motion of the hands, smoothed by compiled code."""

import math

import numpy as np
from jaxtyping import Float64

from poise._compiled import MemoryBlock, compiled, part, view
from poise.dynamics import ROTATION, VELOCITY, Frames, Motion, place_frame, turn_to_world

SOLES, HAND = 12, 12
"""Numbers of all soles and of the momentum, and of each hand."""


class PayloadMemory(MemoryBlock):
    """Memory of a `PayloadEstimator`."""

    motion: Motion
    frames: Frames  # the soles, then the hands
    momentum: Float64[np.ndarray, "6"]  # centroidal, linear before angular
    wrenches: Float64[np.ndarray, "soles 6"]  # along the soles' axes [N, N m]
    room: Float64[np.ndarray, " room"]  # scratch: of one frame
    measured: Float64[np.ndarray, " k"]
    low: Float64[np.ndarray, " k"]  # `measured`, smoothed


@compiled
def measure(address: int, gain: float) -> bool:
    """Fill in `measured` and the low-pass `low`; return False for what is not finite."""
    # Force, moment and momentum, then of each hand, with its place r and velocity v: v,
    # (r - c) x v, c' x v and r - c. All is along the world's axes, about the centre of mass c, and
    # but for the hands by the mass.
    m = view(PayloadMemory, address)
    motion, frames, room, measured, low = m.motion, m.frames, m.room, m.measured, m.low
    com, mass, soles = motion.com, motion.mass[0], len(m.wrenches)
    for i in range(6):
        measured[i], measured[6 + i] = 0.0, m.momentum[i] / mass
    for k in range(soles):
        place_frame(motion, frames, k, room, 0)
        x, y, z = room[0] - com[0], room[1] - com[1], room[2] - com[2]
        wrench = m.wrenches[k]
        force = _turned(room, wrench[0], wrench[1], wrench[2])
        moment = _turned(room, wrench[3], wrench[4], wrench[5])
        lever = _cross(x, y, z, force[0], force[1], force[2])
        for i in range(3):
            measured[i] += force[i] / mass
            measured[3 + i] += (lever[i] + moment[i]) / mass
    for k in range((len(measured) - SOLES) // HAND):
        place_frame(motion, frames, soles + k, room, 0)
        turn_to_world(room, 0)
        x, y, z = room[0] - com[0], room[1] - com[1], room[2] - com[2]
        v_x, v_y, v_z = room[VELOCITY], room[VELOCITY + 1], room[VELOCITY + 2]
        out = measured[SOLES + HAND * k :]
        out[0], out[1], out[2] = v_x, v_y, v_z
        out[3], out[4], out[5] = _cross(x, y, z, v_x, v_y, v_z)
        out[6], out[7], out[8] = _cross(measured[6], measured[7], measured[8], v_x, v_y, v_z)
        out[9], out[10], out[11] = x, y, z
    for i in range(len(measured)):
        if not abs(measured[i]) < math.inf:
            return False
    for i in range(len(measured)):
        low[i] = measured[i] if gain == 1.0 else low[i] + gain * (measured[i] - low[i])
    return True


@part
def _turned(
    place: Float64[np.ndarray, " room"], x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Turn a vector from a frame of `place_frame` to the world's axes."""
    R = place[ROTATION:VELOCITY]
    return (
        R[0] * x + R[1] * y + R[2] * z,
        R[3] * x + R[4] * y + R[5] * z,
        R[6] * x + R[7] * y + R[8] * z,
    )


@part
def _cross(
    x: float, y: float, z: float, a: float, b: float, c: float
) -> tuple[float, float, float]:
    return y * c - z * b, z * a - x * c, x * b - y * a
