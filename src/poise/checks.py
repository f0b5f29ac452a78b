"""What a user may pass as a number or numbers, and the check of a single one."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from poise.errors import ConfigurationError

Numbers = np.ndarray | Sequence[Any] | float | int
"""What becomes an array of floats: an array, nested sequences, or one number."""


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
