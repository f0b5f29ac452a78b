"""`Device` and `ScriptedDevice`: where samples come from, and one that needs no person.

`DeviceSample` and `DeviceGuard`: what the operator commands, and whether to believe it.
"""

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import pairwise
from typing import Annotated, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float64

from poise._checks import checked_number
from poise._schema import Bounds, Seconds, Vector, checked
from poise.dynamics import least_jerk
from poise.errors import ConfigurationError


@dataclass(frozen=True, slots=True, eq=False)
class DeviceSample:
    """Where the operator holds the two devices; each commands the sole of its side.

    Attributes:
        time: when it was measured, on the operator's clock [s].
        left: position commanded for the left sole, in the controller's world [m].
        right: position commanded for the right sole [m].
        upright: button: bring the torso upright although one foot is in the air.
    """

    time: float
    left: Float64[np.ndarray, "3"]
    right: Float64[np.ndarray, "3"]
    upright: bool = False

    def position(self, foot: int) -> Float64[np.ndarray, "3"]:
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
        steps = (*(sample.left - last.left).tolist(), *(sample.right - last.right).tolist())
        return max(map(abs, steps)) <= self._jump


def _is_point(value: object) -> bool:
    return (
        isinstance(value, np.ndarray)
        and value.shape == (3,)
        and value.dtype == np.float64
        and all(map(math.isfinite, value.tolist()))
    )


Offset = Annotated[tuple[float, float, float], Vector(3, Bounds(most=10.0, unit="m"))]
"""Forward, left and up from where the foot stood at the start [m]."""


@runtime_checkable
class Device(Protocol):
    """Anything that says where the operator holds the two foot devices."""

    def sample(self, time: float) -> DeviceSample | None:
        """What came since the last tick.

        Args:
            time: of the robot [s].

        Returns:
            The newest sample, None for nothing new.
        """
        ...


@checked()
@dataclass(frozen=True, kw_only=True)
class WayPoint:
    """Where a device is at a time.

    Attributes:
        at: [s].
        left: offset of the left device from its foot's start; as before when None [m].
        right: offset of the right device from its foot's start; as before when None [m].
    """

    at: Seconds
    left: Offset | None = None
    right: Offset | None = None

    def __post_init__(self) -> None:
        if self.left is None and self.right is None:
            raise ConfigurationError("a way-point moves no device", wanted="left, right or both")


class ScriptedDevice:
    """Two devices that go from way-point to way-point, each part by a blend of least jerk.

    From one point s to the next with u in [0, 1] over the time between them:
    p = p_0 + (p_1 - p_0) (10 u^3 - 15 u^4 + 6 u^5). The blend starts and ends at rest, so a hold is
    two points in the same place. A device without points stays at its foot.

    Args:
        points: in order of time.
        left: where the left foot is at the start [m].
        right: where the right foot is at the start [m].

    Raises:
        ConfigurationError: times that do not increase, or a number that is not finite.
    """

    def __init__(
        self,
        points: Sequence[WayPoint],
        left: Float64[np.ndarray, "3"],
        right: Float64[np.ndarray, "3"],
    ) -> None:
        for before, after in pairwise(points):
            if not after.at > before.at:
                raise ConfigurationError(
                    "way-points are not in order of time",
                    got=(before.at, after.at),
                    wanted="times that increase",
                )
        self._left = _Path([(p.at, p.left) for p in points if p.left is not None], left)
        self._right = _Path([(p.at, p.right) for p in points if p.right is not None], right)

    def sample(self, time: float) -> DeviceSample:
        """Where the devices are at a time [s]."""
        return DeviceSample(time, self._left.at(time), self._right.at(time))


class _Path:
    """One device's trajectory."""

    def __init__(self, points: list[tuple[float, Offset]], start: Float64[np.ndarray, "3"]) -> None:
        times = [at for at, _ in points]
        places = [start + np.array(offset, dtype=np.float64) for _, offset in points]
        self._times = [0.0, *times] if not times or times[0] > 0.0 else times
        self._places = places if len(places) == len(self._times) else [start.copy(), *places]

    def at(self, time: float) -> Float64[np.ndarray, "3"]:
        i = bisect_right(self._times, time)
        if i == 0:
            return self._places[0].copy()
        if i == len(self._times):
            return self._places[-1].copy()
        begin, end = self._times[i - 1 : i + 1]
        phase, _, _ = least_jerk(time, begin, end - begin)
        before, after = self._places[i - 1], self._places[i]
        return before + phase * (after - before)
