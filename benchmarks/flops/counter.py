"""`FlopCounter`: counts the floating point operations that array code really does.

The code runs as it is, on arrays that count:

    counter = FlopCounter()
    J, M = counter.array(J), counter.array(M)
    with counter.solvers_of(module):      # only where the code calls scipy.linalg or its lapack
        code(J, M)
    counter.total                         # [FLOP], exact
    counter.by_operation                  # the same by kind: "matmul", "add", "dpotrf", ...

What an operation costs stands in `costs`. Honesty comes first: an operation without a known
cost, and a counted array about to become a plain one whose further use nobody would count, raise
an error. What cannot be seen are numbers that the code makes plain on purpose, by `float(x)` or
`x.tolist()`, and arithmetic on arrays that were never wrapped: wrap every array that goes in.
"""

from collections import Counter
from collections.abc import Callable, Generator
from contextlib import contextmanager
from fractions import Fraction
from types import ModuleType
from typing import Any

import numpy as np
from jaxtyping import Shaped
from scipy import linalg
from scipy.linalg import lapack

from benchmarks.flops import costs
from benchmarks.flops.counted_array import CountedArray, has_counted, plain, unknown

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
            return self.counting(value.__name__, value, costs.SCIPY.get(value))
        return None

    def counting(
        self, name: str, function: Callable[..., Any], cost: costs.Cost | None
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
        rule = costs.LAPACK.get(name) if self._module is lapack else costs.SCIPY.get(value)
        return self._counter.counting(name, value, rule)
