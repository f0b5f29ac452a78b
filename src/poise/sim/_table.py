"""`Table`: rows of signals that are sampled together, of which a `RunRecord` is made."""

import math
import struct
from collections.abc import Callable
from itertools import accumulate, groupby
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

from poise.errors import TargetError

# A sample of a signal: a number, or an array of numbers
Value = float | int | np.generic | np.ndarray
Names = tuple[str, ...]  # Signals that are sampled together, in the order in which they are given

# Kinds of number by their NumPy name: their format in `struct`, and their type in ROS 1
NUMBERS = {
    "f8": ("d", "float64"), "f4": ("f", "float32"), "b1": ("?", "bool"),
    "i1": ("b", "int8"), "i2": ("h", "int16"), "i4": ("i", "int32"), "i8": ("q", "int64"),
    "u1": ("B", "uint8"), "u2": ("H", "uint16"), "u4": ("I", "uint32"), "u8": ("Q", "uint64"),
}  # fmt: skip

# Begin of a row: the number of rows of the whole record before it, and its time [s]
_HEAD = struct.Struct("<qd")

_dtype: Callable[[Value], np.dtype[Any]] = attrgetter("dtype")


class Signal(NamedTuple):
    """One quantity over time."""

    name: str  # the signal's name
    unit: str  # of its numbers, "" for a pure number or a flag
    dtype: np.dtype[Any]  # kind of number of its samples
    shape: tuple[int, ...]  # of a sample

    @property
    def size(self) -> int:
        """Bytes of a sample."""
        return self.dtype.itemsize * math.prod(self.shape)

    @property
    def format(self) -> str:
        """Format of a sample in `struct`, "" for an array and for what that does not know."""
        return "" if self.shape else NUMBERS.get(self.dtype.str[1:], ("",))[0]


class Table:
    """Rows of signals that are sampled together, each packed as a log holds it."""

    def __init__(self, signals: tuple[Signal, ...]) -> None:
        self.signals, self.rows = signals, list[bytes]()
        *begins, self._size = accumulate((s.size for s in signals), initial=_HEAD.size)
        self.places = {
            s.name: slice(begin, begin + s.size) for s, begin in zip(signals, begins, strict=True)
        }
        self._runs: list[tuple[slice, Callable[..., bytes] | None]] = []
        end = 0
        for packed, found in groupby(["q", "d", *(s.format for s in signals)], bool):
            formats = [*found]
            pack = struct.Struct("<" + "".join(formats)).pack if packed else None
            self._runs.append((slice(end, end := end + len(formats)), pack))
        arrays = [s for s in signals if not s.format]
        self._dtypes = [s.dtype for s in arrays]
        self._lengths = [s.shape[0] if s.shape else 1 for s in arrays]
        self._matrices = [(k, s.shape) for k, s in enumerate(signals, 2) if len(s.shape) > 1]

    def append(self, row: tuple[Value, ...]) -> None:
        """Append one row, copied: order, time, and the samples."""
        pieces: list[Any] = []
        arrays: list[Any] = []
        packed = b""
        try:
            for run, pack in self._runs:
                if pack is None:
                    pieces += row[run]
                    arrays += row[run]
                else:
                    pieces.append(pack(*row[run]))
            packed = b"".join(pieces)
            # Lengths and the sum of all sizes leave an array of one dimension no other shape.
            same = (
                len(packed) == self._size
                and [*map(len, arrays)] == self._lengths
                and [*map(_dtype, arrays)] == self._dtypes
            )
            for k, shape in self._matrices:
                same = same and np.shape(row[k]) == shape
        except (TypeError, ValueError, AttributeError, OverflowError, BufferError, struct.error):
            same = False
        self.rows.append(packed if same else self._converted(row))

    def extend(self, rows: list[bytes]) -> None:
        """Append packed rows."""
        numbers = not any(s.dtype.hasobject for s in self.signals)
        if not (numbers and {self._size}.issuperset(map(len, rows))):
            raise ValueError("rows that are not of the signals")
        self.rows += rows

    def _converted(self, row: tuple[Value, ...]) -> bytes:
        """A row of other kinds of number than the first."""
        pieces = [_HEAD.pack(*row[:2])]
        for signal, value in zip(self.signals, row[2:], strict=True):
            if (shape := np.shape(value)) != signal.shape:
                what = f"signal {signal.name!r} changed its shape"
                raise TargetError(what, got=shape, wanted=str(signal.shape))
            pieces.append(np.asarray(value, signal.dtype).tobytes())
        return b"".join(pieces)


def time_of(row: bytes) -> float:
    """Time of a packed row [s]."""
    return _HEAD.unpack_from(row)[1]
