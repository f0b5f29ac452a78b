"""`Bar`: progress on stderr, on terminals, in notebooks and in logs."""

import sys
from time import monotonic

PATIENCE = 1.0
"""Time without a bar: short work needs none [s]."""

LINE_EVERY = 5.0
"""Time between lines in a log, where there can be no bar [s]."""


class Bar:
    """A callable `(done, total)` that draws a bar, or writes lines to a file or a pipe.

    Args:
        what: description of the work.
        unit: unit of the numbers.
        lines: write lines where there can be no bar.
    """

    def __init__(self, what: str, unit: str, *, lines: bool = True) -> None:
        self._what, self._unit, self._shows_lines = what, unit, lines
        self._begin: float | None = None
        self._lines, self._drawn = 0, False

    def __call__(self, done: float, total: float) -> None:
        """Show the progress."""
        now = monotonic()
        if self._begin is None:
            self._begin, self._first = now, done
        elapsed, share = now - self._begin, done / total if total > 0.0 else None
        rate = (done - self._first) / elapsed if elapsed > 0.0 else 0.0
        left = f", {(total - done) / rate:.0f} s left" if rate > 0.0 else ""
        if sys.stderr.isatty() or "ipykernel" in sys.modules:
            if elapsed >= PATIENCE:
                bar = "#" * round(24 * (share or 0.0))
                self._write(f"\r{self._what} {share or 0.0:4.0%} [{bar:.<24}]{left}\033[K")
                self._drawn = True
        elif self._shows_lines and elapsed >= LINE_EVERY * (self._lines + 1) and done < total:
            self._lines = int(elapsed / LINE_EVERY)
            part = "?" if share is None else f"{share:.0%}"
            amount = f"{done:.5g} of {total:.5g}{self._unit}"
            self._write(f"{self._what}: {amount} ({part}){left}\n")

    def _write(self, text: str) -> None:
        sys.stderr.write(text)
        sys.stderr.flush()

    def __enter__(self) -> "Bar":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Remove the bar."""
        if self._drawn:
            self._write("\r\033[K")
