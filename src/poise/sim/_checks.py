"""Checks of configuration values, with messages that say what was given and what was wanted."""

import math
from collections.abc import Iterable

from poise.errors import ConfigurationError


def require_finite(name: str, value: object) -> float:
    """Refuse NaN, infinity and anything that is not a number.

    Returns:
        The value.

    Raises:
        ConfigurationError: the value is not a finite number.
    """
    # Values come from files as well, where anything may stand in the place of a number.
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ConfigurationError(f"{name} is not a finite number", got=value, wanted="a number")
    return float(value)


def require_positive(name: str, value: object) -> None:
    """Refuse anything but a finite number above zero.

    Raises:
        ConfigurationError: the value is not positive.
    """
    if require_finite(name, value) <= 0.0:
        raise ConfigurationError(f"{name} must be positive", got=value, wanted="> 0")


def require_not_negative(name: str, value: object) -> None:
    """Refuse anything but a finite number of zero or above.

    Raises:
        ConfigurationError: the value is negative.
    """
    if require_finite(name, value) < 0.0:
        raise ConfigurationError(f"{name} must not be negative", got=value, wanted=">= 0")


def require_vector(name: str, value: Iterable[object], size: int) -> None:
    """Refuse anything but `size` finite numbers.

    Raises:
        ConfigurationError: wrong length, or an element that is not a finite number.
    """
    items = tuple(value)
    if len(items) != size:
        raise ConfigurationError(
            f"{name} has the wrong length", got=items, wanted=f"{size} numbers"
        )
    for item in items:
        require_finite(name, item)


def require_multiple(name: str, value: float, unit_name: str, unit: float) -> int:
    """How many times `unit` goes into `value`, refusing what is not a whole number of times.

    Returns:
        The whole number of times.

    Raises:
        ConfigurationError: `value` is not a multiple of `unit`.
    """
    times = round(value / unit)
    # Decimal fractions such as 0.001 are not exact in binary: allow their rounding, no more.
    if abs(times * unit - value) > 1e-9 * max(abs(value), unit):
        raise ConfigurationError(
            f"{name} must be a multiple of {unit_name}",
            got=value,
            wanted=f"a whole number times {unit}",
        )
    return times
