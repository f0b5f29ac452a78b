"""The log of a run on the disk: an MCAP file, and reading it back.

A thread of its own writes it, so that the control loop never waits for a disk; it is read as far
as it goes where the run died while writing it. Topics are for people: Foxglove draws them. The
record itself stands beside them, in blocks of numbers as they were in memory, see `RecordPart`.
"""

import queue
import struct
import threading
from collections.abc import Iterator, Mapping
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any, BinaryIO

from poise.errors import MissingExtraError, PoiseError
from poise.sim._foxglove import Topics
from poise.sim._mcap import MAGIC, McapFile, compressor
from poise.sim._record import RunRecord
from poise.sim._record_part import RecordPart

RECORD_TOPIC = "/record"
"""Where the blocks of the record are."""

_LIBRARY = "poise log 2"
"""Who wrote the file, and how its blocks are packed: another number cannot be read."""


class McapLog:
    """Writes parts of a record to an MCAP file from a thread.

    A part that was put is in the file as soon as the thread has come to it, whatever happens to
    the process then: each makes a chunk, and a reader needs no more than whole chunks.

    Args:
        path: the file, overwritten.
        topics: make of each part what Foxglove shows.
        metadata: texts that say what the log is of.
        capacity: parts that may wait for the thread.
        waits: whether `put` waits while that many do.

    Raises:
        MissingExtraError: the package zstandard is not installed.
        PoiseError: the file cannot be made.
    """

    def __init__(
        self,
        path: Path,
        topics: Topics,
        *,
        metadata: Mapping[str, str],
        capacity: int,
        waits: bool,
    ) -> None:
        # Before there is a file.
        compress = compressor()
        self.path = path
        self._topics, self._waits = topics, waits
        self._queue: queue.Queue[tuple[float, RecordPart] | None] = queue.Queue(capacity)
        self._failure: Exception | None = None
        try:
            self._stream = _fresh(path)
        except OSError as error:
            raise self._error(error) from error
        try:
            self._file = McapFile(self._stream, compress, library=_LIBRARY, metadata=metadata)
        except OSError as error:
            with suppress(OSError):
                self._stream.close()
            raise self._error(error) from error
        self._thread = threading.Thread(target=self._run, name="poise-log", daemon=True)
        self._thread.start()

    def put(self, time: float, part: RecordPart) -> bool:
        """Hands over a part of the record, up to a time [s].

        Returns:
            Whether there was room for it; if not, the next one must hold it too.
        """
        try:
            self._queue.put((time, part), block=self._waits)
        except queue.Full:
            return False
        return True

    def close(self, last: RecordPart, time: float) -> None:
        """Writes all that waits, finishes the file and closes it.

        Args:
            last: what of the record is not in it yet.
            time: up to which [s].

        Raises:
            PoiseError: the log could not be written, because the disk is full for example.
        """
        if self._thread.is_alive():
            if last:
                self._queue.put((time, last))
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
        while (entry := self._queue.get()) is not None:
            # After a failure the queue is still emptied, or a caller that waits never went on.
            if self._failure is None:
                self._write(*entry)
        try:
            if self._failure is None:
                self._file.finish()
        except OSError as error:
            self._failure = error

    def _write(self, time: float, part: RecordPart) -> None:
        try:
            # No schema: nobody but `read_log` needs to understand it.
            self._file.put(self._file.channel(RECORD_TOPIC, "poise"), time, part.pack())
            self._topics.write(self._file, part)
            self._file.flush()
        except Exception as error:  # Whatever it is, `close` says so; the run goes on until then.
            self._failure = error


def _fresh(path: Path) -> BinaryIO:
    """A file of one's own: another run that still writes to one of this name keeps its own."""
    if path.is_file() and not path.is_symlink():
        path.unlink()
    return path.open("wb")


def read_log(path: Path | str) -> RunRecord:
    """Reads the record of a run from its log, up to where that ends or breaks off.

    Args:
        path: an MCAP file that a `Recorder` wrote.

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

    record, blocks = RunRecord(), set[int]()
    record.complete = False
    for found in _whole_records(path):
        if isinstance(found, Header) and found.library != _LIBRARY:
            raise PoiseError(
                f"{str(path)!r} is no log of this version of Poise",
                got=f"written by {found.library!r}",
                wanted=f"written by {_LIBRARY!r}",
            )
        if isinstance(found, Metadata):
            record.metadata |= found.metadata
        elif isinstance(found, Channel) and found.topic == RECORD_TOPIC:
            blocks.add(found.id)
        elif isinstance(found, Message) and found.channel_id in blocks:
            record.take_in(RecordPart.unpack(found.data))
        elif isinstance(found, Footer):
            record.complete = path.read_bytes().endswith(MAGIC)
    return record


def _checked(path: Path | str) -> Path:
    path = Path(path)
    if not path.is_file():
        raise PoiseError("the log does not exist", got=str(path), wanted="an MCAP file")
    if find_spec("mcap") is None:
        raise MissingExtraError("mcap", "sim", "Reading a log")
    with path.open("rb") as stream:
        if stream.read(len(MAGIC)) != MAGIC:
            raise PoiseError("not an MCAP file", got=str(path), wanted="a log of a run")
    return path


def _whole_records(path: Path) -> Iterator[Any]:
    """Records up to the first that is cut off, is damaged, or says it is longer than the file."""
    from mcap.exceptions import McapError
    from mcap.stream_reader import StreamReader
    from zstandard import ZstdError

    # Wrong checksums and texts that are none are ValueErrors.
    broken = (McapError, ZstdError, struct.error, ValueError)
    size = path.stat().st_size
    with path.open("rb") as stream:
        reader = StreamReader(stream, record_size_limit=size, validate_crcs=True)
        records = iter(reader.records)
        while True:
            try:
                yield next(records)
            except (StopIteration, *broken):
                return
