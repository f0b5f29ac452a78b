"""`compiled`: turns a function of arrays and numbers into machine code."""

import inspect
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar, cast

import numba

P = ParamSpec("P")
R = TypeVar("R")

_FAST = {"reassoc", "contract", "nsz", "arcp"}
"""Freedoms that let sums run in vector registers; NaN and infinity keep their meaning."""


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compiles a function at its first call, and keeps the machine code on disk for later runs.

    Compiled functions may call each other; the code kept for one is made anew when its own file
    changes, but not when that of another one it calls does.

    Args:
        function: of arrays and numbers, in the part of Python that Numba compiles.
    """
    # Tests wrap functions in checks of their annotations, which cannot be compiled.
    plain = inspect.unwrap(function)
    njit = cast("Any", numba).njit
    try:
        return njit(cache=True, fastmath=_FAST, error_model="numpy")(plain)
    except RuntimeError:
        # No folder to keep it in, as for a package that lies in an archive.
        return njit(fastmath=_FAST, error_model="numpy")(plain)
