"""`CountedArray`: an array that tells every operation done with it to a counter."""

from collections.abc import Iterator
from fractions import Fraction
from typing import Any, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Shaped
from numpy.lib.mixins import NDArrayOperatorsMixin

from benchmarks.flops import costs
from poise.errors import ConfigurationError


@runtime_checkable
class Tally(Protocol):
    """What an array needs of its counter."""

    def add(self, operation: str, cost: Fraction | int) -> None:
        """Counts an operation."""
        ...

    def wrap(self, result: Any) -> Any:
        """The result, counted where it is a floating point array or number."""
        ...


class CountedArray(NDArrayOperatorsMixin):
    """An array whose operations a `FlopCounter` counts; made by `FlopCounter.array`.

    Args:
        value: the plain array, shared.
        counter: which counts.

    Attributes:
        value: the plain array, for use outside of what is counted.
    """

    def __init__(self, value: Shaped[np.ndarray, "..."], counter: Tally) -> None:
        self.value = value
        self._counter = counter

    # Checks of shapes and kinds ask `isinstance(x, np.ndarray)`; the code under count has them.
    @property
    def __class__(self) -> type:  # pyright: ignore[reportIncompatibleMethodOverride]
        return np.ndarray

    def __array__(self, dtype: object = None, copy: object = None) -> Any:
        raise ConfigurationError(
            "a counted array would become a plain one, and what is done with it uncounted",
            got=self.value.shape,
            wanted="an operation that is counted, or `.value` where it shall not count",
        )

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **named: Any) -> Any:
        # In `S += x` the plain S becomes the counted result; any other plain `out` would leak.
        if any(type(o) is np.ndarray and o is not inputs[0] for o in named.get("out", ())):
            raise _leak(ufunc.__name__)
        values = plain(inputs)
        result = getattr(ufunc, method)(*values, **plain(named))
        if isinstance(result, np.ndarray | np.floating) and result.dtype.kind == "f":
            self._counter.add(ufunc.__name__, _ufunc_cost(ufunc, method, values, result))
        return self._counter.wrap(result)

    def __array_function__(
        self, function: Any, _types: Any, arguments: tuple[Any, ...], named: dict[str, Any]
    ) -> Any:
        if function not in costs.FREE and function not in costs.NUMPY:
            raise unknown(getattr(function, "__name__", str(function)))
        if type(named.get("out")) is np.ndarray:
            raise _leak(function.__name__)
        if "ord" in named:
            raise unknown("norm with `ord` by name")
        values = plain(arguments)
        result = function(*values, **plain(named))
        if function in costs.NUMPY:
            self._counter.add(function.__name__, costs.NUMPY[function](values, result))
        return self._counter.wrap(result)

    def __getattr__(self, name: str) -> Any:
        """Attributes that only describe or rearrange the array; others do not exist here."""
        if name in _DESCRIBING:
            return getattr(self.value, name)
        if name == "T":
            return self._counter.wrap(self.value.T)
        if name == "flat":
            return _CountedFlat(self.value.flat, self._counter)
        if name in _REARRANGING:
            method = getattr(self.value, name)
            return lambda *a, **k: self._counter.wrap(method(*plain(a), **plain(k)))
        raise AttributeError(
            f"a counted array has no {name!r}; use `.value` where it shall not count"
        )

    def dot(self, other: Any) -> Any:
        """Product, as `np.dot`."""
        return np.dot(self, other)  # pyright: ignore[reportArgumentType, reportCallIssue]

    def sum(self, axis: Any = None) -> Any:
        """Sum of entries, as `np.sum`."""
        return np.sum(self, axis=axis)  # pyright: ignore[reportArgumentType, reportCallIssue]

    def __getitem__(self, index: Any) -> Any:
        return self._counter.wrap(self.value[plain(index)])

    def __setitem__(self, index: Any, values: Any) -> None:
        self.value[plain(index)] = plain(values)

    def __len__(self) -> int:
        return len(self.value)

    def __iter__(self) -> Iterator[Any]:
        return (self._counter.wrap(part) for part in self.value)

    def __float__(self) -> float:
        return float(self.value)

    def __bool__(self) -> bool:
        return bool(self.value)

    def __repr__(self) -> str:
        return f"counted {self.value!r}"


_DESCRIBING = {"shape", "size", "ndim", "dtype", "flags", "strides", "nbytes", "tolist"}
_REARRANGING = {"copy", "reshape", "ravel", "flatten", "transpose", "max", "min", "any", "all"}


class _CountedFlat:
    """The entries of a counted array in a row, to read and to write."""

    def __init__(self, entries: Any, counter: Tally) -> None:
        self._entries, self._counter = entries, counter

    def __getitem__(self, index: Any) -> Any:
        return self._counter.wrap(self._entries[index])

    def __setitem__(self, index: Any, values: Any) -> None:
        self._entries[index] = plain(values)


def _ufunc_cost(ufunc: Any, method: str, inputs: tuple[Any, ...], result: Any) -> int:
    if ufunc in costs.FREE_ENTRYWISE:
        return 0
    if ufunc in (np.matmul, np.vecdot) and method == "__call__":
        return costs.matrix_product(inputs, result)
    if ufunc in costs.ENTRYWISE:
        if method in ("__call__", "outer"):
            return np.size(result)
        if method == "reduce":
            return costs.total(inputs, result)
    raise unknown(f"{ufunc.__name__}, {method}")


def plain(value: Any) -> Any:
    """The value with plain arrays in place of counted ones."""
    if type(value) is CountedArray:
        return value.value
    if isinstance(value, tuple | list):
        kind = type(value)
        return kind(plain(part) for part in value)
    if isinstance(value, dict):
        return {key: plain(part) for key, part in value.items()}
    return value


def has_counted(value: Any) -> bool:
    """Whether there is a counted array in a value, or in a tuple, list or dictionary."""
    if isinstance(value, tuple | list):
        return any(has_counted(part) for part in value)
    if isinstance(value, dict):
        return any(has_counted(part) for part in value.values())
    return type(value) is CountedArray


def unknown(name: str) -> ConfigurationError:
    """The error for an operation that has no known cost."""
    return ConfigurationError(
        "an operation on counted arrays has no known cost",
        got=name,
        wanted="an entry for it in `poise.flops.costs`",
    )


def _leak(name: str) -> ConfigurationError:
    return ConfigurationError(
        "a counted result would be written into a plain array",
        got=name,
        wanted="a counted array for `out`",
    )
