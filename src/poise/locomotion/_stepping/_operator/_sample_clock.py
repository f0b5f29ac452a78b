"""`SampleClock`: age and order of samples. `Engagement`: when a part leads."""

import math

# Period of the slowest device that is followed without gaps [s]: hands move at 5 Hz at most,
# and ten samples a second are the fewest that show it
SLOWEST = 0.1
SILENT_AFTER = SLOWEST  # without a new sample for longer a velocity is unknown [s]
# Without a good sample for longer a device is lost [s]: a link that drops every fourth sample
# drops five in a row once in a thousand
LOST_AFTER = 5 * SLOWEST
LATE = LOST_AFTER  # a sample that is later than the soonest by this counts as lost [s]
_DRIFT = 1e-3  # part of the time by which two clocks drift apart: ten times what quartz does


class SampleClock:
    """Accept samples that are newer than the newest and no later than a link makes them."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Accept any clock from now on."""
        self.newest = self.heard_at = -math.inf
        self._soonest = math.inf

    def accepts(self, stamp: float, time: float) -> bool:
        """Return whether a sample counts, which makes it the newest."""
        # Otherwise a frozen source would be heard for ever.
        if not math.isfinite(stamp) or stamp == self.newest:
            return False
        soonest = time - stamp
        if not self.is_lost(time) and self.newest > -math.inf:
            if not 0.0 < stamp - self.newest <= time - self.heard_at + LATE:
                return False
            soonest = min(soonest, self._soonest + _DRIFT * (time - self.heard_at))
        if time - stamp - soonest > LATE:
            return False
        self.newest, self.heard_at, self._soonest = stamp, time, soonest
        return True

    def lateness(self, stamp: float, time: float) -> float:
        """Return by how much later than the soonest a sample comes [s]."""
        return time - stamp - self._soonest

    def is_lost(self, time: float) -> bool:
        """Return whether nothing was heard for too long."""
        return abs(time - self.heard_at) > LOST_AFTER


class Engagement:
    """When a part leads: from when its clutch closes, which has to be seen, until it opens."""

    def __init__(self) -> None:
        self.engaged = self._released = False
        self._good_at = -math.inf

    def expire(self, time: float) -> bool:
        """Disengage a lost part; return whether it was engaged until now."""
        if abs(time - self._good_at) <= LOST_AFTER:
            return False
        engaged = self.engaged
        self.engaged = self._released = False
        return engaged

    def lose(self) -> None:
        """Disengage until the part is seen released and then closed."""
        self.engaged = self._released = False

    def release(self, time: float) -> None:
        """Note an open clutch, at a time of the robot [s]."""
        self.engaged, self._released, self._good_at = False, True, time

    def engage(self) -> bool:
        """Note a closed clutch; return whether the part begins to lead now."""
        begins = self._released and not self.engaged
        self.engaged, self._released = self.engaged or begins, False
        return begins

    def refresh(self, time: float) -> None:
        """Note a good sample, at a time of the robot [s]."""
        self._good_at = time
