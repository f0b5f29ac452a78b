"""`Mailbox`: the newest record in memory that two processes share."""

from typing import Any
from zlib import crc32

import numpy as np

_TRIES = 3  # reads until one is intact: each fault takes a writer that overtakes the reader again

Record = Any  # a structured scalar of NumPy
_NONE: tuple[int, Record] | None = None


class Mailbox:
    """Newest record in shared memory, of one writer and any number of readers, without locks.

    Two slots are written in turn, each with its sequence number and a CRC-32 of both. A record that
    is torn by the writer, by its death, or by processors that reorder their stores fails its
    checksum, and the other slot has the last one before.

    Args:
        memory: of `size_of(kind)` bytes, zero at the beginning.
        kind: structured data type of the record.
    """

    def __init__(self, memory: Any, kind: np.dtype[np.void]) -> None:
        slots = np.frombuffer(memory, dtype=_slot(kind), count=2)
        self._record, self._number, self._checksum = slots["record"], slots["number"], slots["crc"]
        self._written, self._found = 0, _NONE

    @staticmethod
    def size_of(kind: np.dtype[np.void]) -> int:
        """Return the size of the memory [bytes]."""
        return 2 * _slot(kind).itemsize

    def write(self, record: Record) -> None:
        """Replace the older record."""
        number = self._written = self._written + 1
        slot = number % 2
        self._record[slot] = record
        self._number[slot] = number
        self._checksum[slot] = crc32(record.tobytes(), number & _WORD)

    def read(self) -> tuple[int, Record] | None:
        """Return number and copy of the newest intact record, the same until another; else None."""
        found = self._found
        if found is not None and found[0] == self._number.max():
            return found
        for slot in [*np.argsort(self._number)[::-1]] * _TRIES:
            number, checksum = int(self._number[slot]), int(self._checksum[slot])
            record = self._record[slot].copy()
            if number and crc32(record.tobytes(), number & _WORD) == checksum:
                self._found = number, record
                break
        return self._found


_WORD = 0xFFFFFFFF  # of CRC-32


def _slot(kind: np.dtype[np.void]) -> np.dtype[np.void]:
    return np.dtype([("number", np.uint64), ("crc", np.uint32), ("record", kind)], align=True)
