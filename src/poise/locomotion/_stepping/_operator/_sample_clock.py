"""`SampleClock`: which samples are news. `Lateness`: how late a link makes them."""

import math

_DRIFT = 1e-3
"""By how much of the time two clocks may drift apart."""


class Lateness:
    """How much later than the soonest messages come, by stamps of a clock that nobody has set.

    What grows by less than a thousandth of the time is taken for two clocks that drift apart. Where
    the receiver's own time is slowed down or stopped nothing comes late.
    """

    def __init__(self) -> None:
        self._soonest, self._at = math.inf, 0.0

    def restart(self) -> None:
        """Whatever comes next is on time."""
        self._soonest = math.inf

    def of(self, stamp: float, time: float) -> float:
        """Takes what has come, and says how late it is [s].

        Args:
            stamp: when it was sent, on the sender's clock [s].
            time: of the receiver, which does not go back but for `restart` [s].
        """
        drift, self._at = _DRIFT * (time - self._at), time
        self._soonest = min(self._soonest + drift, time - stamp)
        return time - stamp - self._soonest


class SampleClock:
    """Says which samples are newer than the newest, and no more late than a link makes them.

    Args:
        late: largest difference of two samples' delays [s].
        lost_after: after so long without a sample any clock is believed again [s].

    Attributes:
        heard_at: when the newest came, in the robot's time [s].
    """

    def __init__(self, late: float, lost_after: float) -> None:
        self._late, self._lost_after = late, lost_after
        self._lateness = Lateness()
        self._newest = -math.inf
        self.heard_at = -math.inf

    def is_newest(self, stamp: float) -> bool:
        """Whether a sample is the newest, once more.

        Args:
            stamp: its time, on the operator's clock [s].
        """
        return stamp == self._newest

    def takes(self, stamp: float, time: float) -> bool:
        """Whether a sample counts; then it is the newest.

        Args:
            stamp: its time, on the operator's clock [s].
            time: of the robot [s].
        """
        # The newest again is no news, however long nothing else has come: a source that is frozen
        # would be heard for ever.
        if not math.isfinite(stamp) or self.is_newest(stamp):
            return False
        if self.is_lost(time):
            self._lateness.restart()
        elif not 0.0 < stamp - self._newest <= time - self.heard_at + self._late:
            return False
        if self._lateness.of(stamp, time) > self._late:
            return False
        self._newest, self.heard_at = stamp, time
        return True

    def is_lost(self, time: float) -> bool:
        """Whether nothing was heard for too long, or the robot's clock has gone back as far.

        Args:
            time: of the robot [s].
        """
        return abs(time - self.heard_at) > self._lost_after
