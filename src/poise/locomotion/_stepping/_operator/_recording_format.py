"""The file of a recording: a header of one line of JSON, and rows of numbers.

The header is padded with spaces to `HEADER_BYTES` and a new line, and behind it are rows of `ROW`,
little-endian, without gaps. It is written while the run goes on and read through a memory map, so
its length does not matter.
"""

import json
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from msgspec.structs import replace

from poise._schema import Bounds, Duration, Text, checked, read
from poise.errors import ConfigurationError, PoiseError
from poise.locomotion._stepping._operator._sample import OperatorSample, TrackedPose

FORMAT, VERSION = "poise teleoperation", 1
HEADER_BYTES = 16384
"""Length of the header with its new line: room for a world of some fifty blocks."""

UNFINISHED = -1
"""Number of rows in the header of a file that was not closed."""


class RowKind(IntEnum):
    """What a row holds."""

    SAMPLE = 0
    """What the device sent: time, left, right, upright."""
    PUSH = 1
    """A push on the torso: left is the force [N], right[0] how long [s]."""
    HANDS = 2
    """What the sample of the row before says of the hands: left, right; flags are `HandFlags`."""
    BODY = 3
    """What it says of the body: left is height [m] and turns [rad], right the torso [rad]."""
    VELOCITY = 4
    """With which velocity it has the robot walk: left is ahead, left [m/s], and turn [rad/s]."""
    TURN = 5
    """How it says that a device is turned, (x, y, z, w): left, right[0]; flags are `TurnFlags`."""
    RATES = 6
    """How fast it says that the feet's devices move, left and right [m/s]; NaN for one that does
    not say, and with any flag set the hands'."""


class HandFlags(IntFlag):
    """What a row says of hands beside where their devices are."""

    LEFT = 1
    """There is a left one."""
    RIGHT = 2
    """There is a right one."""
    LEFT_CLUTCH = 4
    """The left one's clutch is closed."""
    RIGHT_CLUTCH = 8
    """The right one's clutch is closed."""
    REST = 16
    """Hands that are not held shall go to rest."""


class TurnFlags(IntFlag):
    """Whose orientation a row has."""

    LEFT = 1
    """The left hand's."""
    RIGHT = 2
    """The right hand's."""
    HEAD = 4
    """The head's."""
    CLUTCH = 8
    """The head's clutch is closed."""


ROW = np.dtype(
    [
        ("tick", "<i8"),
        ("kind", "<u1"),
        ("flags", "<u1"),
        ("time", "<f8"),
        ("left", "<f8", (3,)),
        ("right", "<f8", (3,)),
    ]
)
"""A row: the tick before which it came, counted from zero, and what came. The flags of a sample
say whether the torso shall be upright."""


class RecordingError(PoiseError):
    """A recording that cannot be read or does not belong to this robot."""


def header_text(header: dict[str, Any]) -> bytes:
    """A header as it stands in the file.

    Args:
        header: as JSON.

    Raises:
        ConfigurationError: it is too long or no JSON.
    """
    try:
        text = json.dumps(header, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise ConfigurationError(f"the set-up of a recording is no JSON: {error}") from None
    encoded = text.encode()
    if len(encoded) >= HEADER_BYTES:
        raise ConfigurationError(
            "the set-up of a recording is too long",
            got=f"{len(encoded)} bytes",
            wanted=f"less than {HEADER_BYTES}",
        )
    return encoded.ljust(HEADER_BYTES - 1) + b"\n"


@checked(RecordingError)
@dataclass(frozen=True, kw_only=True)
class Header:
    """The first line of a recording.

    Attributes:
        format: what kind of file it is.
        version: of the format.
        robot: the robot's name.
        dt: length of a tick [s].
        rows: how many there are; `UNFINISHED` for a file that was not closed.
        setup: what else the run needs.
    """

    format: Text = FORMAT
    version: int = VERSION
    robot: Text
    dt: Duration
    rows: Annotated[int, Bounds(least=float(UNFINISHED), most=1e15, whole=True)]
    setup: dict[str, Any]


def read_header(path: str | Path) -> Header:
    """The header of a file, checked.

    Args:
        path: the file.

    Raises:
        RecordingError: no recording, another version, or a header that is broken.
    """
    path = Path(path)
    try:
        with path.open("rb") as file:
            head = file.read(HEADER_BYTES)
    except OSError as error:
        raise RecordingError(f"the recording {path} cannot be read: {error.strerror}") from None
    wanted = f"a file that a {FORMAT} run has left"
    try:
        header = json.loads(head)
    except (ValueError, RecursionError):
        raise RecordingError(f"{path.name} is no recording", wanted=wanted) from None
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise RecordingError(f"{path.name} is no recording", wanted=wanted)
    if header.get("version") != VERSION:
        raise RecordingError(
            f"the recording {path.name} is of another version",
            got=header.get("version"),
            wanted=str(VERSION),
        )
    return read(Header, header, f"the header of {path.name}", error=RecordingError)


def as_point(value: object) -> np.ndarray:
    point = np.asarray(value, dtype=np.float64) if isinstance(value, tuple | np.ndarray) else None
    return np.full(3, np.nan) if point is None or point.shape != (3,) else point


def turns_of(sample: OperatorSample) -> list[tuple[TurnFlags, np.ndarray]]:
    """Orientations that a sample has, and whose they are."""
    found: list[tuple[TurnFlags, np.ndarray]] = []
    for hand, flag in zip(sample.hands, (TurnFlags.LEFT, TurnFlags.RIGHT), strict=True):
        if hand is not None and hand.orientation is not None:
            found.append((flag, np.array(hand.orientation)))
    head = sample.head
    if head is not None and head.orientation is not None:
        flag = TurnFlags.HEAD | TurnFlags.CLUTCH if head.clutch else TurnFlags.HEAD
        found.append((flag, np.array(head.orientation)))
    return found


def with_turn(sample: OperatorSample, row: np.void) -> OperatorSample:
    """A sample with the orientation that a row has."""
    flags = TurnFlags(int(row["flags"]))
    x, y, z = row["left"].tolist()
    turned = (x, y, z, float(row["right"][0]))
    if flags & TurnFlags.HEAD:
        return replace(sample, head=TrackedPose(None, bool(flags & TurnFlags.CLUTCH), turned))
    left, right = sample.hands
    if flags & TurnFlags.LEFT and left is not None:
        left = replace(left, orientation=turned)
    if flags & TurnFlags.RIGHT and right is not None:
        right = replace(right, orientation=turned)
    return replace(sample, hands=(left, right))


def with_rates(sample: OperatorSample, row: np.void) -> OperatorSample:
    """A sample with the velocities that a row has."""
    name = "hands" if row["flags"] else "feet"
    parts = [
        part and replace(part, velocity=None if np.isnan(rate).all() else tuple(rate.tolist()))
        for part, rate in zip(getattr(sample, name), (row["left"], row["right"]), strict=True)
    ]
    return replace(sample, **{name: tuple(parts)})


def hand_flags(sample: OperatorSample) -> HandFlags:
    flags = HandFlags.REST if sample.rest else HandFlags(0)
    present = (HandFlags.LEFT, HandFlags.RIGHT)
    closed = (HandFlags.LEFT_CLUTCH, HandFlags.RIGHT_CLUTCH)
    for hand, here, clutch in zip(sample.hands, present, closed, strict=True):
        if hand is not None:
            flags |= here | clutch if hand.clutch else here
    return flags


def with_hands(sample: OperatorSample, row: np.void) -> OperatorSample:
    """A sample with what a row says of the hands."""
    flags = HandFlags(int(row["flags"]))

    def hand(side: str, here: HandFlags, clutch: HandFlags) -> TrackedPose | None:
        x, y, z = row[side].tolist()
        return TrackedPose((x, y, z), bool(flags & clutch)) if flags & here else None

    left = hand("left", HandFlags.LEFT, HandFlags.LEFT_CLUTCH)
    right = hand("right", HandFlags.RIGHT, HandFlags.RIGHT_CLUTCH)
    return replace(sample, hands=(left, right), rest=bool(flags & HandFlags.REST))
