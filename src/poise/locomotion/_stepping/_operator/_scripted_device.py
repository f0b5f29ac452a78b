"""`ScriptedDevice`: a device that needs no person, by `WayPoint`s."""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._schema import Bounds, Seconds, Vector, checked
from poise.dynamics import least_jerk
from poise.errors import ConfigurationError
from poise.locomotion._stepping._operator._sample import (
    OperatorSample,
    Quaternion,
    TrackedPose,
)

Offset = Annotated[tuple[float, float, float], Vector(3, Bounds(most=10.0, unit="m"))]
"""Forward, left and up from where the foot stood at the start [m]."""

Turn = Annotated[tuple[float, float, float], Vector(3, Bounds(most=3.0, unit="rad"))]
"""Axis times angle, forward, left and up, as the torso faces [rad]."""


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
        left_turn: how the left hand's device is turned from how it was at the start [rad].
        right_turn: the right hand's [rad].
        head: how the head is turned from looking straight ahead [rad].
    """

    at: Seconds
    left: Offset | None = None
    right: Offset | None = None
    left_hand: Offset | None = None
    right_hand: Offset | None = None
    left_turn: Turn | None = None
    right_turn: Turn | None = None
    head: Turn | None = None

    def __post_init__(self) -> None:
        feet, hands = (self.left, self.right), (self.left_hand, self.right_hand)
        turned = (self.left_turn, self.right_turn, self.head)
        if all(each is None for each in (*feet, *hands, *turned)):
            raise ConfigurationError("a way-point moves no device", wanted="left, right or both")


_GRIP_AT = 0.1
"""When a scripted device takes hold of its hand [s]: its clutch has to be seen open first."""


class ScriptedDevice:
    """Devices that go from way-point to way-point, each part by a blend of least jerk.

    From one point s to the next with u in [0, 1] over the time between them:
    p = p_0 + (p_1 - p_0) (10 u^3 - 15 u^4 + 6 u^5). The blend starts and ends at rest, so a hold is
    two points in the same place. Turns are blended as vectors. A device without points stays at its
    foot, and a hand or head without any has none; the others take hold after a tenth of a second.

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
        self._hands = (
            _ScriptedHand([(p.at, p.left_hand, p.left_turn) for p in points]),
            _ScriptedHand([(p.at, p.right_hand, p.right_turn) for p in points]),
        )
        self._head = _path_of([(p.at, p.head) for p in points])

    def sample(self, time: float) -> OperatorSample:
        """Return where the devices are at a time [s]."""
        left, right = (hand.at(time) for hand in self._hands)
        head = None
        if self._head is not None:
            turned = _quaternion(self._head.at(time))
            head = TrackedPose(clutch=time > _GRIP_AT, orientation=turned)
        feet = (
            TrackedPose.of(self._left.at(time)),
            TrackedPose.of(self._right.at(time)),
        )
        return OperatorSample(time, feet, (left, right), head)


class _ScriptedHand:
    """The devices' trajectory of one hand.

    Args:
        points: time [s], place [m] and turn [rad] of each.
    """

    def __init__(self, points: Sequence[tuple[float, Offset | None, Turn | None]]) -> None:
        self._place = _path_of([(at, place) for at, place, _ in points])
        self._turn = _path_of([(at, turn) for at, _, turn in points])

    def at(self, time: float) -> TrackedPose | None:
        """Return the pose at a time [s]; None without points."""
        if self._place is None and self._turn is None:
            return None
        return TrackedPose.of(
            (0.0, 0.0, 0.0) if self._place is None else self._place.at(time),
            clutch=time > _GRIP_AT,
            orientation=None if self._turn is None else _quaternion(self._turn.at(time)),
        )


def _quaternion(turn: Float64[np.ndarray, "3"]) -> Quaternion:
    """A unit quaternion (x, y, z, w) of a rotation vector [rad]."""
    x, y, z, w = pin.Quaternion(pin.exp3(turn)).coeffs().tolist()
    return x, y, z, w


def _path_of(points: Sequence[tuple[float, Offset | None]]) -> "_Path | None":
    """From zero on; None without points."""
    given = [(at, offset) for at, offset in points if offset is not None]
    return _Path(given, np.zeros(3)) if given else None


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
