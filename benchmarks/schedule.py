"""`take_turns`: quick methods tick by tick in turn, slow ones in between on some of the ticks."""

import gc
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Int64

from benchmarks.clocked import collector_paused


@runtime_checkable
class Timed(Protocol):
    """What takes turns."""

    def tick(self, index: int) -> None:
        """Times one tick."""
        ...

    def skip(self, index: int) -> None:
        """Leaves one tick out."""
        ...


@dataclass(frozen=True, kw_only=True)
class Turns:
    """Who is timed when.

    In every batch of ticks the quick methods take turns tick by tick, the order reversed from one
    tick to the next, so that each follows itself as often as another. Then the slow ones do the
    first few ticks of the batch. Whoever begins finds the caches as somebody else left them, and a
    slow one a state far from its last: the first tick of a batch does not count, nor does the
    first batch.

    Attributes:
        ticks: of the recording.
        batch: ticks in a batch.
        slow: ticks of a batch that slow methods do, the uncounted first one not included.
    """

    ticks: int
    batch: int = 50
    slow: int = 5

    def starts(self) -> range:
        """The first tick of each batch."""
        return range(0, self.ticks, self.batch)

    def quick_counted(self) -> Int64[np.ndarray, " n"]:
        """Ticks that count for quick methods."""
        every = np.arange(self.batch, self.ticks, dtype=np.int64)
        return every[every % self.batch != 0]

    def slow_counted(self) -> Int64[np.ndarray, " n"]:
        """Ticks that count for slow methods."""
        every = self.quick_counted()
        return every[every % self.batch <= self.slow]


def take_turns(quick: Sequence[Timed], slow: Sequence[Timed], turns: Turns) -> Generator[int]:
    """Times everything, the garbage collector waiting between batches.

    Args:
        quick: timed on every tick.
        slow: timed on some.
        turns: who is timed when.

    Yields:
        The number of ticks done, a batch at a time.
    """
    with collector_paused():
        for first in turns.starts():
            last = min(first + turns.batch, turns.ticks)
            for index in range(first, last):
                for one in quick if index % 2 else quick[::-1]:
                    one.tick(index)
            timed = min(first + turns.slow + 1, last)
            for index in range(first, timed):
                for one in slow if index % 2 else slow[::-1]:
                    one.tick(index)
            for index in range(timed, last):
                for one in slow:
                    one.skip(index)
            gc.collect()
            yield last
