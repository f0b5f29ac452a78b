"""`Table`: rows of signals that are sampled together, of which a `RunRecord` is made."""

from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np

from poise.errors import TargetError

Value = float | int | np.generic | np.ndarray
"""A sample of a signal: a number, or an array of numbers."""

Names = tuple[str, ...]
"""Signals that are sampled together, in the order in which they are given."""

_BLOCK_ROWS = 1024
"""Rows that are allocated at a time."""


class Signal(NamedTuple):
    """One quantity over time.

    Attributes:
        name: the signal's name.
        unit: of its numbers, "" for a pure number or a flag.
        dtype: kind of number of its samples.
        shape: of a sample.
    """

    name: str
    unit: str
    dtype: np.dtype[Any]
    shape: tuple[int, ...]


class Table:
    """Rows of signals that are sampled together, in blocks that stay where they are.

    A row is packed as a log holds it: the number of rows of the whole record before it, its
    time [s], and a field a signal, named by its place. A table that grows by a block copies
    nothing, and views of its rows stay as they are.

    Args:
        signals: that make a row.
    """

    def __init__(self, signals: tuple[Signal, ...]) -> None:
        self.signals = signals
        fields = [(str(i), s.dtype, s.shape) for i, s in enumerate(signals)]
        self.layout = np.dtype([("order", "<i8"), ("time", "<f8"), *fields])
        shapes = [(place, s.shape) for place, s in enumerate(signals, start=2)]
        # A getter of one place returns no tuple: the first is taken twice.
        places = [place for place, shape in shapes if shape]
        self._arrays = itemgetter(*places[:1], *places) if places else lambda _: ()
        self._lengths = [shapes[place - 2][1][0] for place in (*places[:1], *places)]
        self._matrices = [(place, shape) for place, shape in shapes if len(shape) > 1]
        self.clear()

    def __len__(self) -> int:
        return self._before + self._size

    def append(self, row: tuple[Value, ...]) -> None:
        """Append a copy of one row: order, time, and the samples.

        Raises:
            TargetError: a sample has another shape than the first one had.
        """
        if self._size == len(self._open):
            self._close()
            self._open = np.empty(_BLOCK_ROWS, self.layout)
        try:
            # NumPy refuses other shapes unless it can broadcast them.
            if [*map(len, self._arrays(row))] != self._lengths:
                self._refuse(row)
            for place, shape in self._matrices:
                if np.shape(row[place]) != shape:
                    self._refuse(row)
            self._open[self._size] = row
        except (TypeError, ValueError):
            self._refuse(row)
            raise
        self._size += 1

    def extend(self, rows: np.ndarray) -> None:
        """Append rows, not copied."""
        self._close()
        self._blocks.append(rows)
        self._before += len(rows)

    def clear(self) -> None:
        """Drop all rows; views of them stay."""
        self._blocks, self._before = list[np.ndarray](), 0
        self._open, self._size = np.empty(0, self.layout), 0

    def since(self, first: int) -> list[np.ndarray]:
        """Rows from an index on, as views that later rows leave alone."""
        parts, before = list[np.ndarray](), 0
        for block in (*self._blocks, self._open[: self._size]):
            if len(block) and before + len(block) > first:
                parts.append(block[max(first - before, 0) :])
            before += len(block)
        return parts

    def _close(self) -> None:
        if self._size:
            self._blocks.append(self._open[: self._size])
            self._before += self._size
        self._open, self._size = np.empty(0, self.layout), 0

    def _refuse(self, row: tuple[Value, ...]) -> None:
        for signal, value in zip(self.signals, row[2:], strict=True):
            if np.shape(value) != signal.shape:
                raise TargetError(
                    f"signal {signal.name!r} changed its shape",
                    got=np.shape(value),
                    wanted=str(signal.shape),
                )
