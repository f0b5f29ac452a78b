"""Validation of states in the control loop."""

import numpy as np
from jaxtyping import Float64

from poise._checks import is_array, is_time, laid_out
from poise._compiled import compiled
from poise.dynamics import Payload, RobotState
from poise.robots import Robot

_QUATERNION_TOLERANCE = 1e-3
"""Deviation of the base quaternion's norm from one; Pinocchio assumes a unit quaternion."""

_LARGEST = 1e6
"""Largest position or speed of a robot [m, rad, m/s, rad/s]; far beyond, squares overflow."""

_MOST_NAMED = 3
"""Entries at fault that are named; more are counted."""


def is_usable(state: object, robot: Robot) -> bool:
    """Check kinds and sizes, finite and sane numbers, and the norm of the base quaternion."""
    if not isinstance(state, RobotState):
        return False
    q, v = state.q, state.v
    if not (is_array(q, robot.nq) and is_array(v, robot.nv) and is_time(state.time)):
        return False
    if not _is_payload(state.payload):
        return False
    return _is_sane(laid_out(q), laid_out(v), robot.floating_base)


def fault_of(state: object, robot: Robot) -> str:
    """Describe the fault of a state; "" for one that is usable."""
    if is_usable(state, robot):
        return ""
    if not isinstance(state, RobotState):
        return f"the state is of kind {type(state).__name__}, wanted RobotState"
    for name, value, size in (("q", state.q, robot.nq), ("v", state.v, robot.nv)):
        if not is_array(value, size):
            return f"{name} is {_kind(value)}, wanted {size} numbers"
    if not is_time(state.time):
        return f"the time is {state.time!r}, wanted seconds"
    if not _is_payload(state.payload):
        return f"the payload is of kind {type(state.payload).__name__}, wanted Payload"
    for name, value, entries in (
        ("q", state.q, _entries(robot, robot.nq)),
        ("v", state.v, _entries(robot, robot.nv)),
    ):
        bad = np.flatnonzero(~(np.abs(value) <= _LARGEST)).tolist()
        if bad:
            named = ", ".join(f"{entries[i]} is {value[i]:g}" for i in bad[:_MOST_NAMED])
            more = len(bad) - _MOST_NAMED
            return f"in {name}, {named}" + (f" and {more} more" if more > 0 else "")
    norm = float(np.linalg.norm(state.q[3:7]))
    return f"the base quaternion q[3:7] has length {norm:g}, wanted 1"


@compiled
def _is_sane(
    q: Float64[np.ndarray, " nq"], v: Float64[np.ndarray, " nv"], floating_base: bool
) -> bool:
    """Check size and quaternion; NaN fails every comparison."""
    for numbers in (q, v):
        for i in range(len(numbers)):
            if not abs(numbers[i]) <= _LARGEST:
                return False
    if not floating_base:
        return True
    square = q[3] * q[3] + q[4] * q[4] + q[5] * q[5] + q[6] * q[6]
    return abs(square - 1.0) < 2.0 * _QUATERNION_TOLERANCE


def _kind(value: object) -> str:
    """Describe a value that is no vector."""
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape} and type {value.dtype}"
    return f"of kind {type(value).__name__}"


def _entries(robot: Robot, size: int) -> list[str]:
    """Name the entries of q or v: base by number, joints by name."""
    base = size - robot.nj
    return [f"entry {i} of the base" for i in range(base)] + list(robot.joint_names)


def _is_payload(value: object) -> bool:
    return value is None or isinstance(value, Payload)
