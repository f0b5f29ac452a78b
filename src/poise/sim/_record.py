"""`RunRecord`: the record of one run, the source of its checks, summary and report."""

import json
import struct
from collections.abc import Mapping, Sequence
from itertools import accumulate
from typing import Any, NamedTuple, SupportsBytes

import numpy as np

from poise._show import new_figure
from poise.errors import TargetError, UnknownNameError, import_extra

Value = float | int | np.generic | np.ndarray  # a sample of a signal
Names = tuple[str, ...]  # signals that are sampled together, in the order in which they are given
Event = tuple[float, str | SupportsBytes]  # time [s] and text of a note, or content of a message

_MEASURED = {
    "m, rad": "q",
    "m/s, rad/s": "v velocity_truth velocity_estimate",
    "N m": "torque command_torque",
    "m": "com zmp com_reference zmp_reference target foot_target clearance",
    "N, N m": "wrench",
    "m, -": "base_truth base_estimate",
    "kg, m": "payload_estimate",
    "kg": "held_estimate",
    "rad/s": "command_velocity",
    "us": "tick_us",
    "N": "self_contact",
}
# Units of the signals that a recorder records by itself, by the part of a name before its "/"
UNITS = {name: unit for unit, names in _MEASURED.items() for name in names.split()}
_TIME = struct.Struct("<d")
# Begin of a row: the number of rows of the whole record before it, and its time [s]
_HEAD = np.dtype([("order", "<i8"), ("time", "<f8")])
# Signals whose last numbers are one a joint, before them those of the base
_JOINTWISE = ("q", "v", "torque", "command_torque", "command_velocity")


class Signal(NamedTuple):
    """One quantity over time."""

    name: str
    unit: str  # of its numbers, "" for a pure number or a flag
    dtype: np.dtype[Any]  # kind of number of its samples
    shape: tuple[int, ...]  # of a sample


class Table:
    """Rows of signals that are sampled together, each packed as a log holds it."""

    def __init__(self, signals: tuple[Signal, ...]) -> None:
        self.signals, self.rows = signals, list[bytes]()
        self._row = np.zeros((), [*_HEAD.descr, *(("", s.dtype, s.shape) for s in signals)])
        self._parts = [self._row[name] for name in self._row.dtype.names or ()]
        self._shapes = [part.shape for part in self._parts]
        *begins, _ = accumulate((part.nbytes for part in self._parts[2:]), initial=_HEAD.itemsize)
        self.places = {
            s.name: slice(begin, begin + part.nbytes)
            for s, begin, part in zip(signals, begins, self._parts[2:], strict=True)
        }

    def pack(self, row: tuple[Value, ...]) -> bytes:
        """One row: order, time, and the samples."""
        for part, shape, value in zip(self._parts, self._shapes, row, strict=True):
            if getattr(value, "shape", ()) != shape:
                self._refuse(row)
            part[...] = value
        return self._row.tobytes()

    def check(self, rows: list[bytes]) -> None:
        """Raise a `ValueError` for packed rows of other signals."""
        size = self._row.dtype.itemsize
        if self._row.dtype.hasobject or any(len(row) != size for row in rows):
            raise ValueError("rows that are not of the signals")

    def _refuse(self, row: tuple[Value, ...]) -> None:
        for signal, value in zip(self.signals, row[2:], strict=True):
            if (shape := np.shape(value)) != signal.shape:
                what = f"signal {signal.name!r} changed its shape"
                raise TargetError(what, got=shape, wanted=str(signal.shape))


def time_of(row: bytes) -> float:
    """Time of a packed row [s]."""
    return _TIME.unpack_from(row, 8)[0]


class RunRecord:
    """Columns of signals, notes, and texts about the run; grows while the run goes on.

    Signals that are sampled together share a table, a row an instant; a signal may be in several.
    A note is a text under a topic, kept when it differs from the one before: a mode, a status. A
    message is bytes under a topic. Unknown signals raise an `UnknownNameError`.

    Args:
        metadata: texts about the run: robot, controller, scenario, seed.
        joints: names by which `to_pandas` calls the numbers of `q`, `v` and torques; those of
            `metadata` when none.

    Attributes:
        metadata: those texts, the joints' names among them.
        complete: False for a record read back from a log that broke off.
        keeps: whether samples and events stay in memory.
    """

    def __init__(
        self, metadata: Mapping[str, str] | None = None, *, joints: Sequence[str] = ()
    ) -> None:
        self.metadata = dict(metadata or {})
        if joints:
            self.metadata["joints"] = json.dumps(list(joints))
        self.complete = self.keeps = True
        self._signals: dict[str, Signal] = {}
        self._tables: dict[Names, Table] = {}
        self._count = 0
        self._events: dict[str, list[Event]] = {}
        self._said: dict[str, str] = {}
        self._taken: dict[Table | str, int] = {}  # numbers of rows and events

    @property
    def names(self) -> tuple[str, ...]:
        """The signals, in the order in which they first came."""
        return tuple(self._signals)

    @property
    def topics(self) -> tuple[str, ...]:
        """Topics of the notes."""
        return tuple(topic for topic in self._events if self.notes(topic))

    @property
    def end(self) -> float:
        """Time of the last sample [s], 0 for an empty record."""
        return max((time_of(t.rows[-1]) for t in self._tables.values() if t.rows), default=0.0)

    def __contains__(self, name: str) -> bool:
        return name in self._signals

    def __getitem__(self, name: str) -> np.ndarray:
        """All samples of a signal, time first; a copy."""
        return self.signal(name)[1]

    def times(self, name: str) -> np.ndarray:
        """Times of a signal's samples [s]; a copy."""
        return self.signal(name)[0]

    def signal(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """Times [s] and samples of a signal; copies."""
        signal = self._signal(name)
        packed = [
            row[: _HEAD.itemsize] + row[table.places[name]]
            for table in self._tables.values()
            if name in table.places
            for row in table.rows
        ]
        kinds = [*_HEAD.descr, ("value", signal.dtype, signal.shape)]
        samples = np.frombuffer(b"".join(packed), kinds)
        # In the order taken, of all tables that have it.
        samples = samples[np.argsort(samples["order"], kind="stable")]
        return samples["time"].copy(), samples["value"].copy()

    def unit(self, name: str) -> str:
        """Unit of a signal."""
        return self._signal(name).unit

    def shape(self, name: str) -> tuple[int, ...]:
        """Shape of one sample of a signal."""
        return self._signal(name).shape

    def notes(self, topic: str) -> tuple[tuple[float, str], ...]:
        """Notes of a topic, with their times [s]; nothing where there are none."""
        found = self._events.get(topic, ())
        return tuple((time, text) for time, text in found if isinstance(text, str))

    def messages(self, topic: str) -> tuple[tuple[float, bytes], ...]:
        """Messages of a topic, with their times [s]; nothing where there are none."""
        found = self._events.get(topic, ())
        return tuple((time, bytes(x)) for time, x in found if not isinstance(x, str))

    def __repr__(self) -> str:
        about = ", ".join(self.metadata[k] for k in ("robot", "scenario") if k in self.metadata)
        whole = "" if self.complete else ", broken off"
        return f"RunRecord({about}: {len(self.names)} signals, {self.end:.3f} s{whole})"

    def plot(self, *names: str) -> Any:
        """Signals over time, one above the other.

        Args:
            names: of signals; `com`, `zmp` and every error of a task, where there are, when none.

        Returns:
            A `matplotlib.figure.Figure`, which a notebook shows and `savefig` writes.

        Raises:
            MissingExtraError: matplotlib is not installed.
        """
        names = names or tuple(n for n in self.names if n in ("com", "zmp") or n[:6] == "error/")
        signals = [self._signal(name) for name in names]
        figure = new_figure(8.0, 1.0 + 1.6 * len(signals))
        axes = figure.subplots(len(signals), 1, sharex=True, squeeze=False)[:, 0]
        for ax, signal in zip(axes, signals, strict=True):
            times, values = self.signal(signal.name)
            ax.plot(times, values.reshape(len(values), -1), linewidth=1.0)
            ax.set_ylabel(f"{signal.name}\n[{signal.unit or '-'}]", fontsize=8)
            ax.grid(visible=True, alpha=0.3)
        axes[-1].set_xlabel("time [s]")
        return figure

    def to_pandas(self) -> Any:
        """A `pandas.DataFrame`: one row a time, one column a number, NaN without a sample.

        Such as `com[0]`, and `torque[left_knee]` where the record has the joints; `q` and `v` of
        a floating base begin with its own, `q[0]` to `q[6]` (position, quaternion) and `v[0]` to
        `v[5]`. A column of notes has the last one of its topic.

        Raises:
            MissingExtraError: the package pandas is not installed.
        """
        pd = import_extra("pandas", "tables", "A table of a run")
        columns: dict[str, Any] = {}
        for name, signal in self._signals.items():
            times, values = self.signal(name)
            flat = values.reshape(len(values), -1)
            for k, label in enumerate(self._labels(signal)):
                column = pd.Series(flat[:, k], index=times)
                # Of a time that came twice the last sample counts.
                columns[label] = column[~column.index.duplicated(keep="last")]
        frame = pd.DataFrame(columns).rename_axis("time")
        for topic in self.topics:
            notes = self.notes(topic)
            starts = np.array([time for time, _ in notes])
            place = np.searchsorted(starts, frame.index.to_numpy(), side="right") - 1
            frame[topic] = [notes[i][1] if i >= 0 else "" for i in place]
        return frame

    def _labels(self, signal: Signal) -> list[str]:
        """Column names of the numbers of a sample."""
        parts = [", ".join(map(str, index)) for index in np.ndindex(signal.shape)]
        joints = json.loads(self.metadata.get("joints", "[]"))
        if signal.name in _JOINTWISE and 0 < len(joints) <= len(parts):
            parts[-len(joints) :] = joints
        return [f"{signal.name}[{part}]" for part in parts] if signal.shape else [signal.name]

    def add(
        self, time: float, values: Mapping[str, Value], units: Mapping[str, str] | None = None
    ) -> None:
        """Keep a sample each of some signals.

        Args:
            time: of the samples [s].
            values: the samples by the signal's name, copied; shape and kind of number stay.
            units: of new signals; others have those of a recorder.

        Raises:
            TargetError: a signal changed its shape.
        """
        table = self._tables.get(tuple(values))
        if table is None:
            table = self._new_table(values, units or {})
        table.rows.append(table.pack((self._count, time, *values.values())))
        self._count += 1

    def note(self, time: float, topic: str, text: str) -> bool:
        """Keep a text that differs from the last of its topic; return whether it does."""
        if self._said.get(topic) == text:
            return False
        self._said[topic] = text
        self._rows_of(topic).append((time, text))
        return True

    def message(self, time: float, topic: str, content: SupportsBytes) -> None:
        """Keep a message at a time [s]; no topic has both notes and messages.

        Args:
            time: of the message [s].
            topic: its topic.
            content: bytes, or something constant that becomes bytes when they are needed.
        """
        self._rows_of(topic).append((time, content))

    def take_fresh(self) -> list[tuple[Table | str, list[Any]]]:
        """Rows or events of each table or topic that came since the last call."""
        fresh: list[tuple[Table | str, list[Any]]] = []
        for place in (*self._tables.values(), *self._events):
            rows = self._rows_of(place)
            fresh.append((place, rows[self._taken.get(place, 0) :]))
            if not self.keeps:
                rows.clear()
            self._taken[place] = len(rows)
        return fresh

    def take_in(self, place: Table | str, items: list[Any]) -> None:
        """Append rows or events that were read."""
        if isinstance(place, Table):
            if any(self._signals.setdefault(s.name, s) != s for s in place.signals):
                raise ValueError("a signal of two kinds")
            place.check(items)
            place = self._tables.setdefault(tuple(place.places), place)
        self._rows_of(place).extend(items)

    def _rows_of(self, place: Table | str) -> list[Any]:
        return place.rows if isinstance(place, Table) else self._events.setdefault(place, [])

    def _new_table(self, values: Mapping[str, Value], units: Mapping[str, str]) -> Table:
        for name, value in values.items():
            if name not in self._signals:
                sample = np.asarray(value)
                unit = units.get(name, UNITS.get(name.partition("/")[0], ""))
                self._signals[name] = Signal(name, unit, sample.dtype, sample.shape)
        table = Table(tuple(self._signals[name] for name in values))
        return self._tables.setdefault(tuple(values), table)

    def _signal(self, name: str) -> Signal:
        if name not in self._signals:
            raise UnknownNameError("unknown signal", got=name, choices=self._signals)
        return self._signals[name]
