"""What of a measurement is of use: arrays, times, readings of an inertial unit, wrenches."""

import math
from typing import TypeGuard

import numpy as np
from jaxtyping import Float64

from poise._checks import laid_out
from poise._compiled import compiled
from poise.dynamics import RobotState, SensorReadings

_LARGEST = 1e6
"""Larger numbers are no robot's; their squares overflow."""

_FASTEST_TURN, _HARDEST_SHOCK = 100.0, 500.0
"""No unit on a robot measures more [rad/s, m/s^2]; one that says so says nothing."""

_NO_WRENCH = np.full(6, np.nan)
"""Of a sole that says nothing: it is in no contact."""


def felt_by(state: RobotState) -> dict[str, Float64[np.ndarray, "6"]]:
    """Wrenches of a state; what is not six finite numbers is NaN."""
    wrenches = {name: state.wrench(name) for name in state.contacts}
    return {name: _NO_WRENCH if found is None else found for name, found in wrenches.items()}


def is_vector(value: object, size: int, first: int) -> bool:
    """Whether a vector has a size, and sane numbers from one on; NaN fails every comparison."""
    return is_array(value, size) and _is_sane(laid_out(value), first)


@compiled
def _is_sane(numbers: Float64[np.ndarray, " n"], first: int) -> bool:
    # Numba compiles no generators.
    for i in range(first, len(numbers)):  # noqa: SIM110
        if not abs(numbers[i]) <= _LARGEST:
            return False
    return True


def is_array(value: object, size: int) -> TypeGuard[Float64[np.ndarray, " n"]]:
    """Whether it is so many numbers, whatever they are."""
    return isinstance(value, np.ndarray) and value.shape == (size,) and value.dtype == np.float64


def usable_reading(reading: SensorReadings | None) -> bool:
    """Whether an inertial unit says something that a robot's can say."""
    if reading is None:
        return False
    rate, force = reading.angular_velocity, reading.specific_force
    if not (is_array(rate, 3) and is_array(force, 3)):
        return False
    # Written so that NaN fails.
    turn, shock = math.hypot(*rate.tolist()), math.hypot(*force.tolist())
    return turn <= _FASTEST_TURN and shock <= _HARDEST_SHOCK
