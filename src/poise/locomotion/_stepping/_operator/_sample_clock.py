"""`SampleClock`: age and order of samples, by a sender's clock that nobody has set."""

import math

from poise.locomotion._stepping._operator._limits import DRIFT, LATE, LOST_AFTER


class SampleClock:
    """Accept samples that are newer than the newest and no later than a link makes them.

    A sample's delay is compared with the smallest one. What grows by less than `DRIFT` is taken for
    two clocks that drift apart. After a silence of `LOST_AFTER` any clock is accepted anew.

    Attributes:
        heard_at: receiver's time of the newest sample [s].
        newest: sender's time of it [s].
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Accept any clock from now on."""
        self.newest = self.heard_at = -math.inf
        self._soonest = math.inf

    def accepts(self, stamp: float, time: float) -> bool:
        """Return whether a sample counts, which makes it the newest.

        Args:
            stamp: its time on the sender's clock [s].
            time: of the receiver [s].
        """
        # The newest again is no news, however long nothing else has come: a source that is frozen
        # would be heard for ever.
        if not math.isfinite(stamp) or stamp == self.newest:
            return False
        soonest = time - stamp
        if not self.is_lost(time):
            if not 0.0 < stamp - self.newest <= time - self.heard_at + LATE:
                return False
            soonest = min(soonest, self._soonest + DRIFT * (time - self.heard_at))
        if time - stamp - soonest > LATE:
            return False
        self.newest, self.heard_at, self._soonest = stamp, time, soonest
        return True

    def lateness(self, stamp: float, time: float) -> float:
        """Return by how much later than the soonest a sample comes [s]."""
        return time - stamp - self._soonest

    def is_lost(self, time: float) -> bool:
        """Return whether nothing was heard for too long, or the receiver's clock went back as far.

        Args:
            time: of the receiver [s].
        """
        return abs(time - self.heard_at) > LOST_AFTER
