"""Compilation reported: at the first use on a machine, and to callers that compile ahead."""

import logging
import os
import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from time import process_time
from typing import Any, cast

import numba
from numba.core import event as events

from poise._compiled._kept_code import KeptCode
from poise._progress import Bar
from poise.errors import ConfigurationError

_EVENT = "numba:compile"
"""Numba's event about each function that it compiles."""

_SECONDS = 0.13
"""Processor time of a function, the mean over those of the first controller at 3 GHz [s]."""

_TYPED = 0.6
"""Part of the time until all functions are read and typed; the rest makes machine code of them."""

_WANTED = "a folder that can be written and has room; NUMBA_CACHE_DIR names another"

_notes = list[Callable[[str], None]]()
"""Callbacks of the `report_compiled` contexts that are open."""


class _FirstUse(events.Listener):
    """Progress of one function: a bar on a terminal, else a log line before and one after."""

    def __init__(self, function: Any, what: str, kept: str | None) -> None:
        self._function, self._what, self._kept = function, what, kept
        self._total, self._done = len(functions_of(function)), 0
        self._begin: float | None = None
        self._bar = Bar(f"compiling {what}, once on this machine", " functions", lines=False)

    def on_start(self, event: Any) -> None:
        """Begin with the function itself, whose callees compile within."""
        if event.data["dispatcher"] is not self._function:
            return
        self._begin = process_time()
        if not sys.stderr.isatty():
            logging.getLogger("poise").warning(
                "compiling %s, once on this machine: %d functions, some %.0f s of processor time",
                self._what,
                self._total,
                _SECONDS * self._total,
            )

    def on_end(self, event: Any) -> None:
        """Count a function; end with the function itself."""
        if self._begin is None:
            return
        self._done += 1
        self._bar(_TYPED * min(self._done, self._total), float(self._total))
        if event.data["dispatcher"] is self._function:
            events.unregister(_EVENT, self)
            self._bar.close()
            spent = process_time() - self._begin
            kept = f"kept in {self._kept}" if self._kept else "not kept: no folder can be written"
            logging.getLogger("poise").warning("compiled %s in %.0f s, %s", self._what, spent, kept)


class _Noted(events.Listener):
    """Report of each function that is compiled."""

    def __init__(self, note: Callable[[str], None]) -> None:
        self._note = note

    def on_start(self, event: Any) -> None:
        """Wait for the end."""

    def on_end(self, event: Any) -> None:
        """Report the function's name."""
        self._note(_name(event.data["dispatcher"]))


def say_if_slow(function: Callable[..., object], what: str) -> None:
    """Show the compilation of a function at its next call, unless its machine code is kept."""
    dispatcher = cast("Any", function)
    # With NUMBA_DISABLE_JIT it is a plain function.
    if _notes or not hasattr(dispatcher, "signatures") or dispatcher.signatures:
        return
    kept = dispatcher._cache if isinstance(dispatcher._cache, KeptCode) else None
    if kept is None or not kept.has_code(dispatcher.targetctx):
        events.register(_EVENT, _FirstUse(dispatcher, what, kept and kept.cache_path))


@contextmanager
def report_compiled(note: Callable[[str], None]) -> Generator[None]:
    """Call `note` with the name of each function compiled within; nothing else is shown."""
    _notes.append(note)
    try:
        with events.install_listener(_EVENT, _Noted(note)):
            yield
    finally:
        _notes.remove(note)


def functions_of(function: Any) -> list[Any]:
    """List a compiled function and all that it calls, each once."""
    found: dict[Any, None] = {}
    left = [function]
    while left:
        function = left.pop()
        if function not in found:
            found[function] = None
            plain = function.py_func
            callees = [plain.__globals__.get(name) for name in plain.__code__.co_names]
            left += [callee for callee in callees if hasattr(callee, "py_func")]
    return list(found)


def find_unkept(skipped: tuple[str, ...] = ()) -> list[Any]:
    """List the compiled functions of imported modules of which no machine code is on disk."""
    return [
        function
        for function in _keepable()
        if not function.py_func.__module__.startswith(skipped)
        and not function._cache.has_code(function.targetctx)
    ]


def names_of(functions: list[Any]) -> set[str]:
    """Names of functions and of all that they call, as `report_compiled` reports them."""
    return {_name(one) for function in functions for one in functions_of(function)}


def count_kept() -> tuple[int, int, int]:
    """Count functions with machine code on disk, all, and files of other versions of them."""
    caches = [function._cache for function in _keepable()]
    read = set[Path]().union(*(cache.files() for cache in caches))
    # Another Python's files lie beside them.
    name = f"*.py{sys.version_info.major}{sys.version_info.minor}*.nb[ic]"
    found = {file for place in {c.cache_path for c in caches} for file in Path(place).glob(name)}
    return len(caches) - len(find_unkept()), len(caches), len(found - read)


def code_folder() -> str:
    """Return the folder below which machine code is kept."""
    asked = str(cast("Any", numba).config.CACHE_DIR)
    paths = [function._cache.cache_path for function in _keepable()]
    if not paths or (asked and not os.path.abspath(paths[0]).startswith(os.path.abspath(asked))):
        raise ConfigurationError(
            "compiled code cannot be kept", got=asked or "no such folder", wanted=_WANTED
        )
    return os.path.commonpath(paths)


def check_kept(compiled: set[str]) -> None:
    """Raise where functions that were compiled are not on disk."""
    left = [name for one in find_unkept() if (name := _name(one)) in compiled]
    if left:
        raise ConfigurationError(
            f"compiled code is not kept, such as that of {left[0]}",
            got=code_folder(),
            wanted=_WANTED,
        )


def usable_cores() -> int:
    """Count the cores that this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _keepable() -> list[Any]:
    """All compiled functions of Poise's imported modules whose code can be kept, each once."""
    found: dict[Any, None] = {}
    for name, module in list(sys.modules.items()):
        if name.split(".")[0] == "poise":
            for value in vars(module).values():
                if isinstance(getattr(value, "_cache", None), KeptCode):
                    found[value] = None
    return list(found)


def _name(function: Any) -> str:
    return f"{function.py_func.__module__}.{function.py_func.__qualname__}"
