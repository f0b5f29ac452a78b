"""`FlopCounter`: counts the floating point operations that array code really does.

The code runs as it is, on arrays that count:

    counter = FlopCounter()
    J, M = counter.array(J), counter.array(M)
    with counter.solvers_of(module):      # only where the code calls scipy.linalg or its lapack
        code(J, M)
    counter.total                         # [FLOP], exact
    counter.by_operation                  # the same by kind: "matmul", "add", "dpotrf", ...

Honesty comes first: an operation without a known cost, and a counted array about to become a plain
one whose further use nobody would count, raise an error. What cannot be seen are numbers that the
code makes plain on purpose, by `float(x)` or `x.tolist()`, and arithmetic on arrays that were never
wrapped: wrap every array that goes in.

What each array operation costs [FLOP], by the conventions of (Park, Jin, Kang 2022).

Each of the four arithmetic operations on two floating point numbers is one, as in the paper's
section III.F; so is a square root and any other elementary function. What only moves, compares or
changes signs is free. Products are counted in full, also where the result is symmetric or an
operand has zeros in it, because that is what the code does.

    product of (a x b) and (b x c)                       a c (2 b - 1)
    sum, difference, product of entries                  1 an entry of the result
    sum of n entries                                     n - 1
    inverse of m x m                                     m^3 / 3        as Table 1 has it
    Cholesky factor of m x m                             m^3 / 3        leading term
    inverse of a triangle of m x m                       m^3 / 3        leading term
    inverse of m x m from its Cholesky factor            2 m^3 / 3      leading term
    substitution with a triangle of m x m                m^2 a right-hand side
    solution with a general m x m                        2 m^3 / 3 + 2 m^2 a right-hand side
    QR factors of m x n (m >= n), as reflectors          2 n^2 (m - n / 3)
    k reflectors of length m on c columns                4 m k c - 2 k^2 c
    eigenvalues and vectors of a symmetric m x m         9 m^3          Golub and Van Loan
    singular values of m x n (m >= n)                    4 m n^2 - 4 n^3 / 3

An explicit inverse really takes about m^3 from a symmetric matrix and 2 m^3 from another; it is
counted as the paper counts it, in favour of code that uses one.
"""

from collections import Counter
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from fractions import Fraction
from types import ModuleType
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.lib.mixins import NDArrayOperatorsMixin
from scipy import linalg
from scipy.linalg import lapack

from poise.errors import ConfigurationError

Cost = Callable[[tuple[Any, ...], Any], Fraction | int]
"""Cost of a call, from its positional arguments and its result, all of them plain arrays."""

_linalg: Any = linalg
_lapack: Any = lapack

ENTRYWISE = {
    np.add, np.subtract, np.multiply, np.divide, np.sqrt, np.square, np.reciprocal, np.power,
    np.float_power, np.sin, np.cos, np.tan, np.arcsin, np.arccos, np.arctan, np.arctan2, np.exp,
    np.log, np.hypot,
}  # fmt: skip
"""Universal functions that cost one an entry of the result."""

FREE_ENTRYWISE = {
    np.negative, np.positive, np.absolute, np.fabs, np.sign, np.copysign, np.maximum, np.minimum,
    np.greater, np.greater_equal, np.less, np.less_equal, np.equal, np.not_equal, np.isfinite,
    np.isnan, np.isinf, np.logical_and, np.logical_or, np.logical_not, np.floor, np.ceil,
    np.conjugate,
}  # fmt: skip
"""Universal functions that compare, choose or change signs."""

FREE = {
    np.transpose, np.reshape, np.ravel, np.squeeze, np.expand_dims, np.concatenate, np.stack,
    np.vstack, np.hstack, np.copy, np.zeros_like, np.ones_like, np.empty_like, np.full_like,
    np.diag, np.diagonal, np.where, np.broadcast_to, np.shape, np.ndim, np.size, np.max, np.min,
    np.argmax, np.argmin, np.argsort, np.sort, np.all, np.any, np.clip, np.swapaxes, np.tril,
    np.triu, np.atleast_2d, np.flatnonzero, np.count_nonzero,
}  # fmt: skip
"""Functions that move or compare entries."""


def _matrix_product(arguments: tuple[Any, ...], result: Any) -> int:
    """Product of matrices or vectors, also of stacks of them: 2 b - 1 an entry of the result."""
    return _dot_length(np.shape(arguments[0])[-1:]) * np.size(result)


def _total(arguments: tuple[Any, ...], result: Any) -> int:
    """Sum of entries, as a whole or along an axis."""
    return np.size(arguments[0]) - np.size(result)


def _norm(arguments: tuple[Any, ...], _result: Any) -> Fraction | int:
    a, order = arguments[0], arguments[1] if len(arguments) > 1 else None
    if order == 2 and np.ndim(a) == 2:
        large, small = sorted(np.shape(a), reverse=True)
        return 4 * large * small**2 - Fraction(4 * small**3, 3)
    # Squares, their sums, and a root each.
    return 2 * np.size(a)


def _dot_length(shape: tuple[int, ...]) -> int:
    return max(2 * shape[0] - 1, 0) if shape else 1


def _factor(thirds: int, substitutions: int = 0, *, of_pair: bool = False) -> Cost:
    """So many thirds of m^3, and substitutions of m^2 a right-hand side.

    Args:
        thirds: of m^3.
        substitutions: a right-hand side, which is the second argument.
        of_pair: whether the first argument is a factor with a flag behind it.
    """

    def cost(arguments: tuple[Any, ...], _result: Any) -> Fraction:
        m = len(arguments[0][0] if of_pair else arguments[0])
        sides = 0
        if substitutions:
            shape = np.shape(arguments[1])
            sides = 1 if len(shape) == 1 else shape[1]
        return Fraction(thirds * m**3, 3) + substitutions * m**2 * sides

    return cost


def _qr(arguments: tuple[Any, ...], _result: Any) -> Fraction:
    large, small = sorted(np.shape(arguments[0]), reverse=True)
    return 2 * small**2 * (large - Fraction(small, 3))


def _reflectors(arguments: tuple[Any, ...], _result: Any) -> int:
    side, _, factor, _, c = arguments[:5]
    m, k = np.shape(factor)
    others = np.shape(c)[1 if side == "L" else 0]
    return 4 * m * k * others - 2 * k**2 * others


NUMPY: dict[Any, Cost] = {
    np.dot: _matrix_product,
    np.inner: _matrix_product,
    np.vdot: lambda arguments, _result: _dot_length((np.size(arguments[0]),)),
    np.outer: lambda _arguments, result: np.size(result),
    np.sum: _total,
    np.trace: lambda arguments, _result: min(np.shape(arguments[0])) - 1,
    np.cross: lambda _arguments, result: 3 * np.size(result),
    np.linalg.norm: _norm,
    np.linalg.inv: _factor(1),
    np.linalg.cholesky: _factor(1),
    np.linalg.solve: _factor(2, 2),
    np.linalg.eigh: _factor(27),
}
"""Functions of NumPy that cost something."""

SCIPY: dict[Any, Cost] = {
    _linalg.inv: _factor(1),
    _linalg.cholesky: _factor(1),
    _linalg.cho_factor: _factor(1),
    _linalg.cho_solve: _factor(0, 2, of_pair=True),
    _linalg.solve_triangular: _factor(0, 1),
    _linalg.solve: _factor(2, 2),
    _linalg.eigh: _factor(27),
}
"""Functions of `scipy.linalg`."""

LAPACK: dict[str, Cost] = {
    "dpotrf": _factor(1),
    "dpotri": _factor(2),
    "dtrtri": _factor(1),
    "dpotrs": _factor(0, 2),
    "dtrtrs": _factor(0, 1),
    "dposv": _factor(1, 2),
    "dgeqrf": _qr,
    "dormqr": _reflectors,
}
"""Routines of `scipy.linalg.lapack`, by name."""


class CountedArray(NDArrayOperatorsMixin):
    """An array whose operations a `FlopCounter` counts; made by `FlopCounter.array`.

    Args:
        value: the plain array, shared.
        counter: which counts.

    Attributes:
        value: the plain array, for use outside of what is counted.
    """

    def __init__(self, value: Shaped[np.ndarray, "..."], counter: "FlopCounter") -> None:
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
        if function not in FREE and function not in NUMPY:
            raise unknown(getattr(function, "__name__", str(function)))
        if type(named.get("out")) is np.ndarray:
            raise _leak(function.__name__)
        if "ord" in named:
            raise unknown("norm with `ord` by name")
        values = plain(arguments)
        result = function(*values, **plain(named))
        if function in NUMPY:
            self._counter.add(function.__name__, NUMPY[function](values, result))
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

    def __init__(self, entries: Any, counter: "FlopCounter") -> None:
        self._entries, self._counter = entries, counter

    def __getitem__(self, index: Any) -> Any:
        return self._counter.wrap(self._entries[index])

    def __setitem__(self, index: Any, values: Any) -> None:
        self._entries[index] = plain(values)


def _ufunc_cost(ufunc: Any, method: str, inputs: tuple[Any, ...], result: Any) -> int:
    if ufunc in FREE_ENTRYWISE:
        return 0
    if ufunc in (np.matmul, np.vecdot) and method == "__call__":
        return _matrix_product(inputs, result)
    if ufunc in ENTRYWISE:
        if method in ("__call__", "outer"):
            return np.size(result)
        if method == "reduce":
            return _total(inputs, result)
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
        wanted="an entry for it in `benchmarks.flops`",
    )


def _leak(name: str) -> ConfigurationError:
    return ConfigurationError(
        "a counted result would be written into a plain array",
        got=name,
        wanted="a counted array for `out`",
    )


_SOLVERS = (linalg, lapack)


class FlopCounter:
    """Counts operations on the arrays that it made.

    Attributes:
        by_operation: operations so far [FLOP], by kind.
    """

    def __init__(self) -> None:
        self.by_operation: Counter[str] = Counter()

    @property
    def total(self) -> Fraction:
        """All operations so far [FLOP]."""
        return Fraction(sum(self.by_operation.values()))

    def reset(self) -> None:
        """Starts again at zero; arrays stay counted."""
        self.by_operation.clear()

    def add(self, operation: str, cost: Fraction | int) -> None:
        """Counts an operation that the arrays cannot see.

        Args:
            operation: its kind.
            cost: [FLOP].
        """
        if cost:
            self.by_operation[operation] += cost  # pyright: ignore[reportArgumentType]

    def array(self, values: Shaped[np.ndarray, "..."] | float) -> Any:
        """The same array, counted; it stands for the plain one in all that code does with arrays.

        Args:
            values: a plain array, shared and not copied, or a number.

        Returns:
            The counted array.
        """
        return CountedArray(np.asarray(values), self)

    @contextmanager
    def solvers_of(self, *modules: ModuleType) -> Generator[None]:
        """Within, these modules' functions of `scipy.linalg` and `lapack` take counted arrays.

        NumPy asks an array how to treat it, SciPy does not: so the names that the modules have
        imported are exchanged for counting ones, and put back in the end.

        Args:
            modules: which import `scipy.linalg`, its `lapack` or functions of the former.
        """
        exchanged: list[tuple[ModuleType, str, Any]] = []
        try:
            for module in modules:
                for name, value in list(vars(module).items()):
                    counting = self._substitute(value)
                    if counting is not None:
                        exchanged.append((module, name, value))
                        setattr(module, name, counting)
            yield
        finally:
            for module, name, value in exchanged:
                setattr(module, name, value)

    def _substitute(self, value: Any) -> Any:
        if any(value is solver for solver in _SOLVERS):
            return _CountingModule(value, self)
        home = getattr(value, "__module__", None) or ""
        if callable(value) and home.startswith("scipy.linalg"):
            return self.counting(value.__name__, value, SCIPY.get(value))
        return None

    def counting(
        self, name: str, function: Callable[..., Any], cost: Cost | None
    ) -> Callable[..., Any]:
        """A function that counts where it gets counted arrays.

        Args:
            name: what it counts as.
            function: which takes plain arrays.
            cost: from the positional arguments; None where it is not known.
        """

        def on_arrays(*arguments: Any, **named: Any) -> Any:
            if not has_counted((arguments, named)):
                return function(*arguments, **named)
            if cost is None:
                raise unknown(name)
            values = plain(arguments)
            # Before the call, which may overwrite its arguments; no rule for solvers needs results.
            self.add(name, cost(values, None))
            return self.wrap(function(*values, **plain(named)))

        return on_arrays

    def wrap(self, result: Any) -> Any:
        """Floating point arrays and numbers of a result, counted; the rest as it is.

        Args:
            result: an array, a number, or a tuple of such.
        """
        if isinstance(result, tuple):
            parts = [self.wrap(part) for part in result]
            # NumPy's decompositions come as tuples with names.
            return type(result)(*parts) if hasattr(result, "_fields") else tuple(parts)
        if isinstance(result, np.ndarray | np.floating) and result.dtype.kind == "f":
            return CountedArray(np.asarray(result), self)
        return result


class _CountingModule:
    """`scipy.linalg` or its `lapack`, whose routines take counted arrays."""

    def __init__(self, module: ModuleType, counter: FlopCounter) -> None:
        self._module, self._counter = module, counter

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._module, name)
        if any(value is solver for solver in _SOLVERS):
            return _CountingModule(value, self._counter)
        if not callable(value):
            return value
        rule = LAPACK.get(name) if self._module is lapack else SCIPY.get(value)
        return self._counter.counting(name, value, rule)
