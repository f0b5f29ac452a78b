"""`compiled` and `part`: decorators that turn functions of arrays and numbers into machine code."""

import hashlib
import inspect
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import FunctionType
from typing import Any, ParamSpec, TypeVar, cast

import numba

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
    # Owners of arrays are not counted.
    "_nrt": False,
}
"""For all functions; none of them may make an array."""

_DISABLED = bool(cast("Any", numba).config.DISABLE_JIT)
"""Everything runs as plain Python with NUMBA_DISABLE_JIT."""

_COMPILER = b"".join(
    (Path(__file__).parent / f"{name}.py").read_bytes()
    for name in ("_blocks", "_compiling", "_libraries")
)
"""Sources on which all machine code depends."""


def compiled(function: Callable[P, R], *, nogil: bool = False) -> Callable[P, R]:
    """Compile a function at its first call, and keep the machine code on disk for later runs.

    Compiled functions may call each other. Kept code is made anew when the file of a function
    changes, or that of any compiled function or a number that its file imports. Where it cannot be
    kept, every process makes its own.
    """
    # Tests wrap functions in checks of their annotations, which cannot be compiled.
    plain = cast("FunctionType", inspect.unwrap(function))
    if _DISABLED:
        return cast("Callable[P, R]", plain)
    options: dict[str, Any] = _OPTIONS | {"nogil": nogil}
    dispatcher = cast("Any", numba).njit(pipeline_class=WholeCompiler, **options)(plain)
    dispatcher.stamp = _stamp(plain)
    # Without a folder to keep it in, as for a package that lies in an archive, it is not kept.
    with suppress(RuntimeError):
        dispatcher._cache = KeptCode(plain, dispatcher.stamp)
    return dispatcher


def compiled_for_threads(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a long function that lets Python's other threads run.

    At its end it may have to wait for them, so it is not for a control loop.
    """
    return compiled(function, nogil=True)


def part(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function as a part of the compiled functions that call it.

    Calling it from Python ends the process.
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


def _stamp(plain: FunctionType) -> str:
    """Digest of the source that a function is compiled from, callees in other files included."""
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
    """Digest of a source and of the compiler."""
    del changed  # A file that was edited meanwhile is read again.
    return hashlib.sha256(_COMPILER + Path(file).read_bytes())
