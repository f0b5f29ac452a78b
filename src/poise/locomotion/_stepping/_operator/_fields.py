"""Validation of what devices return, which may be anything: floats come out, or a `FieldError`.

`WarnOnce`: logs each kind of such faults once.
"""

import logging
import math
import reprlib
from collections.abc import Callable
from typing import Any, TypeVar

import msgspec
import numpy as np
from msgspec.structs import asdict

from poise.locomotion._stepping._operator._sample import (
    BodyCommand,
    OperatorSample,
    Quaternion,
    TrackedPose,
    Vector,
)

_LOG = logging.getLogger("poise")

# Kinds whose `repr` is no longer than a number's
_PLAIN = type(None) | bool | float | complex | np.number | np.bool_
# Longer whole numbers are written in a time that grows with the square of their length
_MOST_BITS = 64
_MOST_NUMBERS = 16  # Larger arrays are shown by their shape; no field has more than 4 numbers

_Turns = tuple[float, float]
_FLAG = bool | int
# Types of fields, in words
_WANTED: dict[Any, str] = {
    float: "a number", _FLAG: "true or false", _Turns: "2 numbers", Vector: "3 numbers",
    Quaternion: "4 numbers",
}  # fmt: skip

_ARRAYS = (np.ndarray, np.generic)

# Of a tracked part
_VECTORS: dict[str, Any] = {"position": Vector, "orientation": Quaternion, "velocity": Vector}

T = TypeVar("T")


class FieldError(TypeError):
    """Fields of a sample that are of another kind than they should be."""

    def __init__(self, fields: tuple[str, ...], words: str) -> None:
        super().__init__(words)
        self.fields = fields


class WarnOnce:
    """Log faults on the logger `poise`, each kind once: most recur in the next tick."""

    def __init__(self) -> None:
        self._logged = set[tuple[type[Exception], str]]()

    def __call__(self, error: Exception, message: str, *names: str) -> None:
        """Log an error with its traceback, unless all of its kinds have been logged."""
        fields = error.fields if isinstance(error, FieldError) else ("",)
        kinds = {(type(error), field) for field in fields}
        if not kinds <= self._logged:
            self._logged |= kinds
            _LOG.error(message, *names, exc_info=error)


def checked_sample(sample: object) -> tuple[OperatorSample | None, FieldError | None]:
    """Validate what a device returned, which may be anything."""
    if sample is None:
        return None, None
    sample = _of_kind("sample", sample, OperatorSample)
    for read in (_as_it_is, _bare):
        try:
            return _converted(sample, read), None
        except (TypeError, ValueError, msgspec.ValidationError):
            continue
    faults = dict[str, str]()
    good = _checked_by_field(sample, faults)
    return good, FieldError(tuple(faults), "; ".join(faults.values())) if faults else None


def checked_reading(arm: str, reading: object) -> TrackedPose | None:
    """Validate what an arm of a foot returned: its position, and whether its clutch is closed."""
    if reading is None:
        return None
    position, clutch = _two(f"reading of {arm}", reading)
    faults = dict[str, str]()
    position = _vector(f"position of {arm}", position, Vector, faults)
    if faults:
        raise FieldError(tuple(faults), "; ".join(faults.values()))
    return TrackedPose(position, bool(_read(f"clutch of {arm}", clutch, _FLAG)))


def _parts(sample: OperatorSample) -> tuple[Any, ...]:
    """Feet, hands and head, of whatever kind."""
    return *_two("feet", sample.feet), *_two("hands", sample.hands), sample.head


def _converted(sample: OperatorSample, read: Callable[[Any], Any]) -> OperatorSample:
    """A sample of numbers, each value as it is read; raises for anything else."""
    members = {name: read(value) for name, value in asdict(sample).items()}
    left, right, *hands, head = (
        None if part is None else {name: read(value) for name, value in asdict(part).items()}
        for part in _parts(sample)
    )
    body = {name: read(value) for name, value in asdict(sample.body).items()}
    members |= {"feet": (left, right), "hands": hands, "head": head, "body": body}
    return msgspec.convert(members, OperatorSample)


def _checked_by_field(sample: OperatorSample, faults: dict[str, str]) -> OperatorSample:
    body, names = _of_kind("body", sample.body, BodyCommand), ("left", "right")
    names = *(f"{side} foot" for side in names), *(f"{side} hand" for side in names), "head"
    left, right, left_hand, right_hand, head = (
        _part(*named, faults) for named in zip(names, _parts(sample), strict=True)
    )
    return OperatorSample(
        _read("time", sample.time, float),
        (left, right),
        (left_hand, right_hand),
        head,
        BodyCommand(
            _read("height", body.height, float),
            _read("torso", body.torso, Vector),
            _read("turns", body.turns, _Turns),
        ),
        _read("velocity", sample.velocity, Vector),
        bool(_read("upright", sample.upright, _FLAG)),
        bool(_read("rest", sample.rest, _FLAG)),
    )


def _of_kind(field: str, value: object, kind: type[T]) -> T:
    if not isinstance(value, kind):
        raise FieldError((field,), f"{field} is {_BRIEF.repr(value)}, no {kind.__name__}")
    return value


def _two(field: str, values: object) -> tuple[object, object]:
    if not isinstance(values, tuple | list) or len(values) != 2:
        raise FieldError((field,), f"{field} is {_BRIEF.repr(values)}, not a tuple of two")
    return values[0], values[1]


def _part(field: str, value: object, faults: dict[str, str]) -> TrackedPose | None:
    """A tracked part; None for none."""
    if value is None:
        return None
    part = _of_kind(field, value, TrackedPose)
    vectors = {
        name: _vector(f"{name} of {field}", vector, kind, faults)
        for name, kind in _VECTORS.items()
        if (vector := getattr(part, name)) is not None
    }
    clutch = part.clutch
    if clutch is not None:
        clutch = bool(_read(f"clutch of {field}", clutch, _FLAG))
    return TrackedPose(clutch=clutch, **vectors)


def _vector(field: str, value: object, kind: Any, faults: dict[str, str]) -> Any:
    """So many numbers; NaN where there are others, or none."""
    try:
        return _read(field, value, kind)
    except FieldError as error:
        if value is not None:
            faults[field] = str(error)
        return (math.nan,) * len(kind.__args__)


def _read(field: str, value: object, kind: Any) -> Any:
    """A field of one of msgspec's types, read from plain values, small arrays or their lists."""
    try:
        return msgspec.convert(_bare(value), kind)
    except msgspec.ValidationError:
        words = f"{field} is {_BRIEF.repr(value)}, not {_WANTED[kind]}"
        raise FieldError((field,), words) from None


def _as_it_is(value: object) -> object:
    return value


def _bare(value: Any) -> Any:
    """Plain numbers or lists of them, where there are few."""
    value = _plain(value)
    few = type(value) in (tuple, list) and len(value) <= _MOST_NUMBERS
    return [item if type(item) is float else _plain(item) for item in value] if few else value


def _plain(value: Any) -> Any:
    """Lists and numbers of Python in place of small arrays and NumPy's numbers."""
    small = isinstance(value, _ARRAYS) and value.size <= _MOST_NUMBERS
    return value.tolist() if small and value.dtype.kind in "biuf" else value


class _Brief(reprlib.Repr):
    """`repr` in a tick's time: that of an unknown object may take any."""

    def __init__(self) -> None:
        super().__init__()
        self.maxlevel, self.maxstring = 2, 60

    def repr1(self, x: object, level: int) -> str:
        """A value, with so many levels of nested lists."""
        if isinstance(x, np.ndarray):
            brief = x.size <= _MOST_NUMBERS and x.dtype.kind in "biufc"
            return repr(x) if brief else f"an array of {x.dtype.name} and shape {x.shape}"
        if type(x) is int and x.bit_length() > _MOST_BITS:
            return f"a whole number of {x.bit_length()} bits"
        if type(x) in (int, str, list, tuple):
            return super().repr1(x, level)
        return repr(x) if isinstance(x, _PLAIN) else f"a {type(x).__name__}"


_BRIEF = _Brief()
