"""`DeviceSample` and `DeviceGuard`: what the operator's hands say, and whether to believe it."""

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np
from jaxtyping import Float64

from poise.checks import checked_number


@dataclass(frozen=True, slots=True, eq=False)
class DeviceSample:
    """Where the operator holds the two devices; each commands the sole of its side.

    Attributes:
        time: when it was measured, on the operator's clock [s].
        left: position commanded for the left sole, in the controller's world [m].
        right: likewise for the right sole.
        upright: button: bring the torso upright although one foot is in the air.
    """

    time: float
    left: Float64[np.ndarray, "3"]
    right: Float64[np.ndarray, "3"]
    upright: bool = False

    def hand(self, foot: int) -> Float64[np.ndarray, "3"]:
        """Position commanded for a sole: 0 left, 1 right [m]."""
        return self.left if foot == 0 else self.right


class DeviceStatus(Enum):
    """What became of the last sample."""

    OK = "ok"
    STALE = "no new sample: the last one holds"
    REFUSED = "the last sample was refused: the one before holds"
    LOST = "the device stopped sending: the feet go back to the ground"


class DeviceGuard:
    """Lets no sample through that could move a foot wildly.

    A sample is refused that is not finite, that is older than the one before, or that jumps; where
    jumps go on for as long as `lost_after`, the device has really moved there, and the sample is
    taken. Without a good sample for `lost_after` the device counts as lost until one comes.

    Args:
        jump_max: largest distance of a device from one sample to the next [m].
        lost_after: [s].

    Raises:
        ConfigurationError: a number that is not positive.

    Attributes:
        status: what became of the last sample.
    """

    def __init__(self, *, jump_max: float = 0.15, lost_after: float = 0.5) -> None:
        self._jump = checked_number(jump_max, "jump_max of the device [m]", above=0.0)
        self._lost_after = checked_number(lost_after, "lost_after of the device [s]", above=0.0)
        self._last: DeviceSample | None = None
        self._good_at = -math.inf
        self.status = DeviceStatus.LOST

    def check(self, sample: DeviceSample | None, time: float) -> DeviceSample | None:
        """The sample to follow.

        Args:
            sample: what came since the last tick, None for nothing.
            time: of the robot [s].

        Returns:
            The newest good sample, None while the device is lost.
        """
        last = self._last
        if sample is not None:
            if self._is_good(sample, last, time):
                self._last, self._good_at = sample, time
                self.status = DeviceStatus.OK
                return sample
            self.status = DeviceStatus.REFUSED
        elif self.status is not DeviceStatus.LOST:
            self.status = DeviceStatus.STALE
        if last is None or time - self._good_at > self._lost_after:
            self.status = DeviceStatus.LOST
            return None
        return last

    def _is_good(self, sample: DeviceSample, last: DeviceSample | None, time: float) -> bool:
        if not (_is_point(sample.left) and _is_point(sample.right) and math.isfinite(sample.time)):
            return False
        if last is None:
            return True
        if sample.time <= last.time:
            return False
        if time - self._good_at > self._lost_after:
            return True
        step = max(
            float(np.abs(sample.left - last.left).max()),
            float(np.abs(sample.right - last.right).max()),
        )
        return step <= self._jump


def _is_point(value: object) -> bool:
    return (
        isinstance(value, np.ndarray)
        and value.shape == (3,)
        and value.dtype == np.float64
        and bool(np.isfinite(value).all())
    )
