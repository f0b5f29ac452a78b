"""`convert_recording`: a log of a `.teleop` file, as earlier versions wrote recordings."""

import json
from collections.abc import Generator
from enum import IntEnum
from pathlib import Path
from typing import Any

import numpy as np
from msgspec.structs import replace

from poise.apps.teleoperation._recording import RecordedPush, RecordingError, write_recording
from poise.locomotion import BodyCommand, OperatorSample, TrackedPose

_FORMAT = {"format": "poise teleoperation", "version": 1}
_HEADER_BYTES = 16384  # one line of JSON, padded; behind it are rows, little-endian
_ROW = np.dtype(
    [("tick", "<i8"), ("kind", "<u1"), ("flags", "<u1"), ("time", "<f8"), ("numbers", "<f8", (6,))]
)


class _Kind(IntEnum):
    """Kinds of row; those from `HANDS` on extend the sample before."""

    SAMPLE, PUSH, HANDS, BODY, VELOCITY, TURN, RATES = range(7)


_LEFT, _RIGHT, _LEFT_CLUTCH, _RIGHT_CLUTCH, _REST = 1, 2, 4, 8, 16  # flags of hands
_HEAD, _HEAD_CLUTCH = 4, 8  # flags of a turn that is the head's, beside those of hands


def convert_recording(path: Path, target: Path) -> bool:
    """Convert a `.teleop` file to a log with the same samples."""
    try:
        content = path.read_bytes()
        header = json.loads(content[:_HEADER_BYTES])
        found = {key: header[key] for key in _FORMAT}
        robot, dt, promised, setup = (header[key] for key in ("robot", "dt", "rows", "setup"))
        dt, setup = float(dt), dict(setup)
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror}") from None
    except (ValueError, KeyError, TypeError, RecursionError):
        raise RecordingError(f"{path.name} is no .teleop file") from None
    if found != _FORMAT:
        raise RecordingError(f"{path.name} is no .teleop file", got=found, wanted=str(_FORMAT))
    count = max(len(content) - _HEADER_BYTES, 0) // _ROW.itemsize
    rows = np.frombuffer(content, _ROW, count, _HEADER_BYTES) if count else np.empty(0, _ROW)
    if np.any(np.diff(rows["tick"], prepend=0) < 0) or np.any(rows["kind"] > _Kind.RATES):
        raise RecordingError(f"{path.name} has rows whose ticks go backwards, or of no known kind")
    finished = promised == count
    pushes = list[RecordedPush]()
    for row in rows[rows["kind"] == _Kind.PUSH]:
        *force, seconds = row["numbers"][:4].tolist()
        pushes.append(RecordedPush(int(row["tick"]), tuple(force), seconds))
    duration = setup.pop("duration", None)
    write_recording(
        target,
        _samples(rows),
        robot=str(robot),
        dt=dt,
        settings=setup,
        pushes=pushes,
        duration=duration if finished else None,
    )
    return finished


def _samples(rows: np.ndarray) -> Generator[tuple[int, OperatorSample]]:
    tick, sample = 0, None
    for row in rows[rows["kind"] != _Kind.PUSH]:
        if row["kind"] == _Kind.SAMPLE:
            if sample is not None:
                yield tick, sample
            left, right = (TrackedPose.of(place) for place in row["numbers"].reshape(2, 3))
            tick, upright = int(row["tick"]), bool(row["flags"])
            sample = OperatorSample(float(row["time"]), (left, right), upright=upright)
        elif sample is not None:
            sample = replace(sample, **_more(sample, row))
    if sample is not None:
        yield tick, sample


def _more(sample: OperatorSample, row: np.void) -> dict[str, Any]:
    """Fields of a sample that a row behind it has."""
    flags, numbers = int(row["flags"]), row["numbers"].copy()
    first, second = numbers[:3], numbers[3:]
    match int(row["kind"]):
        case _Kind.HANDS:
            clutches = bool(flags & _LEFT_CLUTCH), bool(flags & _RIGHT_CLUTCH)
            left = TrackedPose.of(first, clutches[0]) if flags & _LEFT else None
            right = TrackedPose.of(second, clutches[1]) if flags & _RIGHT else None
            return {"hands": (left, right), "rest": bool(flags & _REST)}
        case _Kind.BODY:
            height, *turns = first.tolist()
            return {"body": BodyCommand(height, tuple(second.tolist()), tuple(turns))}
        case _Kind.VELOCITY:
            return {"velocity": tuple(first.tolist())}
        case _Kind.TURN:
            turned = tuple(numbers[:4].tolist())
            if flags & _HEAD:
                return {"head": TrackedPose(None, bool(flags & _HEAD_CLUTCH), turned)}
            pairs = zip(sample.hands, (_LEFT, _RIGHT), strict=True)
            turns = [(hand, turned if flags & side else None) for hand, side in pairs]
            return {"hands": tuple(h and replace(h, orientation=t) if t else h for h, t in turns)}
        case _:
            # Of feet, and with any flag of hands.
            key, parts = ("hands", sample.hands) if flags else ("feet", sample.feet)
            rates = (None if np.isnan(r).all() else tuple(r.tolist()) for r in (first, second))
            pairs = zip(parts, rates, strict=True)
            return {key: tuple(p if p is None else replace(p, velocity=r) for p, r in pairs)}
