"""Table of the owners of rows and of their places, shared by the compiled formulas.

All that they read of a task stands in one array, its parameters: the rows from `KP` on, each as
long as the task, then its target. A number that was not given is NaN.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import MemoryBlock, part
from poise.dynamics import KINEMATICS, Frames

KP, KD, WEIGHT, RATE, SPEED, ACCELERATION, GIVEN_VELOCITY, GAINS = range(8)
"""Rows of a task's gains: stiffness, damping, weight, kp / kd, the speed that bounds the block of
the row, and what `set_acceleration` and `set_velocity` were given; how many there are."""

TARGET_ROTATION, TARGET_VELOCITY, TARGET_ACCELERATION, TARGET_SIZE = 3, 12, 18, 24
"""Offsets of the parts of a frame's target after its position, and its length."""

OWN_AXES = 6
"""The component of a frame's motion from which on it is turning about the frame's own axes."""

WORK = 3 * KINEMATICS
"""Length of each work space: two frames and quantities derived from them."""


class Rows(MemoryBlock):
    """Memory that the rows are written into."""

    matrix: Float64[np.ndarray, "rows columns"]  # coefficients, from row `first` on, first columns
    target: Float64[np.ndarray, " m"]  # right-hand sides: reference - drift, or velocities
    upper: Float64[np.ndarray, " m"]  # the same, as the upper bounds of equalities
    weight: Float64[np.ndarray, " m"]
    drift: Float64[np.ndarray, " m"]  # accelerations at zero `dv`
    reference: Float64[np.ndarray, " m"]  # reference accelerations
    error: Float64[np.ndarray, " m"]  # target minus actual
    fade: Float64[np.ndarray, " m"]  # part of it that is fed back, below one near half a turn
    error_rate: Float64[np.ndarray, " m"]
    feedforward: Float64[np.ndarray, " m"]  # the targets' accelerations
    wrench_lower: Float64[np.ndarray, " w"]  # bounds of all wrenches [N, N m]
    wrench_upper: Float64[np.ndarray, " w"]
    first: int  # the matrix's row of the first row


class Numbers(MemoryBlock):
    """Some numbers, wherever they lie."""

    all: Float64[np.ndarray, " _"]


class Owners(MemoryBlock):
    """Kinds of owners of rows."""

    lines: Int64[np.ndarray, "owners entries"]  # a `Line` each; contacts first
    contacts: int  # how many they are
    chosen: Int64[
        np.ndarray, " c"
    ]  # components that each has rows for, or coordinates; ends of blocks
    places: Int64[np.ndarray, " owners"]  # address of the `Numbers` of each owner's parameters
    parameters: Float64[np.ndarray, " p"]  # of all owners, one after another, gathered each time
    frames: Frames
    corners: Float64[np.ndarray, "k 2"]  # room for outlines, see `_support`


class StackNumbers(MemoryBlock):
    """All that `evaluate` reads and writes."""

    owners: Owners
    rows: Rows
    work: Float64[np.ndarray, " work"]
    count: int  # owners that are evaluated
    velocities: int  # 1 where rows are on velocities, 0 where on accelerations


class Line(NamedTuple):
    """Entry of the table of owners."""

    kind: int  # see `_evaluation`
    first: int  # row
    dim: int  # number of rows
    start: int  # of its parameters
    frame: int  # its first in `Frames`
    root: int  # its last
    chosen: int  # where its choice of components begins
    size: int  # of that; ends of the task's blocks of rows follow
    turns: int  # 1 where there is a target rotation
    sine: int  # 1 where the orientation error is the sine


@part
def line_of(owners: Owners, i: int) -> Line:
    """The entry of an owner."""
    n = owners.lines[i]
    return Line(n[0], n[1], n[2], n[3], n[4], n[5], n[6], n[7], n[8], n[9])
