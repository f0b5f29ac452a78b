"""`Device`: where samples come from. `ScriptedDevice`: one that needs no person, by `WayPoint`s."""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float64

from poise._schema import Bounds, Seconds, Vector, checked
from poise.dynamics import least_jerk
from poise.errors import ConfigurationError
from poise.locomotion._stepping._samples import DeviceSample, HandSample

Offset = Annotated[tuple[float, float, float], Vector(3, Bounds(most=10.0, unit="m"))]
"""Forward, left and up from where the foot stood at the start [m]."""


@runtime_checkable
class Device(Protocol):
    """Anything that says where the operator holds the devices of feet and hands."""

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
        left_hand: likewise of the left hand, as the torso faces [m].
        right_hand: of the right hand [m].
    """

    at: Seconds
    left: Offset | None = None
    right: Offset | None = None
    left_hand: Offset | None = None
    right_hand: Offset | None = None

    def __post_init__(self) -> None:
        if all(o is None for o in (self.left, self.right, self.left_hand, self.right_hand)):
            raise ConfigurationError("a way-point moves no device", wanted="left, right or both")


_GRIP_AT = 0.1
"""When a scripted device takes hold of its hand [s]: its clutch has to be seen open first."""


class ScriptedDevice:
    """Devices that go from way-point to way-point, each part by a blend of least jerk.

    From one point s to the next with u in [0, 1] over the time between them:
    p = p_0 + (p_1 - p_0) (10 u^3 - 15 u^4 + 6 u^5). The blend starts and ends at rest, so a hold is
    two points in the same place. A device without points stays at its foot, and a hand without
    points has none; the others take hold of their hands after a tenth of a second.

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
        paths = (
            [(p.at, p.left_hand) for p in points if p.left_hand is not None],
            [(p.at, p.right_hand) for p in points if p.right_hand is not None],
        )
        self._hands = [_Path(path, np.zeros(3)) if path else None for path in paths]

    def sample(self, time: float) -> DeviceSample:
        """Where the devices are at a time [s]."""
        left, right = (
            None if path is None else HandSample(path.at(time), clutch=time > _GRIP_AT)
            for path in self._hands
        )
        return DeviceSample(time, self._left.at(time), self._right.at(time), hands=(left, right))


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
