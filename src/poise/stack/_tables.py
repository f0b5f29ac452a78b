"""The table of who has rows, and where the rows go: what compiled formulas share.

All that they read of a task stands in one array, its parameters: the rows of `Gains`, each as long
as the task, then its target. A number that nobody gave is NaN.
"""

from enum import IntEnum

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import MemoryBlock
from poise.dynamics import KINEMATICS, Frames


class Kind(IntEnum):
    """Kind of a task, a contact or a limit."""

    CONTACT = 0
    COM = 1
    MOMENTUM = 2
    JOINTS = 3
    FRAME = 4
    RELATIVE_FRAME = 5
    BALANCE = 6
    SELF_COLLISION = 7


CONTACT, COM, MOMENTUM, JOINTS, FRAME, RELATIVE_FRAME, BALANCE, SELF_COLLISION = (
    int(kind) for kind in Kind
)

KP, KD, WEIGHT, RATE, SPEED, ACCELERATION, GIVEN_VELOCITY, GAINS = range(8)
"""Rows of a task's gains: stiffness, damping, weight, kp / kd, the speed that bounds the block of
the row, and what `set_acceleration` and `set_velocity` were given; how many there are."""

KIND, FIRST, COUNT, START, FRAME_INDEX, ROOT_INDEX, CHOSEN, TURNS, SINE, ENTRIES = range(10)
"""Columns of the table of owners: kind, first row and number of rows, where its parameters begin,
its frames in `Frames`, where its choice of components begins, whether it turns, and how."""

TARGET_ROTATION, TARGET_VELOCITY, TARGET_ACCELERATION, TARGET_SIZE = 3, 12, 18, 24
"""Where the parts of a frame's target begin after its position, and how long it is."""

OWN_AXES = 6
"""The component of a frame's motion from which on it is turning about the frame's own axes."""

POINTS, OUTLINE = 12, 16
CORNERS = 2 * (POINTS + OUTLINE)
"""Points a contact of the room for polygons: corners of a rectangle and two others for each, and
the outline of these others, which may take twice as many while it is looked for; all of it for the
rectangle, and again for a smaller one."""

WORK = 3 * KINEMATICS
"""Numbers of work space that anybody has: two frames, and what is worked out from them."""


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
    """Who the rows belong to."""

    lines: Int64[np.ndarray, "owners entries"]  # an owner a line: `KIND`, ...; contacts first
    chosen: Int64[np.ndarray, " c"]  # components that each has rows for, or coordinates
    places: Int64[np.ndarray, " owners"]  # address of the `Numbers` of each owner's parameters
    parameters: Float64[np.ndarray, " p"]  # of all owners, one after another, gathered each time
    frames: Frames
    corners: Float64[np.ndarray, "k 2"]  # `CORNERS` points a contact and `CORNERS` more


class StackNumbers(MemoryBlock):
    """All that `evaluate` reads and writes."""

    owners: Owners
    rows: Rows
    work: Float64[np.ndarray, " work"]
    count: int  # owners that are evaluated
    velocities: int  # 1 where rows are on velocities, 0 where on accelerations


Line = Int64[np.ndarray, " entries"]
"""A line of `Owners.lines`."""
