"""Reading a log back, also one whose run died while writing it.

Signals kept in memory while a run goes on.
An MCAP log, written by a thread of its own so that the control loop never waits for a disk.
"""

import json
import queue
import struct
import threading
import time
from collections import defaultdict
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np
from jaxtyping import Float64

from poise.errors import MissingExtraError, PoiseError, TargetError, UnknownNameError

_FIRST_CAPACITY = 1024


class Signal:
    """Samples of one quantity over time, in an array that doubles when full.

    Args:
        name: the signal's name.
        shape: shape of one sample.
    """

    def __init__(self, name: str, shape: tuple[int, ...]) -> None:
        self.name = name
        self.shape = shape
        self._times = np.empty(_FIRST_CAPACITY)
        self._values = np.empty((_FIRST_CAPACITY, *shape))
        self._size = 0

    def __len__(self) -> int:
        return self._size

    def append(self, time: float, value: float | Float64[np.ndarray, "..."]) -> None:
        """Keep one sample, copied.

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

    @property
    def times(self) -> Float64[np.ndarray, " n"]:
        """Times of the samples [s]."""
        return self._times[: self._size].copy()

    @property
    def values(self) -> Float64[np.ndarray, "n ..."]:
        """The samples, time first."""
        return self._values[: self._size].copy()


Message = tuple[str, str, int, Any]
"""Topic, schema name, time [ns], and the JSON object (or a function that makes it, run later)."""

SCHEMAS: dict[str, dict[str, Any]] = {
    "poise.Signal": {
        "type": "object",
        "properties": {
            "time": {"type": "number", "description": "[s]"},
            "value": {"type": ["number", "null", "string", "array"], "items": {"type": "number"}},
        },
    },
    "poise.Joints": {
        "type": "object",
        "properties": {
            "time": {"type": "number", "description": "[s]"},
            "name": {"type": "array", "items": {"type": "string"}},
            "position": {"type": "array", "items": {"type": "number"}, "description": "[rad]"},
            "velocity": {"type": "array", "items": {"type": "number"}, "description": "[rad/s]"},
            "torque": {"type": "array", "items": {"type": "number"}, "description": "[N m]"},
        },
    },
    "foxglove.FrameTransforms": {
        "type": "object",
        "properties": {"transforms": {"type": "array", "items": {"type": "object"}}},
    },
    "foxglove.SceneUpdate": {
        "type": "object",
        "properties": {
            "deletions": {"type": "array", "items": {"type": "object"}},
            "entities": {"type": "array", "items": {"type": "object"}},
        },
    },
}
"""What the messages look like; Foxglove knows its own by their names."""

_CHUNK_BYTES = 256 * 1024
_STOP: Message = ("", "", 0, None)


class McapLog:
    """Writes JSON messages to an MCAP file from a thread.

    What was put in more than `flush_dt` ago is in the file, whatever happens to the process: every
    flush closes a chunk, and a reader needs no more than whole chunks.

    Args:
        path: the file, overwritten.
        metadata: texts that say what the log is of.
        flush_dt: wall-clock time between flushes [s].
        capacity: messages that may wait for the writer.
        on_full: "block" makes the caller wait, "drop" counts the message in `dropped`.

    Raises:
        MissingExtraError: the package mcap is not installed.
        PoiseError: the file cannot be made.
    """

    def __init__(
        self,
        path: Path,
        *,
        metadata: Mapping[str, str],
        flush_dt: float,
        capacity: int,
        on_full: Literal["block", "drop"],
    ) -> None:
        try:
            from mcap.writer import Writer
        except ModuleNotFoundError as error:
            raise MissingExtraError("mcap", "sim", "Writing a log") from error
        self.path = path
        self.dropped = 0
        self._block = on_full == "block"
        self._flush_dt = flush_dt
        self._queue: queue.Queue[Message] = queue.Queue(capacity)
        self._failure: OSError | None = None
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        try:
            self._stream = path.open("wb")
        except OSError as error:
            raise self._error(error) from error
        try:
            self._writer = Writer(self._stream, chunk_size=_CHUNK_BYTES)
            self._writer.start(profile="", library="poise")
            self._writer.add_metadata("poise", dict(metadata))
            self._writer.flush()
        except OSError as error:
            with suppress(OSError):
                self._stream.close()
            raise self._error(error) from error
        self._thread = threading.Thread(target=self._run, name="poise-log", daemon=True)
        self._thread.start()

    def put(self, message: Message) -> None:
        """Hand a message to the writer."""
        if self._block:
            self._queue.put(message)
            return
        try:
            self._queue.put_nowait(message)
        except queue.Full:
            self.dropped += 1

    def close(self) -> None:
        """Write all that waits, finish the file and close it.

        Raises:
            PoiseError: the log could not be written, because the disk is full for example.
        """
        if self._thread.is_alive():
            self._queue.put(_STOP)
            self._thread.join()
        try:
            self._stream.close()
        except OSError as error:
            self._failure = self._failure or error
        if self._failure is not None:
            raise self._error(self._failure) from self._failure

    def _error(self, cause: OSError) -> PoiseError:
        return PoiseError(f"the log {str(self.path)!r} cannot be written: {cause}")

    def _run(self) -> None:
        due = time.monotonic() + self._flush_dt
        while True:
            try:
                message = self._queue.get(timeout=max(0.0, due - time.monotonic()))
            except queue.Empty:
                message = None
            # After a failure the queue is still emptied, or a blocking caller would wait for ever.
            if self._failure is None:
                try:
                    self._handle(message)
                    if time.monotonic() >= due:
                        self._writer.flush()
                except OSError as error:
                    self._failure = error
            if message is _STOP:
                return
            if time.monotonic() >= due:
                due = time.monotonic() + self._flush_dt

    def _handle(self, message: Message | None) -> None:
        if message is None:
            return
        if message is _STOP:
            self._writer.finish()
            self._stream.flush()
            return
        topic, schema, stamp, content = message
        data = json.dumps(content() if callable(content) else content, allow_nan=False)
        self._writer.add_message(
            self._channel(topic, schema), log_time=stamp, data=data.encode(), publish_time=stamp
        )

    def _channel(self, topic: str, schema: str) -> int:
        if topic not in self._channels:
            if schema not in self._schemas:
                text = json.dumps({"title": schema, **SCHEMAS[schema]}).encode()
                self._schemas[schema] = self._writer.register_schema(schema, "jsonschema", text)
            self._channels[topic] = self._writer.register_channel(
                topic, "json", self._schemas[schema]
            )
        return self._channels[topic]


_MAGIC = b"\x89MCAP0\r\n"
"""What an MCAP file begins with, and ends with once it is finished."""


@dataclass(frozen=True, kw_only=True)
class Log:
    """What a log holds.

    Attributes:
        path: the file.
        complete: whether the log was finished; if not, the run died or still goes on.
        metadata: the texts that say what the log is of.
        messages: by topic, each message's time [s] and content.
    """

    path: Path
    complete: bool
    metadata: dict[str, str]
    messages: dict[str, list[tuple[float, dict[str, Any]]]] = field(repr=False)

    @property
    def topics(self) -> tuple[str, ...]:
        """Topics in the log."""
        return tuple(self.messages)

    @property
    def end(self) -> float:
        """Time of the last message [s], 0 for an empty log."""
        return max((stamps[-1][0] for stamps in self.messages.values()), default=0.0)

    def signal(self, name: str) -> tuple[Float64[np.ndarray, " n"], Float64[np.ndarray, "n ..."]]:
        """Times [s] and samples of a numeric signal; NaN where the log has null.

        Raises:
            UnknownNameError: the log has no such signal.
        """
        found = self.messages.get(f"/{name}")
        if found is None or "value" not in found[0][1]:
            raise UnknownNameError("unknown signal", got=name, choices=self.topics)
        times = np.array([message["time"] for _, message in found], dtype=np.float64)
        values = np.array([message["value"] for _, message in found], dtype=np.float64)
        return times, values


def read_log(path: Path | str) -> Log:
    """Read a log, up to where it ends or breaks off.

    Args:
        path: an MCAP file that a `Recorder` wrote.

    Returns:
        All whole messages in it.

    Raises:
        PoiseError: no such file, or no MCAP file.
        MissingExtraError: the package mcap is not installed.
    """
    path = Path(path)
    if not path.is_file():
        raise PoiseError("the log does not exist", got=str(path), wanted="an MCAP file")
    if find_spec("mcap") is None:
        raise MissingExtraError("mcap", "sim", "Reading a log")
    with path.open("rb") as stream:
        if stream.read(len(_MAGIC)) != _MAGIC:
            raise PoiseError("not an MCAP file", got=str(path), wanted="a log of a run")
    return _read(path)


def _read(path: Path) -> Log:
    from mcap.records import Channel, Footer, Message, Metadata

    topics: dict[int, str] = {}
    metadata: dict[str, str] = {}
    messages: dict[str, list[tuple[float, dict[str, Any]]]] = defaultdict(list)
    finished = False
    for record in _whole_records(path):
        if isinstance(record, Channel):
            topics[record.id] = record.topic
        elif isinstance(record, Message):
            content = cast("dict[str, Any]", json.loads(record.data))
            messages[topics[record.channel_id]].append((record.log_time * 1e-9, content))
        elif isinstance(record, Metadata):
            metadata |= record.metadata
        elif isinstance(record, Footer):
            finished = path.read_bytes().endswith(_MAGIC)
    return Log(path=path, complete=finished, metadata=metadata, messages=dict(messages))


def _whole_records(path: Path) -> Iterator[Any]:
    """Records up to the first that is cut off or says it is longer than the file."""
    from mcap.exceptions import EndOfFile, InvalidMagic, RecordLengthLimitExceeded
    from mcap.stream_reader import StreamReader

    cut_off = (EndOfFile, InvalidMagic, RecordLengthLimitExceeded, struct.error)
    with path.open("rb") as stream:
        records = iter(StreamReader(stream, record_size_limit=path.stat().st_size).records)
        while True:
            try:
                yield next(records)
            except (StopIteration, *cut_off):
                return
