"""`Bisection`: find the point of [0, 1] above which a predicate fails."""

from dataclasses import dataclass


@dataclass
class Bisection:
    """Finds a level that held with one just above it that did not.

    Without a guess all looks but the last are at middles of the room between the hardest level
    that held and the easiest that did not. The last is at an end where all were alike: at 1 if
    nothing has failed, at 0 if nothing has held.

    With the edge that another search has found as a guess, the first looks are at its two sides:
    an edge that is the same is confirmed by two looks. Where it is not, the steps away from it
    double until they are beyond the edge or at an end, and the room is halved until it is as
    narrow as the other search left it.

    Where a property is not monotone there is a level that held with one that failed just above it
    either way, and nothing more is claimed.
    """

    looks: int  # how many there are without a guess; they leave a room of 1 / 2^looks
    guess: "Bisection | None" = None  # a search that is done before this one begins
    held: float | None = None  # hardest level that held
    failed: float | None = None  # easiest level above it that did not
    done: int = 0  # looks there have been

    @property
    def level(self) -> float | None:
        """The level of the next look; None when all looks are done."""
        return self._by_middles() if self.guess is None else self._by_guess(self.guess)

    @property
    def expected(self) -> int:
        """Number of looks in the end, as far as is known now."""
        if self.level is None:
            return self.done
        return max(self.done + 1, self.looks if self.guess is None else 2)

    def tell(self, held: bool) -> None:
        """Take the outcome of the look at `level`."""
        level = self.level
        if level is not None:
            self.done += 1
            if held:
                self.held = level
            else:
                self.failed = level

    def _by_middles(self) -> float | None:
        last = self.done == self.looks - 1
        if self.done >= self.looks:
            return None
        if last and self.failed is None:
            return 1.0
        if last and self.held is None:
            return 0.0
        return 0.5 * ((self.held or 0.0) + (1.0 if self.failed is None else self.failed))

    def _by_guess(self, guess: "Bisection") -> float | None:
        below = guess.held or 0.0
        above = below if guess.failed is None else guess.failed
        room = max(above - below, 0.5**self.looks)
        step = room * 2.0 ** (self.done - 1)
        if self.done == 0:
            return below
        if self.failed is None:
            return None if self.held == 1.0 else min(1.0, below + step)
        if self.held is None:
            return None if self.failed == 0.0 else max(0.0, below - step)
        middle = 0.5 * (self.held + self.failed)
        return None if self.failed - self.held <= 1.001 * room else middle
