"""What a user may pass as numbers, and checks of single values."""

from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np

from poise.errors import ConfigurationError

Numbers = np.ndarray | Sequence[Any] | float | int
"""What becomes an array of floats: an array, nested sequences, or one number."""

T = TypeVar("T")


def checked_kind(value: object, kind: type[T], what: str) -> T:
    """A value of the right kind.

    Raises:
        ConfigurationError: it is of another.
    """
    if not isinstance(value, kind):
        raise ConfigurationError(f"{what} is of the wrong kind", got=value, wanted=kind.__name__)
    return value


def checked_number(value: float, what: str, *, above: float | None = None) -> float:
    """A finite number, not negative, or strictly above a bound.

    Raises:
        ConfigurationError: it is not.
    """
    wanted = "a finite number >= 0" if above is None else f"a finite number > {above:g}"
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise ConfigurationError(f"{what} is not a number", got=value, wanted=wanted) from None
    if not np.isfinite(number) or number < 0.0 or (above is not None and number <= above):
        raise ConfigurationError(f"{what} is out of range", got=value, wanted=wanted)
    return number
