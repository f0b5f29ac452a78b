"""Reading a log back, also one whose run died while writing it."""

import json
import struct
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any, cast

import numpy as np
from jaxtyping import Float64

from poise.errors import MissingExtraError, PoiseError, UnknownNameError

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
