"""`Recording`: a recorded run, read through a memory map, and as a device."""

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from poise.teleop.device import DeviceSample
from poise.teleop.recording_format import (
    HEADER_BYTES,
    ROW,
    UNFINISHED,
    RecordingError,
    RowKind,
    read_header,
)

_AT_ONCE = 100_000
"""Rows that are checked at a time."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Recording:
    """A recording, opened; its rows stay on the disk.

    Attributes:
        path: the file.
        robot: the robot's name.
        dt: length of a tick [s].
        setup: what else the run needs.
        rows: of `ROW`, memory-mapped.
    """

    path: Path
    robot: str
    dt: float
    setup: dict[str, Any] = field(repr=False)
    rows: np.ndarray = field(repr=False)

    @property
    def duration(self) -> float:
        """Time of the last row [s]."""
        return float(self.rows["tick"][-1] + 1) * self.dt if len(self.rows) else 0.0

    def device(self, *, robot: str, dt: float) -> "RecordedDevice":
        """The recording as a device.

        Args:
            robot: name of the robot that it shall drive.
            dt: length of its ticks [s].

        Raises:
            RecordingError: another robot or another tick.
        """
        if robot != self.robot:
            raise RecordingError(
                f"the recording {self.path.name} is from another robot",
                got=self.robot,
                wanted=robot,
            )
        if dt != self.dt:
            raise RecordingError(
                f"the recording {self.path.name} has another length of a tick",
                got=f"{self.dt} s",
                wanted=f"{dt} s",
            )
        return RecordedDevice(self)


class RecordedDevice:
    """Gives the samples of a recording at the ticks at which they came.

    Gaps stay gaps, and what was refused then is refused now: the guard decides again.

    Args:
        recording: where they are.
    """

    def __init__(self, recording: Recording) -> None:
        self._rows, self._dt, self._next = recording.rows, recording.dt, 0
        self.pushes: list[tuple[Float64[np.ndarray, "3"], float]] = []
        """Pushes that came with the last sample: force [N] and duration [s]."""

    def sample(self, time: float) -> DeviceSample | None:
        """What came before the tick at a time [s]; ticks are asked for in order."""
        tick, found = round(time / self._dt), None
        self.pushes = []
        while self._next < len(self._rows) and self._rows[self._next]["tick"] <= tick:
            row = self._rows[self._next]
            self._next += 1
            left, right = row["left"].astype(np.float64), row["right"].astype(np.float64)
            if row["kind"] == RowKind.PUSH:
                self.pushes.append((left, float(right[0])))
            else:
                found = DeviceSample(float(row["time"]), left, right, bool(row["upright"]))
        return found


def read_recording(path: Path, *, allow_partial: bool = False) -> Recording:
    """Opens a recording.

    Args:
        path: the file.
        allow_partial: whether a file that was not finished counts, up to its last whole row.

    Raises:
        RecordingError: no recording, another version, truncated, or ticks that go backwards.
    """
    header = read_header(path)
    size = os.path.getsize(path) - HEADER_BYTES
    whole, rest = divmod(size, ROW.itemsize)
    if (rest or whole != header["rows"]) and not allow_partial:
        promised = "unfinished" if header["rows"] == UNFINISHED else f"{header['rows']} rows"
        raise RecordingError(
            f"the recording {path.name} is truncated or was not finished",
            got=f"{whole} rows and {rest} bytes",
            wanted=f"{promised}; what there is can be read with allow_partial=True",
        )
    rows = (
        np.memmap(path, dtype=ROW, mode="r", offset=HEADER_BYTES, shape=(whole,))
        if whole
        else np.zeros(0, dtype=ROW)
    )
    _check_rows(path, rows)
    return Recording(
        path=path, robot=header["robot"], dt=header["dt"], setup=header["setup"], rows=rows
    )


def _check_rows(path: Path, rows: np.ndarray) -> None:
    last = 0
    for begin in range(0, len(rows), _AT_ONCE):
        part = rows[begin : begin + _AT_ONCE]
        ticks = part["tick"]
        steps = np.diff(ticks, prepend=last)
        bad = np.flatnonzero((steps < 0) | (part["kind"] > RowKind.PUSH))
        if len(bad):
            index = int(bad[0])
            raise RecordingError(
                f"row {begin + index} of the recording {path.name} cannot be: its tick goes "
                "backwards, or it is of no known kind",
                got=f"tick {int(ticks[index])}, kind {int(part['kind'][index])}",
            )
        last = ticks[-1]
