"""Points that are fixed to frames, compiled: how they move, and rows for the distance of two."""

from math import sqrt

import numpy as np
from jaxtyping import Float64

from poise._compiled import part
from poise.dynamics import BIAS, VELOCITY, Frames, StateNumbers, column_at
from poise.stack._tables import StackNumbers

TOUCHING = 1e-6
"""Points that are nearer than this have no direction from one to the other [m]."""

Vector = tuple[float, float, float]


@part
def vector(numbers: Float64[np.ndarray, " k"], at: int) -> Vector:
    """Three numbers of an array."""
    return numbers[at], numbers[at + 1], numbers[at + 2]


@part
def plus(a: Vector, b: Vector, factor: float) -> Vector:
    """Sum a + factor b."""
    return a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]


@part
def dot(a: Vector, b: Vector) -> float:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@part
def cross(a: Vector, b: Vector) -> Vector:
    """Vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@part
def velocity_of(work: Float64[np.ndarray, " work"], frame: int, p: Vector) -> Vector:
    """Velocity of a point that is fixed to a frame, which stands in the work space."""
    arm = plus(p, vector(work, frame), -1.0)
    turning = vector(work, frame + VELOCITY + 3)
    return plus(vector(work, frame + VELOCITY), cross(turning, arm), 1.0)


@part
def acceleration_of(work: Float64[np.ndarray, " work"], frame: int, p: Vector) -> Vector:
    """Acceleration of a point that is fixed to a frame, at zero `dv`."""
    arm = plus(p, vector(work, frame), -1.0)
    turning = vector(work, frame + VELOCITY + 3)
    found = plus(vector(work, frame + BIAS), cross(turning, cross(turning, arm)), 1.0)
    return plus(found, cross(vector(work, frame + BIAS + 3), arm), 1.0)


@part
def distance_motion(
    work: Float64[np.ndarray, " work"], frames: tuple[int, int], points: tuple[Vector, Vector]
) -> tuple[float, Vector, Vector, float, float]:
    """Motion of the distance of two points that are fixed to frames.

    Returns the distance, the direction n to the first point, the velocity of the first against the
    second, the distance's rate, and its second derivative at zero `dv`.
    """
    (one, other), (p, q) = frames, points
    offset = plus(p, q, -1.0)
    length = max(sqrt(dot(offset, offset)), TOUCHING)
    n = (offset[0] / length, offset[1] / length, offset[2] / length)
    slip = plus(velocity_of(work, one, p), velocity_of(work, other, q), -1.0)
    rate = dot(n, slip)
    pulled = plus(acceleration_of(work, one, p), acceleration_of(work, other, q), -1.0)
    return length, n, slip, rate, dot(n, pulled) + (dot(slip, slip) - rate * rate) / length


@part
def between(frames: Frames, one: int, other: int) -> tuple[int, int, int, int]:
    """Places of the coordinates that move one frame against another: begin and end of both lists.

    What moves both stands first in either list, and moves neither against the other.
    """
    starts, columns = frames.starts, frames.columns
    i, j = int(starts[one]), int(starts[other])
    end, last = int(starts[one + 1]), int(starts[other + 1])
    while i < end and j < last and columns[i] == columns[j]:
        i, j = i + 1, j + 1
    return i, end, j, last


@part
def write_distance(
    state: StateNumbers,
    assembly: StackNumbers,
    row: int,
    frames: tuple[int, int],
    points: tuple[Vector, Vector],
    n: Vector,
) -> None:
    """Coefficients of a distance's rate, n (J_p - J_q), in a row that is zero."""
    motion, table, rows = state.motion, assembly.owners.frames, assembly.rows
    one, one_end, other, other_end = between(table, frames[0], frames[1])
    for side in range(2):
        (x, y, z), sign = points[side], 1.0 - 2.0 * side
        begin, end = (one, one_end) if side == 0 else (other, other_end)
        for k in range(begin, end):
            column = int(table.columns[k])
            c = column_at(motion, column, x, y, z)
            rows.matrix[rows.first + row, column] = sign * dot(n, (c[0], c[1], c[2]))


@part
def clear(assembly: StackNumbers, first: int, count: int, columns: int) -> None:
    """Make rows of a limit empty: without coefficients and bounds."""
    rows = assembly.rows
    for row in range(first, first + count):
        for k in range(columns):
            rows.matrix[rows.first + row, k] = 0.0
        rows.target[row], rows.upper[row], rows.weight[row] = -np.inf, np.inf, 1.0
        rows.error[row] = np.inf
