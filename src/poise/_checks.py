"""Numbers from users, and checks of single values."""

import math
import sys
from collections.abc import Sequence
from typing import Any, TypeGuard, TypeVar

import numpy as np
from jaxtyping import Float64

from poise.errors import ConfigurationError

Numbers = np.ndarray | Sequence[Any] | float | int
"""Input that becomes an array of floats."""

T = TypeVar("T")

_NUMBER = np.dtype(np.float64)
_REAL, _LARGEST_FLOAT = (float, int), sys.float_info.max
"""Made once, for every tick."""


def checked_kind(value: object, kind: type[T], what: str) -> T:
    """Return a value of the right kind, or raise."""
    if not isinstance(value, kind):
        raise ConfigurationError(f"{what} is of the wrong kind", got=value, wanted=kind.__name__)
    return value


def checked_number(value: float, what: str, *, above: float | None = None) -> float:
    """Return a finite number, not negative or strictly above a bound, or raise."""
    wanted = "a finite number >= 0" if above is None else f"a finite number > {above:g}"
    try:
        given = np.asarray(value)
        # `float` reads texts and truth values, too, which are no numbers here.
        taken = given.ndim == 0 and given.dtype.kind in "fiuO"
        number = float(value) if taken else None
    except (TypeError, ValueError, OverflowError):
        number = None
    if number is None:
        raise ConfigurationError(f"{what} is not a number", got=value, wanted=wanted)
    if not np.isfinite(number) or number < 0.0 or (above is not None and number <= above):
        raise ConfigurationError(f"{what} is out of range", got=value, wanted=wanted)
    return number


def checked_time_limit(seconds: float | None) -> float | None:
    """Return a cap on the time of a solve [s], None for none, or raise."""
    return None if seconds is None else checked_number(seconds, "time_limit [s]", above=0.0)


def checked_count(value: object, what: str) -> int:
    """Return a whole number, not negative, as of a seed or a tick, or raise."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < 0:
        raise ConfigurationError(f"{what} is no whole number", got=value, wanted="0, 1, 2, ...")
    return int(value)


def all_finite(numbers: np.ndarray) -> bool:
    """Test an array of floats for NaN and infinity, in little time where it is short."""
    row = numbers if numbers.ndim == 1 else numbers.ravel()
    # A sum of finite numbers may overflow.
    return math.isfinite(sum(row.tolist())) or bool(np.isfinite(numbers).all())


def is_array(value: object, size: int) -> TypeGuard[Float64[np.ndarray, " n"]]:
    """Test for a vector of floats."""
    return isinstance(value, np.ndarray) and value.shape == (size,) and value.dtype == _NUMBER


def laid_out(numbers: np.ndarray) -> np.ndarray:
    """Return the numbers in the layout of compiled code, copied if need be."""
    return numbers if numbers.flags.carray else np.array(numbers)


def is_time(value: object) -> TypeGuard[float]:
    """Test for a finite number that a float can hold."""
    return isinstance(value, _REAL) and abs(value) <= _LARGEST_FLOAT
