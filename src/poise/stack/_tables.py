"""The table of who has rows, and where the rows go: what compiled formulas share.

All that they read of a task stands in one array, its parameters: the rows of `Gains`, each as long
as the task, then its target. A number that nobody gave is NaN.
"""

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from poise.dynamics import KINEMATICS, Frames


class Kind(IntEnum):
    """What a task, a contact or a limit is."""

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


class Rows(NamedTuple):
    """Where the rows are written.

    Attributes:
        matrix: receives the coefficients; rows begin at `first`, in the first columns.
        target: receives the right-hand sides: reference - drift, or velocities.
        upper: receives them again, as the upper bounds of equalities.
        weight: receives the weight of each row.
        drift: receives accelerations at zero `dv`.
        reference: receives reference accelerations.
        error: receives target minus actual.
        fade: receives the part of it that is fed back, less than one near half a turn.
        error_rate: receives its rate.
        feedforward: receives the targets' accelerations.
        wrench_lower: receives lower bounds of all wrenches [N, N m].
        wrench_upper: receives the upper ones.
        first: the matrix's row of the first row.
    """

    matrix: Float64[np.ndarray, "rows columns"]
    target: Float64[np.ndarray, " m"]
    upper: Float64[np.ndarray, " m"]
    weight: Float64[np.ndarray, " m"]
    drift: Float64[np.ndarray, " m"]
    reference: Float64[np.ndarray, " m"]
    error: Float64[np.ndarray, " m"]
    fade: Float64[np.ndarray, " m"]
    error_rate: Float64[np.ndarray, " m"]
    feedforward: Float64[np.ndarray, " m"]
    wrench_lower: Float64[np.ndarray, " w"]
    wrench_upper: Float64[np.ndarray, " w"]
    first: int


class Owners(NamedTuple):
    """Who the rows belong to.

    Attributes:
        table: an owner a line: `KIND`, `FIRST`, ...; contacts come first.
        chosen: which components of its quantity each owner has rows for, or which coordinates.
        parameters: of all owners, one after another.
        frames: the frames that they name.
        corners: room for polygons, `CORNERS` points a contact and `CORNERS` more.
    """

    table: Int64[np.ndarray, "owners entries"]
    chosen: Int64[np.ndarray, " c"]
    parameters: Float64[np.ndarray, " p"]
    frames: Frames
    corners: Float64[np.ndarray, "k 2"]
