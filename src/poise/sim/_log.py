"""The log of a run on the disk: an MCAP file, and reading it back.

A thread of its own writes it, so that the control loop never waits for a disk; it is read as far
as it goes where the run died while writing it. A topic `/signals` has a message a row of samples, a
topic each of notes a message a text, both as they were in memory and as Foxglove reads them.
"""

import json
import math
import os
import queue
import re
import struct
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from poise.errors import MissingExtraError, PoiseError
from poise.sim._foxglove import NOTE, RobotTopics, Schema, ros_text
from poise.sim._record import Part, RunRecord
from poise.sim._table import Signal, Table

_LIBRARY = "poise log 3"
"""Library of the header; the number is the version of the layout."""

_METADATA = "poise"
"""Name of the texts that say what the log is of."""

_HOLDS, _NOTES, _MESSAGES = "holds", "notes", "messages"
"""Content of a channel, in its metadata: notes, messages, or the signals of a table in JSON."""

_LAST = 1e9
"""Latest time of a message [s]; its nanoseconds have 64 bits, and begin at zero."""

_MAGIC = b"\x89MCAP0\r\n"

_ROS_TYPES = {
    "f8": "float64", "f4": "float32", "b1": "bool",
    "i1": "int8", "i2": "int16", "i4": "int32", "i8": "int64",
    "u1": "uint8", "u2": "uint16", "u4": "uint32", "u8": "uint64",
}  # fmt: skip


class McapLog:
    """Writes parts of a record to an MCAP file from a thread.

    A part that was put is in the file as soon as the thread has come to it, whatever happens to
    the process then: each makes a chunk, and a reader needs no more than whole chunks.

    Args:
        path: the file, overwritten.
        topics: make of each part what Foxglove draws of the robot; None for nothing.
        metadata: texts that say what the log is of.
        capacity: parts that may wait for the thread.
        waits: whether `put` waits while that many do.

    Raises:
        MissingExtraError: the package mcap is not installed.
        PoiseError: the file cannot be made.
    """

    def __init__(
        self,
        path: Path,
        topics: RobotTopics | None = None,
        *,
        metadata: Mapping[str, str],
        capacity: int = 0,
        waits: bool = True,
    ) -> None:
        # Before the file is made.
        try:
            from mcap.writer import Writer
        except ModuleNotFoundError as error:
            raise MissingExtraError("mcap", "sim", "Writing a log") from error
        self.path = path
        self._topics, self._waits = topics, waits
        self._metadata, self._added = dict(metadata), dict[str, str]()
        self._channels: dict[tuple[str, Schema | None], int] = {}
        self._tables: dict[tuple[Signal, ...], int] = {}
        self._queue: queue.Queue[Part | None] = queue.Queue(capacity)
        self._failure: Exception | None = None
        try:
            self._stream = _fresh(path)
        except OSError as error:
            raise self._error(error) from error
        # A chunk is what was put together: no message begins another one.
        self._writer = Writer(self._stream, chunk_size=1 << 62)
        try:
            self._writer.start(library=_LIBRARY)
            self._writer.add_metadata(_METADATA, self._metadata)
            self._stream.flush()
        except OSError as error:
            with suppress(OSError):
                self._stream.close()
            raise self._error(error) from error
        self._thread = threading.Thread(target=self._run, name="poise-log", daemon=True)
        self._thread.start()

    @property
    def failure(self) -> Exception | None:
        """Error that ended the writing; None for none."""
        return self._failure

    def put(self, part: Part) -> bool:
        """Hand over a part of the record.

        Returns:
            Whether there was room for it; if not, the next one must hold it too.
        """
        try:
            self._queue.put(part, block=self._waits)
        except queue.Full:
            return False
        return True

    def close(self, last: Part, metadata: Mapping[str, str]) -> None:
        """Write all that waits, finish the file and close it.

        Args:
            last: what of the record is not in it yet.
            metadata: of the record, with what is known at its end alone.

        Raises:
            PoiseError: the log could not be written, because the disk is full for example.
        """
        if self._thread.is_alive():
            self._added = {k: v for k, v in metadata.items() if self._metadata.get(k) != v}
            if last:
                self._queue.put(last)
            self._queue.put(None)
            self._thread.join()
        try:
            self._stream.close()
        except OSError as error:
            self._failure = self._failure or error
        if self._failure is not None:
            raise self._error(self._failure) from self._failure

    def _error(self, cause: Exception) -> PoiseError:
        return PoiseError(f"the log {str(self.path)!r} cannot be written: {cause}")

    def _run(self) -> None:
        while (part := self._queue.get()) is not None:
            # After a failure the queue is still emptied, or a caller that waits never went on.
            if self._failure is None:
                self._try(self._write, part)
        if self._failure is None:
            self._try(self._end)

    def _try(self, act: Callable[..., None], *arguments: Any) -> None:
        try:
            act(*arguments)
        except Exception as error:  # Whatever it is, `close` says so; the run goes on until then.
            self._failure = error

    def _end(self) -> None:
        if self._added:
            self._writer.add_metadata(_METADATA, self._added)
        self._writer.finish()
        self._stream.flush()

    def _write(self, part: Part) -> None:
        for signals, rows in part.rows:
            channel = self._tables.get(signals)
            if channel is None:
                channel = self._tables[signals] = self._new_table(signals)
            data, size = rows.tobytes(), rows.itemsize
            for k, time in enumerate(rows["time"].tolist()):
                self._add(channel, time, data[k * size : (k + 1) * size])
            if self._topics is not None:
                for topic, schema, time, content in self._topics.messages(signals, rows):
                    self._add(self._channel(topic, schema), time, content)
        for topic, found in part.events.items():
            for time, content in found:
                if isinstance(content, str):
                    channel = self._channel(f"/{topic}", NOTE, {_HOLDS: _NOTES})
                    content = ros_text(content)
                else:
                    channel = self._channel(f"/{topic}", None, {_HOLDS: _MESSAGES})
                    content = bytes(content)
                self._add(channel, time, struct.pack("<d", time) + content)
        self._writer.flush()

    def _add(self, channel: int, time: float, content: bytes) -> None:
        stamp = round(min(max(0.0, time), _LAST) * 1e9)
        self._writer.add_message(channel, stamp, content, stamp)

    def _new_table(self, signals: tuple[Signal, ...]) -> int:
        topic = f"/signals{len(self._tables) or ''}"
        return self._channel(topic, _row_schema(topic, signals), {_HOLDS: _table_text(signals)})

    def _channel(
        self, topic: str, schema: Schema | None, about: Mapping[str, str] | None = None
    ) -> int:
        found = self._channels.get((topic, schema))
        if found is None:
            number, encoding = 0, _MESSAGES
            if schema is not None:
                text, encoding = schema.text.encode(), schema.encoding
                number = self._writer.register_schema(schema.name, schema.language, text)
            found = self._writer.register_channel(topic, encoding, number, dict(about or {}))
            self._channels[topic, schema] = found
        return found


def write_log(record: RunRecord, path: Path) -> None:
    """Write a record that is in memory to a log.

    Raises:
        MissingExtraError: the package mcap is not installed.
        PoiseError: the log cannot be written.
    """
    McapLog(path, metadata=record.metadata).close(record.part({}), record.metadata)


def _table_text(signals: tuple[Signal, ...]) -> str:
    return json.dumps([(s.name, s.unit, s.dtype.str, s.shape) for s in signals])


def _row_schema(topic: str, signals: tuple[Signal, ...]) -> Schema:
    """A row of a `Table` as ROS 1 reads it, with names that it takes."""
    lines = {"order": "int64 order", "time": "float64 time  # [s]"}
    for signal in signals:
        name, kind = re.sub(r"\W", "_", signal.name), _ROS_TYPES.get(signal.dtype.str[1:])
        count = f"[{math.prod(signal.shape)}]" if signal.shape else ""
        if kind is None:
            # Numbers that ROS does not have are shown as their bytes.
            kind, count = "uint8", f"[{math.prod(signal.shape) * signal.dtype.itemsize}]"
        while name in lines:
            name += "_"
        lines[name] = f"{kind}{count} {name}" + (f"  # [{signal.unit}]" if signal.unit else "")
    return Schema(f"poise{topic}", "\n".join(lines.values()))


def _fresh(path: Path) -> BinaryIO:
    """A new file: a run that still writes to an older one of this name keeps that."""
    if path.is_file() and not path.is_symlink():
        path.unlink()
    return path.open("wb")


def finish_log(path: Path) -> None:
    """End a log that broke off, or a copy of one that goes on, after its last whole chunk.

    Raises:
        OSError: it cannot be written.
    """
    from mcap.data_stream import RecordBuilder
    from mcap.records import DataEnd, Footer

    end = RecordBuilder()
    DataEnd(0).write(end)
    Footer(0, 0, 0).write(end)
    with path.open("r+b") as stream:
        place = len(_MAGIC)
        for _ in _whole_records(stream, chunks=True):
            place = stream.tell()
        stream.seek(place)
        stream.write(end.end() + _MAGIC)
        stream.truncate()


def read_log(path: Path | str, topics: tuple[str, ...] | None = None) -> RunRecord:
    """Read the record of a run from its log, up to where that ends or breaks off.

    Args:
        path: an MCAP file that a `Recorder` wrote.
        topics: of the notes and messages that are read, and no signals; everything when None.

    Returns:
        The record as it was in memory, to the last bit; `complete` is False where the log was not
        finished, as the run died or still goes on, and where it is damaged: it ends there.

    Raises:
        PoiseError: no such file, no MCAP file, or one that Poise or this version of it did not
            write.
        MissingExtraError: the package mcap is not installed.
    """
    path = _checked(path)
    from mcap.records import Channel, Footer, Header, Message, Metadata

    record, complete = RunRecord(), False
    channels, contents = dict[int, Channel](), dict[int, list[bytes]]()
    with path.open("rb") as stream:
        for item in _whole_records(stream):
            if isinstance(item, Message):
                if item.channel_id in contents:
                    contents[item.channel_id].append(item.data)
            elif isinstance(item, Header) and item.library != _LIBRARY:
                raise PoiseError(
                    f"{str(path)!r} is no log of this version of Poise",
                    got=f"written by {item.library!r}",
                    wanted=f"written by {_LIBRARY!r}",
                )
            elif isinstance(item, Metadata):
                record.metadata |= item.metadata
            elif isinstance(item, Channel) and _is_of(item, topics):
                channels[item.id] = item
                contents.setdefault(item.id, [])
            complete = isinstance(item, Footer)
    record.complete = complete and _ends(path)
    for number, channel in channels.items():
        if contents[number]:
            holds, topic = channel.metadata[_HOLDS], channel.topic[1:]
            try:
                record.take_in(_part(topic, holds, contents[number]))
            except (ValueError, TypeError, struct.error) as error:
                raise PoiseError(f"{topic} in {str(path)!r} cannot be read: {error}") from error
    return record


def _is_of(channel: Any, topics: tuple[str, ...] | None) -> bool:
    """True for a channel of a record that has one of some topics, or any where None."""
    return _HOLDS in channel.metadata and (topics is None or channel.topic[1:] in topics)


def _part(topic: str, holds: str, contents: list[bytes]) -> Part:
    """Rows or events of a channel's messages."""
    if holds not in (_NOTES, _MESSAGES):
        found = json.loads(holds)
        table = Table(tuple(Signal(n, u, np.dtype(d), tuple(s)) for n, u, d, s in found))
        return Part([(table.signals, np.frombuffer(b"".join(contents), table.layout))], {})
    times = [struct.unpack_from("<d", content)[0] for content in contents]
    # A text has its length before it.
    found = [c[12:].decode() if holds == _NOTES else c[8:] for c in contents]
    return Part([], {topic: list(zip(times, found, strict=True))})


def _ends(path: Path) -> bool:
    with path.open("rb") as stream:
        stream.seek(-len(_MAGIC), 2)
        return stream.read() == _MAGIC


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


def _whole_records(stream: BinaryIO, *, chunks: bool = False) -> Iterator[Any]:
    """Records up to the first that is cut off, is damaged, or says it is longer than the file.

    Args:
        stream: the file.
        chunks: whether to yield chunks as they are, and not what is in them.
    """
    from mcap.exceptions import McapError
    from mcap.stream_reader import StreamReader
    from zstandard import ZstdError

    # Wrong checksums and texts that are none are ValueErrors.
    broken = (McapError, ZstdError, struct.error, ValueError)
    size = os.fstat(stream.fileno()).st_size
    reader = StreamReader(
        stream, record_size_limit=size, validate_crcs=not chunks, emit_chunks=chunks
    )
    records = iter(reader.records)
    while True:
        try:
            yield next(records)
        except (StopIteration, *broken):
            return
