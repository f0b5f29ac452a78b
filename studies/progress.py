"""`Steps`: the progress of a part that consists of several runs."""

from collections.abc import Callable

from studies.plan import Progress


class Steps:
    """Counts runs, and shares of the run at hand.

    Args:
        progress: of the whole part.
        count: how many runs there are.
    """

    def __init__(self, progress: Progress, count: int) -> None:
        self._progress, self._count, self._done = progress, count, -1

    def next(self) -> Callable[[float], None]:
        """Begins the next run; what comes back is told the share of it that is done."""
        self._done += 1
        done = self._done
        self._progress(float(done), float(self._count))
        return lambda share: self._progress(done + share, float(self._count))

    def finish(self) -> None:
        """Says that all is done."""
        self._progress(float(self._count), float(self._count))
