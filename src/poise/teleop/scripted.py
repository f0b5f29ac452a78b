"""`Device` and `ScriptedDevice`: where samples come from, and one that needs no person."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float64

from poise.checks import checked_number
from poise.errors import ConfigurationError
from poise.teleop.device import DeviceSample

Offset = tuple[float, float, float]
"""Forward, left and up from where the foot stood at the start [m]."""


@runtime_checkable
class Device(Protocol):
    """Anything that gives the operator's hands."""

    def sample(self, time: float) -> DeviceSample | None:
        """What came since the last tick.

        Args:
            time: of the robot [s].

        Returns:
            The newest sample, None for nothing new.
        """
        ...


@dataclass(frozen=True, kw_only=True)
class WayPoint:
    """Where a device is at a time.

    Attributes:
        at: [s].
        left: offset of the left device from its foot's start; as before when None [m].
        right: likewise.
    """

    at: float
    left: Offset | None = None
    right: Offset | None = None


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
    """One device's way."""

    def __init__(self, points: list[tuple[float, Offset]], start: Float64[np.ndarray, "3"]) -> None:
        for at, offset in points:
            checked_number(at, "time of a way-point [s]")
            if len(offset) != 3 or not np.isfinite(offset).all():
                raise ConfigurationError(
                    "a way-point is no point", got=offset, wanted="three finite numbers"
                )
        times = [at for at, _ in points]
        places = [start + np.array(offset, dtype=np.float64) for _, offset in points]
        self._times = np.array([0.0, *times] if not times or times[0] > 0.0 else times)
        self._places = places if len(places) == len(self._times) else [start.copy(), *places]

    def at(self, time: float) -> Float64[np.ndarray, "3"]:
        i = int(np.searchsorted(self._times, time, side="right"))
        if i == 0:
            return self._places[0].copy()
        if i == len(self._times):
            return self._places[-1].copy()
        u = (time - self._times[i - 1]) / (self._times[i] - self._times[i - 1])
        share = float(u**3 * (10.0 - 15.0 * u + 6.0 * u * u))
        before, after = self._places[i - 1], self._places[i]
        return before + share * (after - before)
