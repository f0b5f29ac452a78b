"""The log of a run on the disk: an MCAP file, and reading it back.

A thread of its own writes it, so that the control loop never waits for a disk; it is read as far
as it goes where the run died while writing it. Topics are for people: Foxglove draws them. The
record itself stands beside them, in blocks of numbers as they were in memory, see `RecordPart`.
"""

import json
import queue
import struct
import threading
import time
from collections import defaultdict
from collections.abc import Iterator, Mapping
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Literal

from poise.errors import MissingExtraError, PoiseError
from poise.sim._record import RecordPart, RunRecord

Message = tuple[str, str, int, Any]
"""Topic, schema name, time [ns], and the JSON object, or a function that makes it or bytes later.
"""

RECORD_TOPIC = "/record"
"""Where the blocks of the record are."""

_BLOCK = "poise.Block"

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
        self._waits = on_full == "block"
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
        if not self._offer(message):
            self.dropped += 1

    def put_block(self, time: float, block: RecordPart) -> bool:
        """Hand over a part of the record, up to a time [s].

        Returns:
            Whether there was room for it; if not, the next one must hold it too.
        """
        return self._offer((RECORD_TOPIC, _BLOCK, round(time * 1e9), block.pack))

    def _offer(self, message: Message) -> bool:
        try:
            self._queue.put(message, block=self._waits)
        except queue.Full:
            return False
        return True

    def close(self, last: RecordPart | None = None, time: float = 0.0) -> None:
        """Write all that waits, finish the file and close it.

        Args:
            last: what of the record is not in it yet.
            time: up to which [s].

        Raises:
            PoiseError: the log could not be written, because the disk is full for example.
        """
        if self._thread.is_alive():
            if last:
                self._queue.put((RECORD_TOPIC, _BLOCK, round(time * 1e9), last.pack))
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
        content = content() if callable(content) else content
        if not isinstance(content, bytes):
            content = json.dumps(content, allow_nan=False).encode()
        self._writer.add_message(
            self._channel(topic, schema), log_time=stamp, data=content, publish_time=stamp
        )

    def _channel(self, topic: str, schema: str) -> int:
        if schema == _BLOCK and topic not in self._channels:
            # Schema zero is none: nobody but `read_log` needs to understand it.
            self._channels[topic] = self._writer.register_channel(topic, "poise.block", 0)
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


def read_log(path: Path | str) -> RunRecord:
    """Reads the record of a run from its log, up to where that ends or breaks off.

    Args:
        path: an MCAP file that a `Recorder` wrote.

    Returns:
        The record as it was in memory, to the last bit; `complete` is False where the log was not
        finished: the run died, or still goes on.

    Raises:
        PoiseError: no such file, or no MCAP file.
        MissingExtraError: the package mcap is not installed.
    """
    path = _checked(path)
    from mcap.records import Channel, Footer, Message, Metadata

    record, blocks = RunRecord(), set[int]()
    record.complete = False
    for found in _whole_records(path):
        if isinstance(found, Metadata):
            record.metadata |= found.metadata
        elif isinstance(found, Channel) and found.topic == RECORD_TOPIC:
            blocks.add(found.id)
        elif isinstance(found, Message) and found.channel_id in blocks:
            record.take_in(found.data)
        elif isinstance(found, Footer):
            record.complete = path.read_bytes().endswith(_MAGIC)
    return record


def read_topics(path: Path | str) -> dict[str, list[tuple[float, dict[str, Any]]]]:
    """What people see of a log: by topic, each message's time [s] and content.

    Args:
        path: an MCAP file that a `Recorder` wrote.

    Raises:
        PoiseError: no such file, or no MCAP file.
        MissingExtraError: the package mcap is not installed.
    """
    path = _checked(path)
    from mcap.records import Channel, Message

    topics: dict[int, str] = {}
    messages: dict[str, list[tuple[float, dict[str, Any]]]] = defaultdict(list)
    for found in _whole_records(path):
        if isinstance(found, Channel) and found.message_encoding == "json":
            topics[found.id] = found.topic
        elif isinstance(found, Message) and found.channel_id in topics:
            content = json.loads(found.data)
            messages[topics[found.channel_id]].append((found.log_time * 1e-9, content))
    return dict(messages)


def _checked(path: Path | str) -> Path:
    path = Path(path)
    if not path.is_file():
        raise PoiseError("the log does not exist", got=str(path), wanted="an MCAP file")
    if find_spec("mcap") is None:
        raise MissingExtraError("mcap", "sim", "Reading a log")
    with path.open("rb") as stream:
        if stream.read(len(_MAGIC)) != _MAGIC:
            raise PoiseError("not an MCAP file", got=str(path), wanted="a log of a run")
    return path


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
