"""`compiled` and `part`: turn functions of arrays and numbers into machine code."""

import hashlib
import inspect
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import FunctionType
from typing import Any, ParamSpec, TypeVar, cast

import numba

from poise._compiled._ahead import is_told
from poise._compiled._first_use import FirstUse
from poise._compiled._kept_code import KeptCode
from poise._compiled._libraries import (
    PartCompiler,
    WholeCompiler,
    compile_once_for_all_numbers,
)

P = ParamSpec("P")
R = TypeVar("R")

_OPTIONS = {
    # Freedoms that let sums run in vector registers; NaN and infinity keep their meaning.
    "fastmath": {"reassoc", "contract", "nsz", "arcp"},
    "error_model": "numpy",
    "no_cfunc_wrapper": True,
    # Nobody counts the owners of arrays.
    "_nrt": False,
}
"""For all; so none may make an array, nor return one that it did not get."""


_DISABLED = bool(cast("Any", numba).config.DISABLE_JIT)
"""Numba's own switch, NUMBA_DISABLE_JIT: everything runs as plain Python."""

_COMPILER = b"".join(
    (Path(__file__).parent / f"{name}.py").read_bytes()
    for name in ("_blocks", "_compiling", "_libraries")
)
"""What else machine code depends on."""


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compiles a function at its first call, and keeps the machine code on disk for later runs.

    Compiled functions may call each other. The code that was kept is made anew when the file of a
    function changes, or that of any compiled function or a number that its file imports. Where it
    cannot be kept, every process makes its own.
    """
    return _whole(function, {})


def compiled_for_threads(function: Callable[P, R]) -> Callable[P, R]:
    """The same for a function that works long: Python's other threads run meanwhile.

    Where others wait to run, whoever calls it may have to wait for them when it ends: so it is
    nothing for a control loop.
    """
    return _whole(function, {"nogil": True})


def _whole(function: Callable[P, R], options: dict[str, bool]) -> Callable[P, R]:
    # Tests wrap functions in checks of their annotations, which cannot be compiled.
    plain = cast("FunctionType", inspect.unwrap(function))
    if _DISABLED:
        return cast("Callable[P, R]", plain)
    all_options: dict[str, Any] = _OPTIONS | options
    dispatcher = cast("Any", numba).njit(pipeline_class=WholeCompiler, **all_options)(plain)
    dispatcher.stamp = _stamp(plain)
    # Without a folder to keep it in, as for a package that lies in an archive, it is not kept.
    with suppress(RuntimeError):
        dispatcher._cache = KeptCode(plain, dispatcher.stamp)
    return dispatcher


def part(function: Callable[P, R]) -> Callable[P, R]:
    """Compiles a function that nobody but compiled functions calls.

    It becomes machine code only as a part of them. Calling it from Python ends the process.
    """
    plain = cast("FunctionType", inspect.unwrap(function))
    if _DISABLED:
        return cast("Callable[P, R]", plain)
    dispatcher = cast("Any", numba).njit(
        pipeline_class=PartCompiler, no_cpython_wrapper=True, **_OPTIONS
    )(plain)
    dispatcher.stamp = _stamp(plain)
    compile_once_for_all_numbers(dispatcher)
    return dispatcher


def say_if_slow(function: Callable[..., object], what: str) -> None:
    """Lets what is to be seen of compiling be seen, unless the machine code is there already."""
    dispatcher = cast("Any", function)
    if _DISABLED or dispatcher.signatures or is_told():
        return
    kept = dispatcher._cache if isinstance(dispatcher._cache, KeptCode) else None
    if kept is None or not kept.has_code(dispatcher.targetctx):
        FirstUse(dispatcher, what, None if kept is None else kept.cache_path).watch()


def _stamp(plain: FunctionType) -> str:
    """Names the source that a function is compiled from, callees in other files included."""
    file = plain.__code__.co_filename
    digest = _digest_of(file, Path(file).stat().st_mtime_ns).copy()
    for name, value in sorted(plain.__globals__.items()):
        # Functions and blocks have a stamp of their own.
        known = value if isinstance(value, int | float | tuple) else getattr(value, "stamp", None)
        # A named tuple is handed over by the order of its fields.
        known = getattr(value, "_fields", known) if known is None else known
        if isinstance(known, int | float | str | tuple):
            digest.update(f"{name}={known!r};".encode())
    return digest.hexdigest()


@cache
def _digest_of(file: str, changed: int) -> Any:
    """Of a source and of the compiler; a file is read once, however many functions it holds."""
    del changed  # A file that was edited meanwhile is read again.
    return hashlib.sha256(_COMPILER + Path(file).read_bytes())
