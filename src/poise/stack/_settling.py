"""`bound_settling`: joint limits beside contacts that do not lie still."""

import numpy as np
from jaxtyping import Float64

from poise._compiled import (
    MemoryBlock,
    allocate,
    factor_leading,
    part,
    solve_leading,
)
from poise.dynamics import StateNumbers
from poise.stack._tables import (
    CONTACT,
    COUNT,
    FIRST,
    FRAME_INDEX,
    KIND,
    START,
    Line,
    StackNumbers,
)
from poise.stack._viability import Viability, bound_joint, braking_asked

_LARGEST = 6
"""Rows that a contact has at most."""

_SINGULAR = 1e-4
"""What is added to the squares of how joints move a contact [m^2, 1]: what a leg that is all but
straight would have to do very fast is not taken to happen."""


class Settling(MemoryBlock):
    """Joint limits, and room for `bound_settling`."""

    viability: Viability
    lower: Float64[np.ndarray, " nj"]  # bounds of the joint accelerations [rad/s^2]
    upper: Float64[np.ndarray, " nj"]
    gram: Float64[np.ndarray, "six six"]  # how the joints of a contact move it, squared
    slip: Float64[np.ndarray, " six"]  # velocity of a contact [m/s, rad/s]
    change: Float64[np.ndarray, " six"]  # requested change of it [m/s^2, rad/s^2]
    velocity: Float64[np.ndarray, " nj"]  # of joints, for contacts that come to rest [rad/s]
    rate: Float64[np.ndarray, " nj"]  # how fast that changes until they do [rad/s^2]
    beside: Float64[np.ndarray, " nj"]  # one for joints that move a contact, zero for others


def settling_of(
    viability: Viability, lower: Float64[np.ndarray, " nj"], upper: Float64[np.ndarray, " nj"]
) -> Settling:
    """Room for joint limits and where their bounds are written."""
    sizes = {"six": _LARGEST, "nj": len(lower)}
    return allocate(Settling, sizes, viability=viability, lower=lower, upper=upper)


@part
def bound_settling(state: StateNumbers, assembly: StackNumbers, room: Settling) -> None:
    """Leave out of joint limits what joints do only because a contact still moves.

    A contact that carries comes to rest by itself, J dv + drift = a - d J v. A sole that has come
    down on an edge turns by several rad/s until it lies, and its ankle with it: an ankle that shall
    stop before its limit could do so sooner by the body alone, which would be thrown aside by 40
    m/s^2 for it. So, with w the least velocity of the joints between base and contact that moves it
    as it moves, J w = J v,

        lower(v - w) + r <= dv <= upper(v - w) + r,  r the least with J r = a - d J v

    where lower and upper are the bounds of `JointLimit`, but with its `braking` b for all of these
    joints, and never so that a joint has to brake, or to come back from beyond its limit, by more
    than `braking_asked`: nothing but the body could do that beside a contact that holds, and it
    would take the robot off its soles. An ankle at its limit on a bump, asked for b at readings of
    3 mrad beyond it, kicked G1 until it hopped. Where an ankle's sole is tilted beyond its range
    the joint's own stop holds it.
    """
    q, v, owners = state.q, state.v, assembly.owners
    viability, lower, upper = room.viability, room.lower, room.upper
    first = len(v) - len(lower)
    for i in range(len(lower)):
        room.velocity[i] = room.rate[i] = room.beside[i] = 0.0
    for i in range(len(owners.lines)):
        if owners.lines[i, KIND] != CONTACT:
            break
        _settle(state, assembly, owners.lines[i], first, room)
    angles = len(q) - len(lower)
    for i in range(len(lower)):
        if room.beside[i] > 0.0:
            still, b = v[first + i] - room.velocity[i], viability.gentle[i]
            bound_joint(i, q[angles + i], still, b, viability, lower, upper)
            below = q[angles + i] - viability.q_min[i]
            above = viability.q_max[i] - q[angles + i]
            asked = braking_asked(below, -still, b, viability)
            lower[i] = min(lower[i], asked) + room.rate[i]
            asked = braking_asked(above, still, b, viability)
            upper[i] = max(upper[i], -asked) + room.rate[i]


@part
def _settle(
    state: StateNumbers, assembly: StackNumbers, line: Line, first: int, room: Settling
) -> None:
    """Add what one contact's motion asks of its joints: w = J^T (J J^T + s I)^-1 J v, so r."""
    v, owners, rows = state.v, assembly.owners, assembly.rows
    columns, frame = owners.frames.columns, line[FRAME_INDEX]
    begin, end = owners.frames.starts[frame], owners.frames.starts[frame + 1]
    top, count = rows.first + line[FIRST], int(line[COUNT])
    for i in range(count):
        room.slip[i] = 0.0
        for k in range(begin, end):
            room.slip[i] += rows.matrix[top + i, columns[k]] * v[columns[k]]
        for j in range(i + 1):
            total = _SINGULAR if i == j else 0.0
            for k in range(begin, end):
                if columns[k] >= first:
                    total += rows.matrix[top + i, columns[k]] * rows.matrix[top + j, columns[k]]
            room.gram[i, j] = total
    if not factor_leading(room.gram, count):
        return
    at = line[START]
    for i in range(count):
        asks = owners.parameters[at + 4 + 2 * count + i]
        room.change[i] = asks - owners.parameters[at] * room.slip[i]
    solve_leading(room.gram, count, room.slip)
    solve_leading(room.gram, count, room.change)
    for k in range(begin, end):
        joint = columns[k] - first
        if joint >= 0:
            for i in range(count):
                room.velocity[joint] += rows.matrix[top + i, columns[k]] * room.slip[i]
                room.rate[joint] += rows.matrix[top + i, columns[k]] * room.change[i]
            room.beside[joint] = 1.0
