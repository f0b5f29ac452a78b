"""`Recording`: a recorded run, read through a memory map, and as a device.

`RecordingWriter`: keeps everything that comes from outside a run, a row an event.
"""

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float64
from msgspec.structs import replace

from poise.locomotion._stepping._operator._recording_format import (
    FORMAT,
    HEADER_BYTES,
    ROW,
    UNFINISHED,
    VERSION,
    RecordingError,
    RowKind,
    as_point,
    hand_flags,
    header_text,
    read_header,
    turns_of,
    with_hands,
    with_rates,
    with_turn,
)
from poise.locomotion._stepping._operator._sample import BodyCommand, OperatorSample, TrackedPose


class RecordingWriter:
    """Writes a recording while the run goes on; a context manager.

    Args:
        path: the file, replaced if it is there; by convention `*.teleop`.
        robot: the robot's name.
        dt: length of a tick [s].
        setup: whatever else the run needs to be run again, as JSON: see `run_teleop`.

    Raises:
        ConfigurationError: the set-up is too long or no JSON.

    Attributes:
        setup: what the header will hold; what is known at the end only can be put in before
            `close`.
    """

    def __init__(
        self, path: str | Path, *, robot: str, dt: float, setup: dict[str, Any] | None = None
    ) -> None:
        self.setup: dict[str, Any] = dict(setup or {})
        self._header: dict[str, Any] = {
            "format": FORMAT,
            "version": VERSION,
            "robot": robot,
            "dt": float(dt),
            "rows": UNFINISHED,
            "setup": self.setup,
        }
        text = header_text(self._header)
        path = Path(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file = path.open("wb")
        self._file.write(text)
        self._rows = 0

    def sample(self, tick: int, sample: OperatorSample | None) -> None:
        """Notes a sample that came before a tick, good or bad; nothing where none came."""
        if sample is None:
            return
        flags = int(sample.upright)
        self._write(tick, RowKind.SAMPLE, sample.time, sample.place(0), sample.place(1), flags)
        flags = int(hand_flags(sample))
        if flags:
            left, right = (np.full(3, np.nan) if h is None else h.position for h in sample.hands)
            self._write(tick, RowKind.HANDS, sample.time, left, right, flags)
        body = sample.body
        if body != BodyCommand():
            left, right = np.array([body.height, *body.turns]), np.array(body.torso)
            self._write(tick, RowKind.BODY, sample.time, left, right)
        if any(sample.velocity):
            velocity = np.array(sample.velocity)
            self._write(tick, RowKind.VELOCITY, sample.time, velocity, np.zeros(3))
        for flags, turned in turns_of(sample):
            last = np.array([turned[3], 0.0, 0.0])
            self._write(tick, RowKind.TURN, sample.time, turned[:3], last, int(flags))
        rates = (tuple(p and p.velocity for p in pair) for pair in (sample.feet, sample.hands))
        for flag, (left, right) in enumerate(rates):
            if not (left is None and right is None):
                self._write(tick, RowKind.RATES, sample.time, left, right, flag)

    @property
    def rows(self) -> int:
        """How many there are so far."""
        return self._rows

    def push(self, tick: int, force: Float64[np.ndarray, "3"], duration: float) -> None:
        """Notes a push on the torso that began before a tick.

        Args:
            tick: counted from zero.
            force: in the world [N].
            duration: [s].
        """
        self._write(tick, RowKind.PUSH, 0.0, force, np.array([duration, 0.0, 0.0]))

    def copy(self, rows: np.ndarray) -> None:
        """Writes rows of another recording as they are.

        Args:
            rows: of `ROW`.
        """
        self._file.write(rows.tobytes())
        self._rows += len(rows)

    def flush(self) -> None:
        """Hands every row to the operating system: a run that is killed later loses none."""
        self._file.flush()

    def close(self) -> None:
        """Writes how many rows there are; without it the file counts as truncated."""
        if self._file.closed:
            return
        self._header["rows"] = self._rows
        self._file.seek(0)
        self._file.write(header_text(self._header))
        self._file.close()

    def __enter__(self) -> "RecordingWriter":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _write(
        self,
        tick: int,
        kind: RowKind,
        time: float,
        left: object,
        right: object,
        flags: int = 0,
    ) -> None:
        row = np.zeros(1, dtype=ROW)
        row["tick"], row["kind"], row["flags"], row["time"] = tick, kind, flags, time
        # A device may send anything: what is no point is kept as one that is refused again.
        row["left"], row["right"] = as_point(left), as_point(right)
        self._file.write(row.tobytes())
        self._rows += 1


_AT_ONCE = 100_000
"""Rows that are checked at a time."""


class RecordedPush(NamedTuple):
    """A push that a recorded robot was given.

    Attributes:
        tick: at whose beginning.
        force: in the world [N].
        duration: how long [s].
    """

    tick: int
    force: tuple[float, float, float]
    duration: float


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

    @property
    def pushes(self) -> list["RecordedPush"]:
        """Pushes on the torso, in order of time."""
        return [
            RecordedPush(int(row["tick"]), tuple(row["left"].tolist()), float(row["right"][0]))
            for row in self.rows[self.rows["kind"] == RowKind.PUSH]
        ]

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
    """Gives the samples of a recording at the ticks at which they came, asked once a tick.

    Gaps stay gaps, and what was refused then is refused now: the guard decides again.

    Args:
        recording: where they are.

    Attributes:
        recording: where they are.
    """

    def __init__(self, recording: Recording) -> None:
        self.recording = recording
        self._rows, self._next, self._tick = recording.rows, 0, 0

    def sample(self, time: float) -> OperatorSample | None:
        """What came before the next tick.

        Ticks are counted: where sensors are late a robot's time at a tick is not the recorded one.

        Args:
            time: of the robot, of no matter here [s].
        """
        del time
        tick, found = self._tick, None
        self._tick += 1
        while self._next < len(self._rows) and self._rows[self._next]["tick"] <= tick:
            row = self._rows[self._next]
            self._next += 1
            if row["kind"] == RowKind.SAMPLE:
                left, right = row["left"].astype(np.float64), row["right"].astype(np.float64)
                feet = (TrackedPose(left.tolist()), TrackedPose(right.tolist()))
                found = OperatorSample(float(row["time"]), feet, upright=bool(row["flags"]))
            elif row["kind"] == RowKind.HANDS and found is not None:
                found = with_hands(found, row)
            elif row["kind"] == RowKind.BODY and found is not None:
                height, left_turn, right_turn = row["left"].tolist()
                roll, pitch, yaw = row["right"].tolist()
                body = BodyCommand(height, (roll, pitch, yaw), (left_turn, right_turn))
                found = replace(found, body=body)
            elif row["kind"] == RowKind.VELOCITY and found is not None:
                ahead, left, turn = row["left"].tolist()
                found = replace(found, velocity=(ahead, left, turn))
            elif row["kind"] == RowKind.TURN and found is not None:
                found = with_turn(found, row)
            elif row["kind"] == RowKind.RATES and found is not None:
                found = with_rates(found, row)
        return found


def read_recording(path: str | Path, *, allow_partial: bool = False) -> Recording:
    """Opens a recording.

    Args:
        path: the file.
        allow_partial: whether a file that was not finished counts, up to its last whole row.

    Raises:
        RecordingError: no recording, another version, truncated, or ticks that go backwards.
    """
    path = Path(path)
    header = read_header(path)
    size = os.path.getsize(path) - HEADER_BYTES
    if size < 0:
        raise RecordingError(
            f"the recording {path.name} is truncated",
            got=f"{size + HEADER_BYTES} bytes",
            wanted=f"{HEADER_BYTES} bytes of a header, and rows",
        )
    whole, rest = divmod(size, ROW.itemsize)
    if (rest or whole != header.rows) and not allow_partial:
        promised = "unfinished" if header.rows == UNFINISHED else f"{header.rows} rows"
        raise RecordingError(
            f"the recording {path.name} is truncated or was not finished",
            got=f"{whole} rows and {rest} bytes",
            wanted=f"{promised}; read_recording(path, allow_partial=True) has what there is",
        )
    rows = (
        np.memmap(path, dtype=ROW, mode="r", offset=HEADER_BYTES, shape=(whole,))
        if whole
        else np.zeros(0, dtype=ROW)
    )
    _check_rows(path, rows)
    recording = Recording(
        path=path, robot=header.robot, dt=header.dt, setup=dict(header.setup), rows=rows
    )
    if header.rows == UNFINISHED and "duration" in recording.setup:
        # Nobody knew yet how long the run would be.
        recording.setup["duration"] = recording.duration
    return recording


def _check_rows(path: Path, rows: np.ndarray) -> None:
    last = 0
    for begin in range(0, len(rows), _AT_ONCE):
        part = rows[begin : begin + _AT_ONCE]
        ticks = part["tick"]
        steps = np.diff(ticks, prepend=last)
        bad = np.flatnonzero((steps < 0) | (part["kind"] > max(RowKind)))
        if len(bad):
            index = int(bad[0])
            raise RecordingError(
                f"row {begin + index} of the recording {path.name} cannot be: its tick goes "
                "backwards, or it is of no known kind",
                got=f"tick {int(ticks[index])}, kind {int(part['kind'][index])}",
            )
        last = ticks[-1]
