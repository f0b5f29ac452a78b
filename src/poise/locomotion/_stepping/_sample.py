"""`OperatorSample`: one message of an operator, and validation of what devices return."""

import logging
import math
import re
from collections.abc import Sequence
from typing import Annotated, Any, Protocol, runtime_checkable

import msgspec
import numpy as np
from msgspec import Meta, Struct
from msgspec.structs import asdict

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
        height: of the CoM, over the usual one [m].
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

_READ = ("time", "feet", "hands", "head", "body", "velocity", "upright", "rest")
"""Members that controllers read: without buttons and sticks."""

_SIDES = {"feet": ("left foot", "right foot"), "hands": ("left hand", "right hand")}
_VECTORS = {"position": NOWHERE, "orientation": (math.nan,) * 4, "velocity": NOWHERE}
_FLAGS = ("upright", "rest", "clutch")


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
    """Return a sample of floats, with NaN for invalid vectors, and the list of invalid parts."""
    if sample is None:
        return None, None
    if not isinstance(sample, OperatorSample):
        words = f"sample: expected an OperatorSample, got {type(sample).__name__}"
        raise FieldError(("sample",), words)
    members: dict[str, Any] = {name: getattr(sample, name) for name in _READ}
    try:
        for name in _SIDES:
            members[name] = tuple(map(_as_dict, members[name]))
        members["head"], members["body"] = _as_dict(sample.head), _as_dict(sample.body)
        return msgspec.convert(members, OperatorSample), None
    except (TypeError, msgspec.ValidationError):
        return _mended({name: _plain(value) for name, value in members.items()})


def checked_reading(arm: str, reading: object) -> TrackedPose | None:
    """Validate the reading of a foot's arm: position and clutch."""
    if reading is None:
        return None
    try:
        place, clutch = msgspec.convert(_plain(reading), tuple[Vector | None, bool | int])
    except msgspec.ValidationError as error:
        field, words = f"reading of {arm}", str(error).partition(" - at")[0]
        raise FieldError((field,), f"{field}: {words}") from None
    return TrackedPose(NOWHERE if place is None else place, bool(clutch))


def _mended(members: dict[str, Any]) -> tuple[OperatorSample, FieldError | None]:
    """Convert members of plain numbers; vectors of parts that are none become NaN."""
    faults = dict[str, str]()
    while True:
        try:
            good = msgspec.convert(members, OperatorSample)
        except msgspec.ValidationError as error:
            words, _, path = str(error).rpartition(" - at `$.")
            first, *names = re.findall(r"\w+", path)
            holder, part = members, ""
            if first in _SIDES and names:
                side = int(names.pop(0))
                holder, part = members[first][side], _SIDES[first][side]
            elif first in ("head", "body"):
                holder, part = members[first], first
            else:
                names = [first]
            name = names[0] if names else ""
            if name in _FLAGS and isinstance(holder[name], int):
                holder[name] = bool(holder[name])
                continue
            field = f"{name} of {part}" if name and part else name or part or first
            faults[field] = f"{field}: {words}"
            if part == "body" or name not in _VECTORS or not part:
                raise FieldError((field,), faults[field]) from None
            holder[name] = _VECTORS[name]
        else:
            return good, FieldError(tuple(faults), "; ".join(faults.values())) if faults else None


def _as_dict(part: object) -> object:
    return asdict(part) if isinstance(part, Struct) else part


def _plain(value: Any, most: int = 4) -> Any:
    """Lists and numbers of Python in place of NumPy's, in what has no more parts than a field."""
    if isinstance(value, dict):
        return {key: _plain(part) for key, part in value.items()} if len(value) <= most else value
    if isinstance(value, tuple | list):
        return [_plain(part) for part in value] if len(value) <= most else value
    if isinstance(value, Struct):
        return _plain(asdict(value))
    plain = isinstance(value, np.ndarray | np.generic) and value.size <= most
    return value.tolist() if plain and value.dtype.kind in "biuf" else value
