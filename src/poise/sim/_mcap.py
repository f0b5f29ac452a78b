"""`McapFile`: an MCAP file with messages of one size in whole arrays, a chunk at a time.

The package mcap writes message by message, some ten microseconds each under the interpreter's
lock, and a run has ten thousand a second. Here the messages of a chunk are rows of arrays, and
what takes long about a chunk, its compression and its way to the disk, happens outside the lock.

The format is that of https://mcap.dev/spec: records of an opcode, a length and a content, where
integers are little-endian and a text or a map has its length in four bytes before it.
"""

import struct
import zlib
from collections.abc import Callable, Mapping
from enum import IntEnum
from typing import BinaryIO, NamedTuple

import numpy as np
from jaxtyping import Float64, UInt64

from poise.errors import MissingExtraError

MAGIC = b"\x89MCAP0\r\n"
"""What an MCAP file begins with, and ends with once it is finished."""


def nanoseconds(times: Float64[np.ndarray, " n"]) -> UInt64[np.ndarray, " n"]:
    """Times as logs have them, from seconds; there are none before zero."""
    return np.round(np.maximum(times, 0.0) * 1e9).astype(np.uint64)


class _Opcode(IntEnum):
    HEADER = 0x01
    FOOTER = 0x02
    SCHEMA = 0x03
    CHANNEL = 0x04
    MESSAGE = 0x05
    CHUNK = 0x06
    MESSAGE_INDEX = 0x07
    CHUNK_INDEX = 0x08
    STATISTICS = 0x0B
    METADATA = 0x0C
    METADATA_INDEX = 0x0D
    SUMMARY_OFFSET = 0x0E
    DATA_END = 0x0F


_LEVEL = 1
"""Of the compression: higher ones make a log of random digits hardly smaller."""

_COMPRESSION = "zstd"

_PREFIX = [
    ("opcode", "u1"),
    ("length", "<u8"),
    ("channel", "<u2"),
    ("sequence", "<u4"),
    ("log_time", "<u8"),
    ("publish_time", "<u8"),
]
"""What comes before the content of a message: that of every record, then its own."""

_RECORD_PREFIX = 9
_INDEX_ENTRY = np.dtype([("log_time", "<u8"), ("offset", "<u8")])


def compressor() -> Callable[[bytes], bytes]:
    """What makes chunks small; it lets other threads run meanwhile.

    Raises:
        MissingExtraError: the package zstandard is not installed.
    """
    try:
        from zstandard import ZstdCompressor
    except ModuleNotFoundError as error:
        raise MissingExtraError("zstandard", "sim", "Writing a log") from error
    return ZstdCompressor(level=_LEVEL).compress


class _Entry(NamedTuple):
    """A schema or a channel: its number in the file, and its record."""

    number: int
    record: bytes


class McapFile:
    """Writes an MCAP file: channels and messages, then a flush that makes a chunk of them.

    A reader needs no more than whole chunks, so what was flushed is there however the writing ends.

    Args:
        stream: what is written to; the caller closes it.
        compress: a `compressor`.
        library: says who wrote the file.
        metadata: texts that say what the file is of.

    Raises:
        OSError: the stream cannot be written.
    """

    def __init__(
        self,
        stream: BinaryIO,
        compress: Callable[[bytes], bytes],
        *,
        library: str,
        metadata: Mapping[str, str],
    ) -> None:
        self._stream, self._compress = stream, compress
        self._schemas: dict[str, _Entry] = {}
        self._channels: dict[tuple[str, str], _Entry] = {}
        self._chunks: list[bytes] = []
        self._counts: dict[int, int] = {}
        self._span: tuple[int, int] | None = None
        self._begin_chunk()
        stream.write(MAGIC + _record(_Opcode.HEADER, _text(""), _text(library)))
        start = stream.tell()
        texts = b"".join(_text(key) + _text(value) for key, value in metadata.items())
        length = stream.write(_record(_Opcode.METADATA, _text(library), _sized(texts)))
        place = struct.pack("<QQ", start, length)
        self._metadata = _record(_Opcode.METADATA_INDEX, place, _text(library))
        stream.flush()

    def channel(
        self, topic: str, encoding: str, schema: str = "", language: str = "", text: str = ""
    ) -> int:
        """The channel of a topic, made if it is new.

        Args:
            topic: its name.
            encoding: of its messages.
            schema: name of what they look like, "" where nobody else shall read them.
            language: of the schema's text.
            text: of the schema.
        """
        found = self._channels.get((topic, schema))
        if found is None:
            # Number zero is no schema.
            schema_number = self._schema(schema, language, text) if schema else 0
            number = len(self._channels) + 1
            numbers = struct.pack("<HH", number, schema_number)
            no_metadata = _sized(b"")
            record = _record(_Opcode.CHANNEL, numbers, _text(topic), _text(encoding), no_metadata)
            found = self._channels[topic, schema] = _Entry(number, record)
            self._add(record)
        return found.number

    def put(self, channel: int, time: float, content: bytes) -> None:
        """Adds one message, of a time [s]."""
        self.put_rows(channel, np.array([time]), np.frombuffer(content, f"V{len(content)}"))

    def put_rows(self, channel: int, times: Float64[np.ndarray, " n"], content: np.ndarray) -> None:
        """Adds messages of one size.

        Args:
            channel: of all of them.
            times: of each [s].
            content: an entry each, whose bytes are the message.
        """
        stamps = nanoseconds(times)
        rows = np.empty(len(stamps), dtype=[*_PREFIX, ("content", content.dtype)])
        rows["opcode"], rows["length"] = _Opcode.MESSAGE, rows.itemsize - _RECORD_PREFIX
        rows["channel"], rows["sequence"] = channel, 0
        rows["log_time"] = rows["publish_time"] = stamps
        rows["content"] = content
        entries = np.empty(len(stamps), dtype=_INDEX_ENTRY)
        entries["log_time"] = stamps
        entries["offset"] = self._size + rows.itemsize * np.arange(len(stamps), dtype=np.uint64)
        self._entries.setdefault(channel, []).append(entries)
        self._add(rows.tobytes())

    def flush(self) -> None:
        """Everything so far is in the file after this.

        Raises:
            OSError: it cannot be written.
        """
        if not self._parts:
            return
        data, entries = b"".join(self._parts), self._entries
        self._begin_chunk()
        stamps = [found["log_time"] for parts in entries.values() for found in parts]
        first = int(min((s.min() for s in stamps), default=0))
        last = int(max((s.max() for s in stamps), default=0))
        compressed = self._compress(data)
        start = self._stream.tell()
        self._stream.write(
            _record(
                _Opcode.CHUNK,
                struct.pack("<QQQI", first, last, len(data), zlib.crc32(data)),
                _text(_COMPRESSION),
                struct.pack("<Q", len(compressed)),
                compressed,
            )
        )
        after, places = self._stream.tell(), list[bytes]()
        for channel, parts in entries.items():
            places.append(struct.pack("<HQ", channel, self._stream.tell()))
            found = np.concatenate(parts)
            # In order of time: those of one table follow another's.
            found = found[np.argsort(found["log_time"], kind="stable")]
            number = struct.pack("<H", channel)
            self._stream.write(_record(_Opcode.MESSAGE_INDEX, number, _sized(found.tobytes())))
            self._counts[channel] = self._counts.get(channel, 0) + len(found)
        self._chunks.append(
            _record(
                _Opcode.CHUNK_INDEX,
                struct.pack("<QQQQ", first, last, start, after - start),
                _sized(b"".join(places)),
                struct.pack("<Q", self._stream.tell() - after),
                _text(_COMPRESSION),
                struct.pack("<QQ", len(compressed), len(data)),
            )
        )
        if stamps:
            low, high = self._span or (first, last)
            self._span = min(low, first), max(high, last)
        self._stream.flush()

    def finish(self) -> None:
        """Writes the summary, by which a reader finds its way about.

        Raises:
            OSError: it cannot be written.
        """
        self.flush()
        # A checksum of zero is none: every chunk has one of its own.
        self._stream.write(_record(_Opcode.DATA_END, struct.pack("<I", 0)))
        start = self._stream.tell()
        groups = (
            (_Opcode.SCHEMA, [schema.record for schema in self._schemas.values()]),
            (_Opcode.CHANNEL, [channel.record for channel in self._channels.values()]),
            (_Opcode.STATISTICS, [self._statistics()]),
            (_Opcode.CHUNK_INDEX, self._chunks),
            (_Opcode.METADATA_INDEX, [self._metadata]),
        )
        summary, offsets = b"", b""
        for opcode, records in groups:
            group = b"".join(records)
            if group:
                place = struct.pack("<BQQ", opcode, start + len(summary), len(group))
                offsets += _record(_Opcode.SUMMARY_OFFSET, place)
            summary += group
        places = struct.pack("<QQ", start, start + len(summary))
        # The checksum covers the footer as well, up to itself.
        covered = summary + offsets + struct.pack("<BQ", _Opcode.FOOTER, len(places) + 4) + places
        self._stream.write(covered + struct.pack("<I", zlib.crc32(covered)) + MAGIC)
        self._stream.flush()

    def _statistics(self) -> bytes:
        first, last = self._span or (0, 0)
        messages, metadata, attachments = sum(self._counts.values()), 1, 0
        numbers = (messages, len(self._schemas), len(self._channels), attachments, metadata)
        counts = b"".join(struct.pack("<HQ", *entry) for entry in self._counts.items())
        head = struct.pack("<QHIIIIQQ", *numbers, len(self._chunks), first, last)
        return _record(_Opcode.STATISTICS, head, _sized(counts))

    def _schema(self, name: str, language: str, text: str) -> int:
        found = self._schemas.get(name)
        if found is None:
            number = len(self._schemas) + 1
            place = struct.pack("<H", number)
            record = _record(_Opcode.SCHEMA, place, _text(name), _text(language), _text(text))
            found = self._schemas[name] = _Entry(number, record)
            self._add(record)
        return found.number

    def _begin_chunk(self) -> None:
        self._parts: list[bytes] = []
        self._size = 0
        self._entries: dict[int, list[np.ndarray]] = {}

    def _add(self, record: bytes) -> None:
        self._parts.append(record)
        self._size += len(record)


def _record(opcode: _Opcode, *parts: bytes) -> bytes:
    content = b"".join(parts)
    return struct.pack("<BQ", opcode, len(content)) + content


def _sized(content: bytes) -> bytes:
    return struct.pack("<I", len(content)) + content


def _text(text: str) -> bytes:
    return _sized(text.encode())
