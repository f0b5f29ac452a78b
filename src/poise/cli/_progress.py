"""A progress bar on stderr, for anything that takes more than two seconds."""

import sys
from typing import Any

PATIENCE = 1.0
"""Nothing is shown before this [s]: short work needs no bar."""


class Bar:
    """A callable `(done, total)` that draws a bar where somebody can see it.

    Args:
        what: what is being done.
        unit: unit of the numbers.
    """

    def __init__(self, what: str, unit: str) -> None:
        self._what, self._unit = what, unit
        self._bar: Any = None

    def __call__(self, done: float, total: float) -> None:
        """Says how far the work is."""
        if not sys.stderr.isatty():
            return
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

    def __enter__(self) -> "Bar":
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.close()
