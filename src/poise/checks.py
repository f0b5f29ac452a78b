"""Checks on single numbers that a user passes."""

import numpy as np
from numpy.typing import ArrayLike

from poise.errors import ConfigurationError


def checked_number(value: ArrayLike, what: str, *, above: float | None = None) -> float:
    """A finite number, not negative, or strictly above a bound.

    Raises:
        ConfigurationError: it is not.
    """
    wanted = "a finite number >= 0" if above is None else f"a finite number > {above:g}"
    try:
        number = float(value)  # pyright: ignore[reportArgumentType]
    except (TypeError, ValueError):
        raise ConfigurationError(f"{what} is not a number", got=value, wanted=wanted) from None
    if not np.isfinite(number) or number < 0.0 or (above is not None and number <= above):
        raise ConfigurationError(f"{what} is out of range", got=value, wanted=wanted)
    return number
