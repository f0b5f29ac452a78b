"""`compiled` and `part`: turn functions of arrays and numbers into machine code."""

import hashlib
import inspect
import logging
from collections.abc import Callable
from pathlib import Path
from types import FunctionType
from typing import Any, ParamSpec, TypeVar, cast

import numba

from poise._compiled._libraries import PartCompiler, WholeCompiler

P = ParamSpec("P")
R = TypeVar("R")

_FAST = {"reassoc", "contract", "nsz", "arcp"}
"""Freedoms that let sums run in vector registers; NaN and infinity keep their meaning."""


_DISABLED = bool(cast("Any", numba).config.DISABLE_JIT)
"""Numba's own switch, NUMBA_DISABLE_JIT: everything runs as plain Python."""


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compiles a function at its first call, and keeps the machine code on disk for later runs.

    Compiled functions may call each other. The code that was kept is made anew when the file of a
    function changes, or that of any compiled function or a number that its file imports.

    Args:
        function: of arrays and numbers, in the part of Python that Numba compiles.
    """
    # Tests wrap functions in checks of their annotations, which cannot be compiled.
    plain = cast("FunctionType", inspect.unwrap(function))
    if _DISABLED:
        return cast("Callable[P, R]", plain)
    njit = cast("Any", numba).njit
    try:
        dispatcher = njit(
            cache=True,
            pipeline_class=WholeCompiler,
            fastmath=_FAST,
            error_model="numpy",
            no_cfunc_wrapper=True,
        )(plain)
    except RuntimeError:
        # No folder to keep it in, as for a package that lies in an archive.
        return njit(fastmath=_FAST, error_model="numpy")(plain)
    dispatcher.stamp = _stamp(plain)
    # Numba looks at the function's own file only, and would go on with what its callees once were.
    dispatcher._cache._cache_file._source_stamp = dispatcher.stamp
    return dispatcher


def part(function: Callable[P, R]) -> Callable[P, R]:
    """Compiles a function that nobody but compiled functions calls.

    It has no way in from Python and no file of its own, which is a third of the work where it takes
    many arrays. Calling it from Python ends the process.

    Args:
        function: as for `compiled`.
    """
    plain = cast("FunctionType", inspect.unwrap(function))
    if _DISABLED:
        return cast("Callable[P, R]", plain)
    dispatcher = cast("Any", numba).njit(
        fastmath=_FAST,
        error_model="numpy",
        no_cpython_wrapper=True,
        no_cfunc_wrapper=True,
        pipeline_class=PartCompiler,
        _nrt=False,
    )(plain)
    dispatcher.stamp = _stamp(plain)
    return dispatcher


def say_if_slow(function: Callable[..., object], what: str) -> None:
    """Logs that something is about to be compiled, unless its machine code is there already.

    Args:
        function: a compiled function, about to be called for the first time.
        what: what it belongs to.
    """
    dispatcher = cast("Any", function)
    if _DISABLED:
        return
    if not dispatcher.signatures and not dispatcher._cache._cache_file._load_index():
        # A warning is what Python shows where nobody has set logging up.
        logging.getLogger("poise").warning("compiling %s, once: this may take a minute", what)


def _stamp(plain: FunctionType) -> str:
    """Names the source that a function is compiled from, callees in other files included."""
    digest = hashlib.sha256(Path(plain.__code__.co_filename).read_bytes())
    for name, value in sorted(plain.__globals__.items()):
        known = value if isinstance(value, int | float | tuple) else getattr(value, "stamp", None)
        # A named tuple is handed over by the order of its fields.
        known = getattr(value, "_fields", known)
        if isinstance(known, int | float | str | tuple):
            digest.update(f"{name}={known!r};".encode())
    return digest.hexdigest()
