"""`RunRecord`: what is known of one run, from which everything about it is made."""

import json
from collections.abc import Mapping
from importlib import import_module
from typing import Any

import numpy as np

from poise.errors import MissingExtraError, TargetError, UnknownNameError

Value = float | int | np.generic | np.ndarray
"""A sample of a signal: a number, or an array of numbers."""

Counts = dict[str, int]
"""How many samples of each signal, and notes of each topic, are elsewhere already."""

_FIRST_CAPACITY = 1024

UNITS = {
    "q": "m, rad",
    "v": "m/s, rad/s",
    "torque": "N m",
    "com": "m",
    "zmp": "m",
    "wrench": "N, N m",
    "command_torque": "N m",
    "command_velocity": "rad/s",
    "residuals": "",
    "com_reference": "m",
    "zmp_reference": "m",
    "target": "m",
    "foot_target": "m",
    "planned": "",
    "tick_us": "us",
    "clearance": "m",
    "touched": "",
}
"""Units of the signals that a recorder records by itself, by the part of a name before its "/"."""


class Signal:
    """Samples of one quantity over time, in an array that doubles when full.

    Args:
        name: the signal's name.
        unit: of its numbers, "" for a pure number or a flag.
        first: its first sample, whose shape and kind of number the others have as well.
    """

    def __init__(self, name: str, unit: str, first: Value) -> None:
        self.name, self.unit = name, unit
        sample = np.asarray(first)
        self.shape, self.dtype = sample.shape, sample.dtype
        self._times = np.empty(_FIRST_CAPACITY)
        self._values = np.empty((_FIRST_CAPACITY, *self.shape), dtype=self.dtype)
        self._size = 0

    def __len__(self) -> int:
        return self._size

    def append(self, time: float, value: Value) -> None:
        """Keeps one sample, copied.

        Raises:
            TargetError: the sample has another shape than the first one had.
        """
        if np.shape(value) != self.shape:
            raise TargetError(
                f"signal {self.name!r} changed its shape",
                got=np.shape(value),
                wanted=str(self.shape),
            )
        if self._size == len(self._times):
            self._times = np.concatenate([self._times, np.empty_like(self._times)])
            self._values = np.concatenate([self._values, np.empty_like(self._values)])
        self._times[self._size] = time
        self._values[self._size] = value
        self._size += 1

    def extend(self, times: np.ndarray, values: np.ndarray) -> None:
        """Keeps further samples, copied."""
        end = self._size + len(times)
        self._times = np.concatenate([self._times[: self._size], times])
        self._values = np.concatenate([self._values[: self._size], values])
        self._size = end

    def clear(self) -> None:
        """Drops all samples; what `since` gave stays."""
        self._times, self._values = np.empty_like(self._times), np.empty_like(self._values)
        self._size = 0

    def since(self, first: int) -> tuple[np.ndarray, np.ndarray]:
        """Times and samples from an index on, as views that later samples leave alone."""
        rows = slice(first, self._size)
        return self._times[rows], self._values[rows]


class RunRecord:
    """Columns of signals, notes, and texts about the run; grows while the run goes on.

    Every signal has times of its own, for not every tick has something to say about everything. A
    note is a text under a topic, kept when it differs from the one before: a mode, a status.

    Args:
        metadata: texts that say what the record is of: robot, controller, scenario, seed.

    Attributes:
        metadata: those texts.
        complete: whether the run came to its end; False for one read back from a log that broke
            off.
    """

    def __init__(self, metadata: Mapping[str, str] | None = None) -> None:
        self.metadata = dict(metadata or {})
        self.complete = True
        self._signals: dict[str, Signal] = {}
        self._notes: dict[str, list[tuple[float, str]]] = {}

    # What is in it -------------------------------------------------------------------------------

    @property
    def names(self) -> tuple[str, ...]:
        """The signals, in the order in which they first came."""
        return tuple(self._signals)

    @property
    def topics(self) -> tuple[str, ...]:
        """What there are notes about."""
        return tuple(self._notes)

    @property
    def end(self) -> float:
        """Time of the last sample [s], 0 for an empty record."""
        ends = (s.since(0)[0][-1] for s in self._signals.values() if len(s))
        return float(max(ends, default=0.0))

    def __contains__(self, name: str) -> bool:
        return name in self._signals

    def __getitem__(self, name: str) -> np.ndarray:
        """All samples of a signal, time first; the caller's own copy.

        Raises:
            UnknownNameError: no such signal.
        """
        return self._signal(name).since(0)[1].copy()

    def times(self, name: str) -> np.ndarray:
        """Times of a signal's samples [s]; the caller's own copy.

        Raises:
            UnknownNameError: no such signal.
        """
        return self._signal(name).since(0)[0].copy()

    def signal(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Times [s] and samples of a signal; the caller's own copies.

        Raises:
            UnknownNameError: no such signal.
        """
        return self.times(name), self[name]

    def unit(self, name: str) -> str:
        """Unit of a signal.

        Raises:
            UnknownNameError: no such signal.
        """
        return self._signal(name).unit

    def shape(self, name: str) -> tuple[int, ...]:
        """Shape of one sample of a signal.

        Raises:
            UnknownNameError: no such signal.
        """
        return self._signal(name).shape

    def notes(self, topic: str) -> tuple[tuple[float, str], ...]:
        """What was noted about a topic, with its times [s]; nothing where it never came up."""
        return tuple(self._notes.get(topic, ()))

    def to_pandas(self) -> Any:
        """A `pandas.DataFrame`: one row a time, one column a number, such as `com[0]`.

        Topics of notes are columns as well. Numbers that a time has no sample of are NaN; a note
        holds until the next of its topic.

        Raises:
            MissingExtraError: the package pandas is not installed.
        """
        try:
            pd: Any = import_module("pandas")
        except ModuleNotFoundError as error:
            raise MissingExtraError("pandas", "tables", "A table of a run") from error
        columns: dict[str, Any] = {}
        for name, signal in self._signals.items():
            times, values = signal.since(0)
            flat = values.reshape(len(values), -1)
            for k, index in enumerate(np.ndindex(signal.shape)):
                label = name + (f"[{', '.join(map(str, index))}]" if index else "")
                columns[label] = pd.Series(flat[:, k], index=times)
        frame = pd.DataFrame(columns).rename_axis("time")
        for topic, notes in self._notes.items():
            starts = np.array([time for time, _ in notes])
            place = np.searchsorted(starts, frame.index.to_numpy(), side="right") - 1
            frame[topic] = [notes[i][1] if i >= 0 else "" for i in place]
        return frame

    # Filling it ----------------------------------------------------------------------------------

    def add(self, time: float, name: str, value: Value, unit: str | None = None) -> None:
        """Keeps a sample of a signal.

        Args:
            time: of the sample [s].
            name: the signal's name.
            value: the sample, copied; its shape and kind of number stay what they are at first.
            unit: read once, when the signal is new; that of `UNITS` when None.

        Raises:
            TargetError: the signal changed its shape.
        """
        signal = self._signals.get(name)
        if signal is None:
            unit = UNITS.get(name.partition("/")[0], "") if unit is None else unit
            signal = self._signals[name] = Signal(name, unit, value)
        signal.append(time, value)

    def note(self, time: float, topic: str, text: str) -> bool:
        """Notes a text; whether it differs from the last of its topic, else nothing is kept."""
        notes = self._notes.setdefault(topic, [])
        if notes and notes[-1][1] == text:
            return False
        notes.append((time, text))
        return True

    def forget(self) -> None:
        """Drops all samples and notes but the last of each topic; signals stay what they are."""
        for signal in self._signals.values():
            signal.clear()
        self._notes = {topic: found[-1:] for topic, found in self._notes.items()}

    # Blocks: a part of it as bytes, for a log ----------------------------------------------------

    def counts(self) -> Counts:
        """How much there is of everything."""
        sizes = {name: len(signal) for name, signal in self._signals.items()}
        return sizes | {f"note {topic}": len(notes) for topic, notes in self._notes.items()}

    def block(self, since: Counts) -> "RecordPart":
        """What came after an earlier `counts`; later samples leave it alone."""
        signals = {
            name: (signal, *signal.since(since.get(name, 0)))
            for name, signal in self._signals.items()
        }
        notes = {
            topic: found[since.get(f"note {topic}", 0) :] for topic, found in self._notes.items()
        }
        return RecordPart(signals, notes)

    def take_in(self, block: bytes) -> None:
        """Adds what `RecordPart.pack` made bytes of."""
        length = int.from_bytes(block[:4], "little")
        header = json.loads(block[4 : 4 + length])
        data = memoryview(block)[4 + length :]
        times: list[np.ndarray] = [
            np.frombuffer(data, np.float64, count, offset) for count, offset in header["times"]
        ]
        for name, unit, dtype, shape, at, offset in header["signals"]:
            stamps = times[at]
            count = len(stamps) * int(np.prod(shape, dtype=np.int64))
            values = np.frombuffer(data, dtype, count, offset).reshape(len(stamps), *shape)
            if name not in self._signals:
                self._signals[name] = Signal(name, unit, values[0])
            self._signals[name].extend(stamps, values)
        for topic, notes in header["notes"].items():
            self._notes.setdefault(topic, []).extend((time, text) for time, text in notes)

    def _signal(self, name: str) -> Signal:
        if name not in self._signals:
            raise UnknownNameError("unknown signal", got=name, choices=self._signals)
        return self._signals[name]


class RecordPart:
    """A part of a record: its samples and notes from one moment to another.

    Args:
        signals: with the times and values of the samples.
        notes: by topic.
    """

    def __init__(
        self,
        signals: Mapping[str, tuple[Signal, np.ndarray, np.ndarray]],
        notes: Mapping[str, list[tuple[float, str]]],
    ) -> None:
        self._signals = {name: found for name, found in signals.items() if len(found[1])}
        self._notes = {topic: found for topic, found in notes.items() if found}

    def __bool__(self) -> bool:
        return bool(self._signals or self._notes)

    def pack(self) -> bytes:
        """The length of a header (four bytes, little-endian), the header in JSON, the numbers.

        The numbers are raw, as they are in memory, so nothing is lost: neither a bit nor NaN nor
        the kind of number. Signals that were sampled at the same times share them.
        """
        parts: list[bytes] = []
        size = 0

        def put(array: np.ndarray) -> int:
            nonlocal size
            start = size
            parts.append(np.ascontiguousarray(array).tobytes())
            # Aligned, so that what reads it need not copy.
            parts[-1] += bytes(-len(parts[-1]) % 8)
            size += len(parts[-1])
            return start

        times: list[tuple[int, int]] = []
        known: dict[bytes, int] = {}
        signals: list[tuple[str, str, str, tuple[int, ...], int, int]] = []
        for name, (signal, stamps, values) in self._signals.items():
            key = stamps.tobytes()
            if key not in known:
                known[key] = len(times)
                times.append((len(stamps), put(stamps)))
            place = put(values)
            signals.append((name, signal.unit, signal.dtype.str, signal.shape, known[key], place))
        header = json.dumps({"times": times, "signals": signals, "notes": self._notes}).encode()
        return b"".join((len(header).to_bytes(4, "little"), header, *parts))
