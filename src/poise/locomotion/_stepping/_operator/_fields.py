"""Validation of what devices return, which may be anything: floats come out, or a `FieldError`."""

import reprlib
from typing import Any, TypeVar

import msgspec
import numpy as np

from poise.locomotion._stepping._operator._sample import (
    BodyCommand,
    OperatorSample,
    Quaternion,
    TrackedPose,
    Vector,
)

_PLAIN = type(None) | bool | float | complex | np.number | np.bool_
"""Kinds whose `repr` is no longer than a number's."""
_MOST_BITS = 64
"""Longer whole numbers are written in a time that grows with the square of their length."""
_MOST_NUMBERS = 16
"""Larger arrays are shown by their shape; no field has more than 4 numbers."""

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


def checked_sample(sample: object) -> tuple[OperatorSample | None, FieldError | None]:
    """Validate what a device returned, which may be anything.

    A vector of a tracked part that is none becomes NaN, and the rest counts: a device that is out
    of sight takes nothing with it. Numbers that are not finite or far away are left to the guard,
    which refuses them one by one. Buttons and sticks, which no controller reads, are dropped.

    Args:
        sample: as returned; None for nothing new.

    Returns:
        The sample with tuples of floats, and which vectors in it are none; None for nothing.

    Raises:
        FieldError: no sample, or another field in it is of another kind.
    """
    if sample is None:
        return None, None
    sample, faults = _of_kind("sample", sample, OperatorSample), dict[str, str]()
    body = _of_kind("body", sample.body, BodyCommand)
    good = OperatorSample(
        time=_read("time", sample.time, float, "a number"),
        feet=_pair("foot", sample.feet, faults),
        hands=_pair("hand", sample.hands, faults),
        head=_part("head", sample.head, faults),
        body=BodyCommand(
            _read("height", body.height, float, "a number"),
            _read("torso", body.torso, Vector, "3 numbers"),
            _read("turns", body.turns, tuple[float, float], "2 numbers"),
        ),
        velocity=_read("velocity", sample.velocity, Vector, "3 numbers"),
        upright=_flag("upright", sample.upright),
        rest=_flag("rest", sample.rest),
    )
    return good, FieldError(tuple(faults), "; ".join(faults.values())) if faults else None


def checked_reading(arm: str, reading: object) -> TrackedPose | None:
    """Validate what an arm of a foot returned: its position, and whether its clutch is closed.

    Args:
        arm: its name.
        reading: as returned; None where it is gone. A position of None becomes NaN.

    Raises:
        FieldError: something else.
    """
    if reading is None:
        return None
    field = f"reading of {arm}"
    if not isinstance(reading, tuple | list) or len(reading) != 2:
        raise FieldError((field,), f"{field} is {_BRIEF.repr(reading)}, not a tuple of two")
    faults = dict[str, str]()
    position = _vector(f"position of {arm}", reading[0], Vector, 3, faults)
    if faults:
        raise FieldError(tuple(faults), "; ".join(faults.values()))
    return TrackedPose(position, _flag(f"clutch of {arm}", reading[1]))


def _of_kind(field: str, value: object, kind: type[T]) -> T:
    if not isinstance(value, kind):
        raise FieldError((field,), f"{field} is {_BRIEF.repr(value)}, no {kind.__name__}")
    return value


def _pair(
    part: str, values: object, faults: dict[str, str]
) -> tuple[TrackedPose | None, TrackedPose | None]:
    if not isinstance(values, tuple | list) or len(values) != 2:
        field = "feet" if part == "foot" else "hands"
        raise FieldError((field,), f"{field} is {_BRIEF.repr(values)}, not a tuple of two")
    left, right = values
    return _part(f"left {part}", left, faults), _part(f"right {part}", right, faults)


def _part(field: str, value: object, faults: dict[str, str]) -> TrackedPose | None:
    """A tracked part; None for none."""
    if value is None:
        return None
    part = _of_kind(field, value, TrackedPose)
    position, orientation, velocity, clutch = (
        part.position, part.orientation, part.velocity, part.clutch,
    )  # fmt: skip
    if position is not None:
        position = _vector(f"position of {field}", position, Vector, 3, faults)
    if orientation is not None:
        orientation = _vector(f"orientation of {field}", orientation, Quaternion, 4, faults)
    if velocity is not None:
        velocity = _vector(f"velocity of {field}", velocity, Vector, 3, faults)
    if clutch is not None:
        clutch = _flag(f"clutch of {field}", clutch)
    return TrackedPose(position, clutch, orientation, velocity)


def _vector(field: str, value: object, kind: Any, count: int, faults: dict[str, str]) -> Any:
    """So many numbers; NaN where there are others, or none."""
    try:
        return _read(field, value, kind, f"{count} numbers")
    except FieldError as error:
        if value is not None:
            faults[field] = str(error)
        return msgspec.convert([float("nan")] * count, kind)


def _flag(field: str, value: object) -> bool:
    if value is True or value is False:
        return value
    return bool(_read(field, value, bool | int, "true or false"))


def _read(field: str, value: object, kind: Any, wanted: str) -> Any:
    """A field of one of msgspec's types, read from plain values, small arrays or their lists."""
    try:
        return msgspec.convert(_plain(value), kind)
    except msgspec.ValidationError:
        pass
    try:
        if isinstance(value, tuple | list) and len(value) <= _MOST_NUMBERS:
            return msgspec.convert([_plain(item) for item in value], kind)
    except msgspec.ValidationError:
        pass
    raise FieldError((field,), f"{field} is {_BRIEF.repr(value)}, not {wanted}")


def _plain(value: object) -> object:
    """Lists and numbers of Python in place of small arrays and NumPy's numbers."""
    if type(value) is tuple:
        return value
    small = isinstance(value, np.ndarray | np.generic) and value.size <= _MOST_NUMBERS
    return value.tolist() if small and value.dtype.kind in "biuf" else value
