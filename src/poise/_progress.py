"""`Bar`: progress on stderr, on terminals, in notebooks and in logs."""

import sys
from time import monotonic
from typing import Any

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
        self._bar: Any = None
        self._begin: float | None = None
        self._lines = 0

    def __call__(self, done: float, total: float) -> None:
        """Show the progress."""
        if sys.stderr.isatty() or _in_notebook():
            self._draw(done, total)
        elif self._shows_lines:
            self._write(done, total)

    def _draw(self, done: float, total: float) -> None:
        if self._bar is None:
            from tqdm import tqdm

            self._bar = tqdm(
                total=total,
                initial=done,
                desc=self._what,
                delay=PATIENCE,
                leave=False,
                bar_format="{desc} {percentage:3.0f}% |{bar}| {n:.1f}/{total:.1f}"
                + self._unit
                + " [{rate_noinv_fmt}, {remaining} left]",
                unit=self._unit,
            )
        self._bar.update(done - self._bar.n)

    def _write(self, done: float, total: float) -> None:
        now = monotonic()
        if self._begin is None:
            self._begin, self._first = now, done
        elapsed = now - self._begin
        if elapsed < LINE_EVERY * (self._lines + 1) or done >= total:
            return
        self._lines = int(elapsed / LINE_EVERY)
        rate = (done - self._first) / elapsed
        left = f", {(total - done) / rate:.0f} s left" if rate > 0.0 else ""
        share = f"{100.0 * done / total:.0f}%" if total > 0.0 else "?"
        print(
            f"{self._what}: {done:.1f} of {total:.1f}{self._unit} ({share}){left}",
            file=sys.stderr,
            flush=True,
        )

    def __enter__(self) -> "Bar":
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.close()


def _in_notebook() -> bool:
    """True in a notebook's kernel, whose output can be replaced."""
    return "ipykernel" in sys.modules
