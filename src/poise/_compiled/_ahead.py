"""Compiling ahead: what has to be compiled, each function told as it is, and whether it is kept."""

import os
import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import Any, cast

import numba
from numba.core import event

from poise._compiled._first_use import EVENT, functions_of
from poise._compiled._kept_code import KeptCode
from poise.errors import ConfigurationError

_WANTED = "a folder that can be written and has room; NUMBA_CACHE_DIR names another"


_TOLD: set["_Teller"] = set()
"""Who is told at present."""


class _Teller(event.Listener):
    """Tells of every function that this process compiles."""

    def __init__(self, note: Callable[[str], None]) -> None:
        self._note = note

    def on_start(self, event: Any) -> None:
        """Numba begins to compile a function."""

    def on_end(self, event: Any) -> None:
        """Numba has compiled a function."""
        self._note(_name(event.data["dispatcher"]))


@contextmanager
def compiling_told(note: Callable[[str], None]) -> Generator[None]:
    """Within, tells of each function that is compiled, and shows nothing else of it."""
    teller = _Teller(note)
    event.register(EVENT, teller)
    _TOLD.add(teller)
    try:
        yield
    finally:
        _TOLD.discard(teller)
        event.unregister(EVENT, teller)


def is_told() -> bool:
    """Whether somebody is told already, so that nothing else need be shown."""
    return bool(_TOLD)


def find_unkept(skipped: tuple[str, ...] = ()) -> list[Any]:
    """Functions of the imported modules that Python calls and no file has machine code of."""
    return [
        function
        for function in _functions()
        if not function.py_func.__module__.startswith(skipped)
        and not function._cache.has_code(function.targetctx)
    ]


def names_of(functions: list[Any]) -> set[str]:
    """Names of functions and of all that they call, as `compiling_told` tells them."""
    return {_name(one) for function in functions for one in functions_of(function)}


def code_folder() -> str:
    """The folder below which machine code is kept."""
    asked = str(cast("Any", numba).config.CACHE_DIR)
    paths = [function._cache.cache_path for function in _functions()]
    if not paths or (asked and not os.path.abspath(paths[0]).startswith(os.path.abspath(asked))):
        raise ConfigurationError(
            "compiled code cannot be kept", got=asked or "no such folder", wanted=_WANTED
        )
    return os.path.commonpath(paths)


def check_kept(compiled: set[str]) -> None:
    """Sees whether functions that were compiled are kept."""
    left = [name for one in find_unkept() if (name := _name(one)) in compiled]
    if left:
        raise ConfigurationError(
            f"compiled code is not kept, such as that of {left[0]}",
            got=code_folder(),
            wanted=_WANTED,
        )


def _functions() -> list[Any]:
    """All functions of Poise's imported modules whose code can be kept, each once."""
    found: dict[Any, None] = {}
    for name, module in list(sys.modules.items()):
        if name.split(".")[0] == "poise":
            for value in vars(module).values():
                if isinstance(getattr(value, "_cache", None), KeptCode):
                    found[value] = None
    return list(found)


def _name(function: Any) -> str:
    return f"{function.py_func.__module__}.{function.py_func.__qualname__}"


def usable_cores() -> int:
    """Cores that this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
