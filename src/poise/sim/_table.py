"""`Table`: rows of signals that are sampled together, of which a `RunRecord` is made.

`Signal`: one of them. `Rows`: some of the rows.
"""

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float64, Int64

from poise.errors import TargetError

Value = float | int | np.generic | np.ndarray
"""A sample of a signal: a number, or an array of numbers."""

Names = tuple[str, ...]
"""Signals that are sampled together, in the order in which they are given."""

_BLOCK_ROWS = 1024
"""Rows that are allocated at once."""


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

    @property
    def size(self) -> int:
        """How many numbers a sample has."""
        return math.prod(self.shape)


class Rows(NamedTuple):
    """Samples of signals that were taken together, a row an instant.

    Attributes:
        signals: what was sampled.
        order: how many rows of the whole record came before each.
        times: of the instants [s].
        columns: the samples of each signal, time first.
    """

    signals: tuple[Signal, ...]
    order: Int64[np.ndarray, " n"]
    times: Float64[np.ndarray, " n"]
    columns: list[np.ndarray]

    def between(self, first: int, end: int) -> "Rows":
        """Some of the rows, as views."""
        rows = slice(first, end)
        columns = [column[rows] for column in self.columns]
        return Rows(self.signals, self.order[rows], self.times[rows], columns)


class Table:
    """Rows of signals that are sampled together, in blocks that stay where they are.

    A table that grows by a block copies nothing, so no tick of a long run waits for that, and what
    was given out as a view stays as it is.

    Args:
        signals: that make a row.
    """

    def __init__(self, signals: tuple[Signal, ...]) -> None:
        self.signals = signals
        self._shapes = [signal.shape for signal in signals]
        # Full ones, with how many rows came before each.
        self._blocks: list[tuple[Rows, int]] = []
        self._before = 0
        self._begin()

    def __len__(self) -> int:
        return self._before + self._size

    def append(self, order: int, time: float, values: Iterable[Value]) -> None:
        """Keeps one row, copied.

        Raises:
            TargetError: a sample has another shape than the first one had.
        """
        if self._size == _BLOCK_ROWS:
            self._close()
        row, block = self._size, self._open
        for column, shape, value in zip(block.columns, self._shapes, values, strict=True):
            # Plain numbers, which have no shape, are by far the fastest this way.
            if getattr(value, "shape", ()) != shape:
                self._refuse(values)
            column[row] = value
        block.order[row], block.times[row] = order, time
        self._size = row + 1

    def extend(self, rows: Rows) -> None:
        """Keeps further rows as they are, not copied."""
        self._close()
        self._blocks.append((rows, self._before))
        self._before += len(rows.times)

    def clear(self) -> None:
        """Drops all rows; what `since` gave stays."""
        self._blocks, self._before = [], 0
        self._begin()

    def since(self, first: int) -> list[Rows]:
        """Rows from an index on, as views that later rows leave alone."""
        blocks = [*self._blocks, (self._open.between(0, self._size), self._before)]
        parts = [rows.between(max(first - before, 0), len(rows.times)) for rows, before in blocks]
        return [part for part in parts if len(part.times)]

    def last_time(self) -> float:
        """Time of the last row [s]; minus infinity where there is none."""
        parts = self.since(len(self) - 1) if len(self) else []
        return float(parts[-1].times[-1]) if parts else -math.inf

    def _begin(self) -> None:
        columns = [np.empty((_BLOCK_ROWS, *s.shape), dtype=s.dtype) for s in self.signals]
        order = np.empty(_BLOCK_ROWS, dtype=np.int64)
        self._open, self._size = Rows(self.signals, order, np.empty(_BLOCK_ROWS), columns), 0

    def _close(self) -> None:
        if self._size:
            self._blocks.append((self._open.between(0, self._size), self._before))
            self._before += self._size
            self._begin()

    def _refuse(self, values: Iterable[Value]) -> None:
        for signal, value in zip(self.signals, values, strict=True):
            if np.shape(value) != signal.shape:
                raise TargetError(
                    f"signal {signal.name!r} changed its shape",
                    got=np.shape(value),
                    wanted=str(signal.shape),
                )
