"""`PayloadMemory`, `feel`: forces of the soles, momentum and motion of the hands, smoothed."""

import math

import numpy as np
from jaxtyping import Float64

from poise._compiled import Block, compiled, view
from poise.dynamics import (
    ROTATION,
    VELOCITY,
    FrameBlock,
    MotionBlock,
    place_frame,
    turn_to_world,
)

SOLES, HAND = 12, 12
"""Numbers of all soles and of the momentum, and of each hand."""


class PayloadMemory(Block):
    """Memory of a `PayloadEstimator`."""

    motion: MotionBlock
    frames: FrameBlock  # the soles, then the hands
    momentum: Float64[np.ndarray, "6"]  # centroidal, linear before angular
    wrenches: Float64[np.ndarray, "soles 6"]  # along the soles' axes [N, N m]
    room: Float64[np.ndarray, " room"]  # scratch: of one frame
    felt: Float64[np.ndarray, " k"]
    low: Float64[np.ndarray, " k"]  # `felt`, smoothed


@compiled
def feel(address: int, gain: float) -> bool:
    """Fill in `felt`, and let `low` go a part of the way there; False for what is not finite."""
    # Force, moment and momentum, then of each hand, with its place r and velocity v: v,
    # (r - c) x v, c' x v and r - c. All is along the world's axes, about the centre of mass c, and
    # but for the hands by the mass.
    m = view(PayloadMemory, address)
    motion, frames, room, felt, low = m.motion, m.frames, m.room, m.felt, m.low
    com, mass, soles = motion.com, motion.mass[0], len(m.wrenches)
    for i in range(6):
        felt[i], felt[6 + i] = 0.0, m.momentum[i] / mass
    for k in range(soles):
        place_frame(motion, frames, k, room, 0)
        x, y, z = room[0] - com[0], room[1] - com[1], room[2] - com[2]
        wrench, R = m.wrenches[k], room[ROTATION:VELOCITY]
        a = R[0] * wrench[0] + R[1] * wrench[1] + R[2] * wrench[2]
        b = R[3] * wrench[0] + R[4] * wrench[1] + R[5] * wrench[2]
        c = R[6] * wrench[0] + R[7] * wrench[1] + R[8] * wrench[2]
        felt[0] += a / mass
        felt[1] += b / mass
        felt[2] += c / mass
        k_x = R[0] * wrench[3] + R[1] * wrench[4] + R[2] * wrench[5]
        k_y = R[3] * wrench[3] + R[4] * wrench[4] + R[5] * wrench[5]
        k_z = R[6] * wrench[3] + R[7] * wrench[4] + R[8] * wrench[5]
        felt[3] += (y * c - z * b + k_x) / mass
        felt[4] += (z * a - x * c + k_y) / mass
        felt[5] += (x * b - y * a + k_z) / mass
    u_x, u_y, u_z = felt[6], felt[7], felt[8]
    for k in range((len(felt) - SOLES) // HAND):
        place_frame(motion, frames, soles + k, room, 0)
        turn_to_world(room, 0)
        x, y, z = room[0] - com[0], room[1] - com[1], room[2] - com[2]
        v_x, v_y, v_z = room[VELOCITY], room[VELOCITY + 1], room[VELOCITY + 2]
        out = felt[SOLES + HAND * k : SOLES + HAND * (k + 1)]
        out[0], out[1], out[2] = v_x, v_y, v_z
        out[3], out[4], out[5] = y * v_z - z * v_y, z * v_x - x * v_z, x * v_y - y * v_x
        out[6], out[7], out[8] = u_y * v_z - u_z * v_y, u_z * v_x - u_x * v_z, u_x * v_y - u_y * v_x
        out[9], out[10], out[11] = x, y, z
    for i in range(len(felt)):
        if not abs(felt[i]) < math.inf:
            return False
    for i in range(len(felt)):
        low[i] = felt[i] if gain == 1.0 else low[i] + gain * (felt[i] - low[i])
    return True
