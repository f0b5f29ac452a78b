"""What is seen of compiling, which happens once on a machine and takes some twenty seconds."""

import logging
import sys
from time import perf_counter
from typing import Any

from numba.core import event

EVENT = "numba:compile"
"""Numba's, about each function that it compiles."""

_TYPED = 0.6
"""Part of the time until all functions are read and typed; the rest makes machine code of them."""

_WIDTH = 24
"""Of the bar [characters]."""


class FirstUse(event.Listener):
    """Says what is compiled and how far that is, and for how long it took.

    Where somebody looks on there is a bar, elsewhere a line in the log before and one after.
    """

    def __init__(self, function: Any, what: str, kept: str | None) -> None:
        self._function, self._what, self._kept = function, what, kept
        self._total, self._done = len(functions_of(function)), 0
        self._begin: float | None = None

    def watch(self) -> None:
        """Begins to listen to Numba, until the function is compiled."""
        event.register(EVENT, self)

    def on_start(self, event: Any) -> None:
        """Numba begins to compile a function."""
        if event.data["dispatcher"] is not self._function:
            return
        self._begin = perf_counter()
        if not sys.stderr.isatty():
            logging.getLogger("poise").warning(
                "compiling %s, once on this machine: %d functions, half a minute or less",
                self._what,
                self._total,
            )

    def on_end(self, event: Any) -> None:
        """Numba has compiled a function."""
        if self._begin is None:
            return
        self._done += 1
        draw_bar(self._what, self._share(), perf_counter() - self._begin)
        if event.data["dispatcher"] is self._function:
            self._finish(perf_counter() - self._begin)

    def _share(self) -> float:
        return _TYPED * min(self._done / self._total, 1.0)

    def _finish(self, spent: float) -> None:
        event.unregister(EVENT, self)
        clear_bar()
        where = f"kept in {self._kept}" if self._kept else "not kept: no folder can be written"
        logging.getLogger("poise").warning("compiled %s in %.0f s, %s", self._what, spent, where)


def draw_bar(what: str, share: float, spent: float) -> None:
    """Show the progress of compiling on a terminal."""
    if not sys.stderr.isatty():
        return
    bar = "#" * round(_WIDTH * share)
    left = spent * (1.0 - share) / share
    sys.stderr.write(
        f"\rcompiling {what}, once on this machine "
        f"[{bar:.<{_WIDTH}}] {100 * share:3.0f}% {left:3.0f} s left"
    )
    sys.stderr.flush()


def clear_bar() -> None:
    """Takes the bar away."""
    if sys.stderr.isatty():
        sys.stderr.write("\r\033[K")
        sys.stderr.flush()


def functions_of(function: Any) -> list[Any]:
    """A compiled function and all that it calls, each once."""
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
