"""`OperatorSample`: one message of an operator, and validation of what devices return."""

import logging
import math
import reprlib
from collections.abc import Sequence
from typing import Annotated, Any, Protocol, TypeVar, runtime_checkable

import msgspec
import numpy as np
from msgspec import Meta, Struct
from msgspec.structs import asdict, fields

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]  # Of a rotation, (x, y, z, w)

Deflection = Annotated[float, Meta(ge=-1.0, le=1.0)]
"""Of a stick along one of its axes; records have none, and are read whatever a device gave."""

_Numbers = Sequence[float | int] | np.ndarray
NOWHERE: Vector = (math.nan, math.nan, math.nan)


def _floats(values: _Numbers | None) -> Any:
    return None if values is None else tuple(np.asarray(values, dtype=np.float64).tolist())


class TrackedPose(Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """Pose of one tracked part of the operator: a foot, a hand or the head.

    With a clutch a part leads by its motion alone, while its clutch is closed. Without one a foot's
    position is the goal of the foot.

    Attributes:
        position: of a foot without a clutch in the controller's world, on the page in the drawn
            one; otherwise forward, left and up as the torso faces, from any fixed origin [m]. None
            for a head.
        clutch: True while the part leads; None for a foot without a clutch.
        orientation: against forward, left and up, a unit quaternion (x, y, z, w); of a head against
            looking straight ahead. A hand turns by R_t R_0^T since its clutch closed at R_0; a foot
            by its part about the vertical. None where nothing measures it.
        velocity: along the axes of the position [m/s]; None, and a lag, where nothing measures it.
    """

    position: Vector | None = None
    clutch: bool | None = None
    orientation: Quaternion | None = None
    velocity: Vector | None = None

    @classmethod
    def of(
        cls,
        position: _Numbers | None,
        clutch: bool | None = None,
        orientation: _Numbers | None = None,
        velocity: _Numbers | None = None,
    ) -> "TrackedPose":
        """Make a pose of copies of arrays."""
        return cls(_floats(position), clutch, _floats(orientation), _floats(velocity))


class BodyCommand(Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """Command of the body beside feet and hands; all zero asks for nothing.

    Attributes:
        height: of the COM, over the usual one [m].
        torso: roll, pitch and yaw against upright and facing as the feet do; where torques are
            commanded [rad].
        turns: of the left and the right foot, to the left of `StepTeleoperator.ahead`; where
            torques are commanded [rad].
    """

    height: float = 0.0
    torso: Vector = (0.0, 0.0, 0.0)
    turns: tuple[float, float] = (0.0, 0.0)

    @property
    def numbers(self) -> tuple[float, float, float, float, float, float]:
        """Height, roll, pitch, yaw, and both turns."""
        return (self.height, *self.torso, *self.turns)


class OperatorSample(
    Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True, tag_field="do", tag="drive"
):
    """All that an operator commands at one time.

    Buttons, sticks and handles of a page or gamepad are integrated to positions and a velocity by
    their receiver; controllers read the other members.

    Attributes:
        time: of the measurement on the sender's clock [s]. In messages 0 means no clock.
        feet: devices of the left and the right foot, each of its sole; None for none. Controllers
            follow those without a clutch; `TrackedFeet` makes them of trackers.
        hands: left and right; None for a hand without a device, which stays as it is.
        head: orientation of the operator's; None without a headset: the gaze stays as it is.
        body: height, torso and turns of the feet.
        velocity: of a walk, ahead, to the left [m/s] and turning to the left [rad/s]; all zero
            while the operator steps. With commanded torques.
        upright: button: bring the torso upright although one foot is in the air.
        rest: button: hands without a lead go back to rest, and so does the gaze.
        lift: buttons that hold the left and the right foot up.
        move: stick, forward and left, cut off at -1 and 1: moves the lifted foot, or the robot.
        second: a second stick: moves the right foot while both are lifted.
        turn: stick that turns the robot to the left.
        grip: buttons that hold the left and the right hand.
        reach: stick, forward, left and up: moves the gripped hands.
        bend: sticks of height, roll, pitch and yaw of the torso, and turn of the held feet.
        neutral: button: the body goes back to `BodyCommand()`.
    """

    time: float = 0.0
    feet: tuple[TrackedPose | None, TrackedPose | None] = (None, None)
    hands: tuple[TrackedPose | None, TrackedPose | None] = (None, None)
    head: TrackedPose | None = None
    body: BodyCommand = BodyCommand()
    velocity: Vector = (0.0, 0.0, 0.0)
    upright: bool = False
    rest: bool = False
    lift: tuple[bool, bool] = (False, False)
    move: tuple[Deflection, Deflection] = (0.0, 0.0)
    second: tuple[Deflection, Deflection] = (0.0, 0.0)
    turn: Deflection = 0.0
    grip: tuple[bool, bool] = (False, False)
    reach: tuple[Deflection, Deflection, Deflection] = (0.0, 0.0, 0.0)
    bend: tuple[Deflection, Deflection, Deflection, Deflection, Deflection] = (
        0.0, 0.0, 0.0, 0.0, 0.0,
    )  # fmt: skip
    neutral: bool = False

    def place(self, foot: int) -> Vector:
        """Position of a foot's device, 0 left and 1 right [m]; NaN without one."""
        part = self.feet[foot]
        return NOWHERE if part is None or part.position is None else part.position


@runtime_checkable
class Device(Protocol):
    """A source of an operator's samples."""

    def sample(self, time: float) -> OperatorSample | None:
        """Return the newest sample since the last tick, at a time of the robot [s].

        Its vectors may be arrays or lists of any real numbers; None for nothing new.
        """
        ...


_LOG = logging.getLogger("poise")

# Kinds whose `repr` is no longer than a number's
_PLAIN = type(None) | bool | float | complex | np.number | np.bool_
_MOST_BITS = 64  # the time of writing longer whole numbers grows with the square of their length
_MOST_NUMBERS = 16  # larger arrays are shown by their shape; no field has more than 4 numbers
_ARRAYS = (np.ndarray, np.generic)

_PARTS = ("left foot", "right foot", "left hand", "right hand", "head")
_LENGTHS = {"position": 3, "orientation": 4, "velocity": 3}  # of the vectors of a tracked part
_FLAGS = ("upright", "rest", "clutch")
_WANTED = {"time": "a number", "height": "a number", "torso": "3 numbers", "turns": "2 numbers"}
_WANTED |= {name: f"{count} numbers" for name, count in _LENGTHS.items()}
_WANTED |= dict.fromkeys(_FLAGS, "true or false")

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
    """Return a sample of floats, in which bad vectors of parts are NaN, and what is bad in it."""
    if sample is None:
        return None, None
    whole = _of_kind("sample", sample, OperatorSample)
    given = (*_two("feet", whole.feet), *_two("hands", whole.hands), whole.head)
    parts = {
        name: None if part is None else asdict(_of_kind(name, part, TrackedPose))
        for name, part in zip(_PARTS, given, strict=True)
    }
    left, right, one, other, head = parts.values()
    # Without buttons and sticks, which no controller reads.
    members = {
        "time": whole.time,
        "feet": (left, right),
        "hands": (one, other),
        "head": head,
        "body": asdict(_of_kind("body", whole.body, BodyCommand)),
        "velocity": whole.velocity,
        "upright": whole.upright,
        "rest": whole.rest,
    }
    try:
        return msgspec.convert(members, OperatorSample), None
    except msgspec.ValidationError:
        return _mended(members, parts)


def checked_reading(arm: str, reading: object) -> TrackedPose | None:
    """Validate what an arm of a foot returned: its position, and whether its clutch is closed."""
    if reading is None:
        return None
    place, clutch = _two(f"reading of {arm}", reading)
    place = NOWHERE if place is None else _read(f"position of {arm}", place, Vector)
    return TrackedPose(place, bool(_read(f"clutch of {arm}", clutch, bool | int)))


def _mended(
    members: dict[str, Any], parts: dict[str, dict[str, Any] | None]
) -> tuple[OperatorSample, FieldError | None]:
    """Convert NumPy's numbers in a sample, and make vectors of parts NaN that are none."""
    faults = dict[str, str]()
    for label, part in (*parts.items(), ("body", members["body"]), ("", members)):
        kind = BodyCommand if label == "body" else TrackedPose if label else OperatorSample
        for info in fields(kind):
            key = info.name
            if part is None or key not in part or key in ("feet", "hands", "head", "body"):
                continue
            field = f"{key} of {label}" if kind is TrackedPose else key
            flag = key in _FLAGS
            try:
                value = _read(field, part[key], info.type | int if flag else info.type)
                part[key] = bool(value) if flag and value is not None else value
            except FieldError as fault:
                if kind is not TrackedPose or flag:
                    raise
                faults[field], part[key] = str(fault), (math.nan,) * _LENGTHS[key]
    good = msgspec.convert(members, OperatorSample)
    return good, FieldError(tuple(faults), "; ".join(faults.values())) if faults else None


def _of_kind(field: str, value: object, kind: type[T]) -> T:
    if not isinstance(value, kind):
        raise FieldError((field,), f"{field} is {_BRIEF.repr(value)}, no {kind.__name__}")
    return value


def _two(field: str, values: object) -> tuple[Any, Any]:
    if not isinstance(values, tuple | list) or len(values) != 2:
        raise FieldError((field,), f"{field} is {_BRIEF.repr(values)}, not a tuple of two")
    return values[0], values[1]


def _read(field: str, value: object, kind: Any) -> Any:
    try:
        return msgspec.convert(_bare(value), kind)
    except msgspec.ValidationError:
        wanted = _WANTED[field.partition(" of ")[0]]
        words = f"{field} is {_BRIEF.repr(value)}, not {wanted}"
        raise FieldError((field,), words) from None


def _bare(value: Any) -> Any:
    """Plain numbers or lists of them, where there are few."""
    if type(value) in (tuple, list):
        few = len(value) <= _MOST_NUMBERS
        return [item if type(item) is float else _plain(item) for item in value] if few else value
    return _plain(value)


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
        if isinstance(x, np.ndarray):
            brief = x.size <= _MOST_NUMBERS and x.dtype.kind in "biufc"
            return repr(x) if brief else f"an array of {x.dtype.name} and shape {x.shape}"
        if type(x) is int and x.bit_length() > _MOST_BITS:
            return f"a whole number of {x.bit_length()} bits"
        if type(x) in (int, str, list, tuple):
            return super().repr1(x, level)
        return repr(x) if isinstance(x, _PLAIN) else f"a {type(x).__name__}"


_BRIEF = _Brief()
