"""Signals kept in memory while a run goes on."""

import numpy as np
from jaxtyping import Float64

from poise.errors import TargetError

_FIRST_CAPACITY = 1024


class Signal:
    """Samples of one quantity over time, in an array that doubles when full.

    Args:
        name: the signal's name.
        shape: shape of one sample.
    """

    def __init__(self, name: str, shape: tuple[int, ...]) -> None:
        self.name = name
        self.shape = shape
        self._times = np.empty(_FIRST_CAPACITY)
        self._values = np.empty((_FIRST_CAPACITY, *shape))
        self._size = 0

    def __len__(self) -> int:
        return self._size

    def append(self, time: float, value: float | Float64[np.ndarray, "..."]) -> None:
        """Keep one sample, copied.

        Raises:
            TargetError: the sample has another shape than the first one had.
        """
        if np.shape(value) != self.shape:
            raise TargetError(
                f"signal {self.name!r} changed its shape",
                got=np.shape(value),
                wanted=str(self.shape),
            )
        if self._size == len(self._times):
            self._times = np.concatenate([self._times, np.empty_like(self._times)])
            self._values = np.concatenate([self._values, np.empty_like(self._values)])
        self._times[self._size] = time
        self._values[self._size] = value
        self._size += 1

    @property
    def times(self) -> Float64[np.ndarray, " n"]:
        """Times of the samples [s]."""
        return self._times[: self._size].copy()

    @property
    def values(self) -> Float64[np.ndarray, "n ..."]:
        """The samples, time first."""
        return self._values[: self._size].copy()
