"""`McapLog`: the record of a run in an MCAP file, and reading it back.

`/signals` has a message for each row of samples, a topic for each kind of notes a message for each
text, both as they were in memory and as Foxglove reads them.
"""

import json
import os
import queue
import struct
import threading
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from poise.errors import PoiseError, import_extra
from poise.sim._foxglove import (
    MESSAGES,
    NOTES,
    RobotTopics,
    Topic,
    events_topic,
    ros_text,
    rows_topic,
)
from poise.sim._record import RunRecord, Signal, Table, time_of

_LIBRARY = "poise log 3"  # of the header; the number is the version of the layout
_METADATA = "poise"  # name of the metadata of the run
_HOLDS = "holds"  # content of a channel, in its metadata, see `Topic`
_LAST = 1e9  # latest time of a message [s]: its nanoseconds have 64 bits
_MAGIC = b"\x89MCAP0\r\n"


class McapLog:
    """Write a record to an MCAP file from a thread, in chunks that each stand for themselves."""

    def __init__(
        self, path: Path, record: RunRecord, topics: RobotTopics | None = None, *, keep: bool = True
    ) -> None:
        # Before the file is made.
        writer = import_extra("mcap.writer", "sim", "Writing a log")
        self.path = path
        self._record, self._topics, self._metadata = record, topics, dict(record.metadata)
        self._channels, self._tables = dict[Topic, int](), dict[tuple[Signal, ...], Topic]()
        self._queue = queue.SimpleQueue[list[Any] | None]()
        self.put()
        record.keeps = keep
        self.failure: Exception | None = None
        try:
            if path.is_file() and not path.is_symlink():
                # A run that still writes to an older file of this name keeps that.
                path.unlink()
            self._stream = path.open("wb")
        except OSError as error:
            raise self._error(error) from error
        # A chunk is what was put together: no message begins another one.
        self._writer = writer.Writer(self._stream, chunk_size=1 << 62)
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

    def put(self) -> None:
        """Queue the rows recorded since the last call."""
        self._queue.put(self._record.take_fresh())

    def close(self) -> None:
        """Write all that waits and what is new in the record, finish the file and close it."""
        if self._thread.is_alive():
            self.put()
            self._queue.put(None)
            self._thread.join()
        try:
            self._stream.close()
        except OSError as error:
            self.failure = self.failure or error
        if self.failure is not None:
            raise self._error(self.failure) from self.failure

    def _error(self, cause: Exception) -> PoiseError:
        return PoiseError(f"the log {str(self.path)!r} cannot be written: {cause}")

    def _run(self) -> None:
        part: list[Any] | None = None
        try:
            while (part := self._waiting()) is not None:
                for place, items in part:
                    self._write(place, items)
                self._writer.flush()
            metadata = self._record.metadata.items()
            added = {key: text for key, text in metadata if self._metadata.get(key) != text}
            if added:
                self._writer.add_metadata(_METADATA, added)
            self._writer.finish()
            self._stream.flush()
        except Exception as error:  # Whatever it is, `close` raises it; the run goes on until then.
            self.failure = error
            # Nothing of what comes piles up in memory.
            while part is not None:
                part = self._queue.get()

    def _waiting(self) -> list[Any] | None:
        """All that waits, for one chunk: a writer that is behind catches up; None at the end."""
        part = self._queue.get()
        while part is not None and not self._queue.empty():
            if (more := self._queue.get()) is None:
                self._queue.put(None)
                break
            part += more
        return part

    def _write(self, place: Table | str, items: list[Any]) -> None:
        """Write rows of a table, or events of a topic."""
        if isinstance(place, str):
            for time, content in items:
                noted = isinstance(content, str)
                packed = ros_text(content) if noted else bytes(content)
                topic = events_topic(place, NOTES if noted else MESSAGES)
                self._add(topic, time, struct.pack("<d", time) + packed)
        elif items:
            if place.signals not in self._tables:
                name = f"signals{len(self._tables) or ''}"
                self._tables[place.signals] = rows_topic(name, place.signals)
            for row in items:
                self._add(self._tables[place.signals], time_of(row), row)
                for shown in () if self._topics is None else self._topics.messages(place, row):
                    self._add(*shown)

    def _add(self, topic: Topic, time: float, content: bytes) -> None:
        channel = self._channels.get(topic)
        if channel is None:
            schema = (topic.schema, topic.language, topic.text.encode())
            number = self._writer.register_schema(*schema) if topic.schema else 0
            about = {_HOLDS: topic.holds} if topic.holds else {}
            channel = self._writer.register_channel(topic.name, topic.encoding, number, about)
            self._channels[topic] = channel
        stamp = round(min(max(0.0, time), _LAST) * 1e9)
        self._writer.add_message(channel, stamp, content, stamp)


def write_log(record: RunRecord, path: Path) -> None:
    """Write a record that is in memory to a log."""
    McapLog(path, record).close()


def finish_log(path: Path) -> None:
    """End a log that broke off, or a copy of one that goes on, after its last whole chunk."""
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
    """Read the record of a run from its log, to the last bit, as far as that goes.

    Args:
        path: an MCAP file that a `Recorder` wrote.
        topics: of the notes and messages that are read, and no signals; everything when None.

    Returns:
        The record; not `complete` where the log breaks off or is damaged: it ends there.

    Raises:
        PoiseError: no MCAP file, or none that this version of Poise wrote.
        MissingExtraError: the package mcap is not installed.
    """
    path = Path(path)
    if not path.is_file():
        raise PoiseError("the log does not exist", got=str(path), wanted="an MCAP file")
    import_extra("mcap", "sim", "Reading a log")
    from mcap.records import Channel, Footer, Header, Message, Metadata

    record, complete = RunRecord(), False
    wanted = (lambda _: True) if topics is None else topics.__contains__
    channels = dict[int, tuple[Channel, list[bytes]]]()
    with path.open("rb") as stream:
        if stream.read(len(_MAGIC)) != _MAGIC:
            raise PoiseError("not an MCAP file", got=str(path), wanted="a log of a run")
        stream.seek(0)
        for item in _whole_records(stream):
            if isinstance(item, Message):
                if item.channel_id in channels:
                    channels[item.channel_id][1].append(item.data)
            elif isinstance(item, Header) and item.library != _LIBRARY:
                raise PoiseError(
                    f"{str(path)!r} is no log of this version of Poise",
                    got=f"written by {item.library!r}",
                    wanted=f"written by {_LIBRARY!r}",
                )
            elif isinstance(item, Metadata):
                record.metadata |= item.metadata
            elif isinstance(item, Channel) and _HOLDS in item.metadata and wanted(item.topic[1:]):
                channels.setdefault(item.id, (item, []))
            complete = isinstance(item, Footer)
        stream.seek(-len(_MAGIC), os.SEEK_END)
        record.complete = complete and stream.read() == _MAGIC
    for channel, contents in channels.values():
        if contents:
            topic = channel.topic[1:]
            try:
                record.take_in(*_part(topic, channel.metadata[_HOLDS], contents))
            except (ValueError, TypeError, struct.error) as error:
                raise PoiseError(f"{topic} in {str(path)!r} cannot be read: {error}") from error
    return record


def _part(topic: str, holds: str, contents: list[bytes]) -> tuple[Table | str, list[Any]]:
    """Rows or events of a channel's messages, and their table or topic."""
    if holds not in (NOTES, MESSAGES):
        found = json.loads(holds)
        return Table(tuple(Signal(n, u, np.dtype(d), tuple(s)) for n, u, d, s in found)), contents
    times = [struct.unpack_from("<d", content)[0] for content in contents]
    # A text has its length before it.
    found = [c[12:].decode() if holds == NOTES else c[8:] for c in contents]
    return topic, list(zip(times, found, strict=True))


def _whole_records(stream: BinaryIO, *, chunks: bool = False) -> Iterator[Any]:
    """Records up to the first that is cut off, damaged, or longer than the file by its header."""
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
