"""Single fields of what a device gives, which may be anything, read as what they shall be.

`FieldError`: what is none. `shown`: anything in a few words. `number`, `numbers`, `flag`, `pair`,
`of_kind` and `Vectors` read.
"""

import reprlib
from collections.abc import Collection
from typing import Any, TypeVar

import numpy as np
from jaxtyping import Float64

_REAL, _TRUTH = float | int | np.floating | np.integer, bool | int | np.bool_ | np.integer
"""Kinds of numbers that a device may give, made once."""
_PLAIN = type(None) | bool | float | complex | np.number | np.bool_
"""What is no longer than a number when it is written."""
_MOST_BITS = 64
"""Longer whole numbers are written in a time that grows with the square of their length."""
_MOST_NUMBERS = 16
"""An array of more is said by its shape."""

T = TypeVar("T")


class FieldError(TypeError):
    """Fields of a sample that are of another kind than they should be.

    Attributes:
        fields: their names.
    """

    def __init__(self, fields: tuple[str, ...], words: str) -> None:
        super().__init__(words)
        self.fields = fields


class _Brief(reprlib.Repr):
    """`repr` in a tick's time, whatever comes: that of a thing nobody knows may take any."""

    def __init__(self) -> None:
        super().__init__()
        self.maxlevel, self.maxstring = 2, 60

    def repr1(self, x: object, level: int) -> str:
        """A value, with so many levels of lists in lists."""
        if isinstance(x, np.ndarray):
            brief = x.size <= _MOST_NUMBERS and x.dtype.kind in "biufc"
            return repr(x) if brief else f"an array of {x.dtype.name} and shape {x.shape}"
        if type(x) is int and x.bit_length() > _MOST_BITS:
            return f"a whole number of {x.bit_length()} bits"
        if type(x) in (int, str, list, tuple):
            return super().repr1(x, level)
        return repr(x) if isinstance(x, _PLAIN) else f"a {type(x).__name__}"


_BRIEF = _Brief()


def shown(value: object) -> str:
    """What a value is, in a few words and in little time."""
    return _BRIEF.repr(value)


def of_kind(field: str, value: object, kind: type[T]) -> T:
    """A field that is of a kind.

    Raises:
        FieldError: it is not.
    """
    if not isinstance(value, kind):
        raise FieldError((field,), f"{field} is {shown(value)}, no {kind.__name__}")
    return value


def number(field: str, value: object) -> float:
    """A field that is a number.

    Raises:
        FieldError: it is none.
        OverflowError: a whole number that is too large for a float.
    """
    value = _scalar(value)
    if not isinstance(value, _REAL):
        raise FieldError((field,), f"{field} is {shown(value)}, not a number")
    return _float(field, value)


def numbers(field: str, values: object, count: int) -> list[float]:
    """A field that is so many numbers: an array, a tuple or the like.

    Raises:
        FieldError: it is not.
        OverflowError: a whole number in it that is too large for a float.
    """
    if _length(values) == count and isinstance(values, tuple | list | Collection):
        given = [_scalar(value) for value in _items(values)]
        if all(isinstance(value, _REAL) for value in given):
            return [_float(field, value) for value in given]
    raise FieldError((field,), f"{field} is {shown(values)}, not {count} numbers")


def flag(field: str, value: object) -> bool:
    """A field that is true or false.

    Raises:
        FieldError: it is neither.
    """
    value = _scalar(value)
    if not isinstance(value, _TRUTH):
        raise FieldError((field,), f"{field} is {shown(value)}, not true or false")
    return bool(value)


def pair(field: str, values: object) -> tuple[Any, Any]:
    """A field that is one thing for the left and one for the right.

    Raises:
        FieldError: it is not.
    """
    if not isinstance(values, tuple | list) or _length(values) != 2:
        raise FieldError((field,), f"{field} is {shown(values)}, not a tuple of two")
    left, right = _items(values)
    return left, right


class Vectors:
    """Reads vectors of a sample as float64: a headset's are of float32, a message's are lists."""

    def __init__(self) -> None:
        self._faults: dict[str, str] = {}

    @property
    def error(self) -> FieldError | None:
        """What was none; None where all was well."""
        if not self._faults:
            return None
        return FieldError(tuple(self._faults), "; ".join(self._faults.values()))

    def vector(self, field: str, value: object, count: int) -> Float64[np.ndarray, " n"]:
        """So many numbers, as they are now; NaN where there are others, or none."""
        if isinstance(value, np.ndarray) and value.dtype == np.float64 and value.shape == (count,):
            return value.copy()
        numbers = _array(value, count)
        if numbers is not None and numbers.shape == (count,) and numbers.dtype.kind in "fiu":
            return numbers.astype(np.float64)
        if value is not None:
            self._faults[field] = f"{field} is {shown(value)}, not {count} numbers"
        return np.full(count, np.nan)

    def maybe(self, field: str, value: object, count: int) -> Float64[np.ndarray, " n"] | None:
        """Likewise of what need not be there."""
        return None if value is None else self.vector(field, value, count)


def _length(value: object) -> int | None:
    """How many things are in it; None for a single one."""
    if not isinstance(value, tuple | list | Collection):
        return None
    try:
        return len(value)
    except TypeError:
        # An array or the like without axes.
        return None


def _items(values: Collection[Any]) -> list[Any]:
    return list(values)


def _scalar(value: object) -> object:
    """What an array of no axes holds; anything else as it is."""
    return value[()] if isinstance(value, np.ndarray) and value.ndim == 0 else value


def _float(field: str, value: Any) -> float:
    try:
        return float(value)
    except OverflowError:
        raise OverflowError(f"{field} is {shown(value)}, too large for a float") from None


def _array(value: object, count: int) -> np.ndarray | None:
    """It as an array; None for what is none, or surely another one.

    That is found out before: it takes long to make an array of a long list.
    """
    if _length(value) not in (None, count):
        return None
    if isinstance(value, tuple | list) and any(_length(item) is not None for item in _items(value)):
        return None
    try:
        return np.asarray(value)
    except ValueError:
        return None
