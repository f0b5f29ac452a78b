"""`RecordPart`: what came to a record between two moments, and the bytes of it in a log."""

import json
import math
from typing import Any, NamedTuple

import numpy as np

from poise.sim._table import Rows, Signal


class RecordPart(NamedTuple):
    """A part of a record: its samples and notes from one moment to another.

    Attributes:
        rows: of each table, in order.
        notes: by topic: time [s] and text.
    """

    rows: list[Rows]
    notes: dict[str, list[tuple[float, str]]]

    def __bool__(self) -> bool:
        return bool(self.rows or self.notes)

    def pack(self) -> bytes:
        """The length of a header (four bytes, little-endian), the header in JSON, the numbers.

        The numbers are raw, as they are in memory, so nothing is lost: neither a bit nor NaN nor
        the kind of number. They come table by table: order, times, a column a signal, each filled
        up to a multiple of eight bytes.
        """
        tables = [
            (len(rows.times), [(s.name, s.unit, s.dtype.str, s.shape) for s in rows.signals])
            for rows in self.rows
        ]
        header = json.dumps({"tables": tables, "notes": self.notes}).encode()
        parts = [len(header).to_bytes(4, "little"), header]
        for rows in self.rows:
            for array in (rows.order, rows.times, *rows.columns):
                parts += [np.ascontiguousarray(array).tobytes(), bytes(-array.nbytes % 8)]
        return b"".join(parts)

    @classmethod
    def unpack(cls, data: bytes) -> "RecordPart":
        """The part that `pack` made bytes of."""
        place = 4 + int.from_bytes(data[:4], "little")
        header = json.loads(data[4:place])

        def take(dtype: np.dtype[Any], shape: tuple[int, ...]) -> np.ndarray:
            nonlocal place
            array = np.frombuffer(data, dtype, math.prod(shape), place).reshape(shape)
            place += array.nbytes + (-array.nbytes % 8)
            return array

        tables: list[Rows] = []
        for count, found in header["tables"]:
            signals = tuple(
                Signal(name, unit, np.dtype(dtype), tuple(shape))
                for name, unit, dtype, shape in found
            )
            order = take(np.dtype(np.int64), (count,))
            times = take(np.dtype(np.float64), (count,))
            columns = [take(signal.dtype, (count, *signal.shape)) for signal in signals]
            tables.append(Rows(signals, order, times, columns))
        notes = {
            topic: [(time, text) for time, text in found]
            for topic, found in header["notes"].items()
        }
        return cls(tables, notes)
