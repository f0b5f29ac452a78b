"""`LoadRamp`: how much of its load a contact may carry, over time."""


class LoadRamp:
    """A number between zero and one that moves linearly to a goal.

    The ramp starts at the first `advance` after `start`, so that whoever starts it needs no clock.
    """

    def __init__(self) -> None:
        self._load = 1.0
        self._goal = 1.0
        self._duration = 0.0
        self._from = 1.0
        self._since: float | None = None
        self._moving = False

    @property
    def active(self) -> bool:
        """Whether any load may be carried now, or will be at the end of the ramp."""
        return self._load > 0.0 or self._goal > 0.0

    def start(self, goal: float, duration: float) -> None:
        """Moves to a goal over a duration [s], from wherever the load is now."""
        self._goal = goal
        self._duration = duration
        self._from = self._load
        self._since = None
        self._moving = True

    def advance(self, time: float) -> float:
        """The load at a time [s]."""
        if self._moving:
            if self._since is None:
                self._since = time
            elapsed = time - self._since
            done = self._duration <= 0.0 or elapsed >= self._duration
            share = 1.0 if done else max(elapsed, 0.0) / self._duration
            self._load = self._from + share * (self._goal - self._from)
            self._moving = not done
        return self._load
