"""`Bisection`: where on [0, 1] something ceases to hold, in a fixed number of looks."""

from dataclasses import dataclass


@dataclass
class Bisection:
    """Halves the room between the hardest level that held and the easiest that did not.

    All looks but the last are at middles. The last is at an end where all were alike: at 1 if
    nothing has failed, at 0 if nothing has held. What is looked for need not be monotone: there is
    a level that held with one that failed just above it either way, and nothing more is claimed.

    Attributes:
        looks: how many there are in all.
        held: hardest level that held; None for none.
        failed: easiest level above it that did not; None for none.
        done: how many looks there have been.
    """

    looks: int
    held: float | None = None
    failed: float | None = None
    done: int = 0

    @property
    def level(self) -> float | None:
        """Where to look next; None when all looks are done."""
        if self.done >= self.looks:
            return None
        if self.done == self.looks - 1:
            if self.failed is None:
                return 1.0
            if self.held is None:
                return 0.0
        low = 0.0 if self.held is None else self.held
        high = 1.0 if self.failed is None else self.failed
        return 0.5 * (low + high)

    def tell(self, held: bool) -> None:
        """Says what was seen at `level`."""
        level = self.level
        if level is None:
            return
        if held:
            self.held = level
        else:
            self.failed = level
        self.done += 1
