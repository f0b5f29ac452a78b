"""`ScriptedDevice`: a device that needs no person, by `WayPoint`s."""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Annotated

import numpy as np
import pinocchio as pin

from poise._schema import Bounds, Seconds, Vector, checked
from poise.dynamics import least_jerk
from poise.errors import ConfigurationError
from poise.locomotion._stepping._operator._guard import SLOWEST
from poise.locomotion._stepping._operator._sample import OperatorSample, TrackedPose
from poise.locomotion._support import Vector3

# Forward, left and up from where the foot stood at the start [m]
Offset = Annotated[tuple[float, float, float], Vector(3, Bounds(most=10.0, unit="m"))]

# Axis times angle, forward, left and up, as the torso faces [rad]
Turn = Annotated[tuple[float, float, float], Vector(3, Bounds(most=3.0, unit="rad"))]


@checked()
@dataclass(frozen=True, kw_only=True)
class WayPoint:
    """Places of the devices at a time; None leaves a device as it is.

    Attributes:
        at: the time [s].
        left: offset of the left device from its foot's start [m].
        right: offset of the right device from its foot's start [m].
        left_hand: offset of the left hand, as the torso faces [m].
        right_hand: offset of the right hand [m].
        left_turn: of the left hand's device from the start [rad].
        right_turn: of the right hand's [rad].
        head: turn of the head from looking straight ahead [rad].
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
        if all(getattr(self, part.name) is None for part in fields(self)[1:]):
            raise ConfigurationError("a way-point moves no device", wanted="left, right or both")


class ScriptedDevice:
    """Devices that go from way-point to way-point, each part by a blend of least jerk.

    From one point s to the next with u in [0, 1] over the time between them:
    p = p_0 + (p_1 - p_0) (10 u^3 - 15 u^4 + 6 u^5). The blend starts and ends at rest; turns are
    blended as vectors. A foot's device without points stays at its foot, a hand or head without any
    has none; the others engage after a tenth of a second.

    Args:
        points: in order of time.
        left: place of the left foot at the start [m].
        right: place of the right foot at the start [m].

    Raises:
        ConfigurationError: times that do not increase.
    """

    def __init__(self, points: Sequence[WayPoint], left: Vector3, right: Vector3) -> None:
        for before, after in pairwise(point.at for point in points):
            if not after > before:
                what, wanted = "way-points are not in order of time", "times that increase"
                raise ConfigurationError(what, got=(before, after), wanted=wanted)
        starts = {"left": left, "right": right}
        self._paths = {
            part.name: _Path(
                [(point.at, getattr(point, part.name)) for point in points],
                starts.get(part.name, np.zeros(3)),
            )
            for part in fields(WayPoint)[1:]
        }

    def sample(self, time: float) -> OperatorSample:
        """Return the devices at a time [s]."""
        paths = self._paths
        left, right = (TrackedPose.of(paths[foot].at(time)) for foot in ("left", "right"))
        hands = (
            _pose(paths["left_hand"], paths["left_turn"], time),
            _pose(paths["right_hand"], paths["right_turn"], time),
        )
        head = _pose(_Path([], np.zeros(3)), paths["head"], time)
        return OperatorSample(time, (left, right), hands, head)


def _pose(place: "_Path", turn: "_Path", time: float) -> TrackedPose | None:
    """Return the pose of a hand or the head; None without points."""
    if not (place.moves or turn.moves):
        return None
    turned = pin.Quaternion(pin.exp3(turn.at(time))).coeffs() if turn.moves else None
    return TrackedPose.of(place.at(time), time > SLOWEST, turned)


class _Path:
    """Trajectory through offsets from a start [m]; points without one are passed over."""

    def __init__(self, points: Sequence[tuple[float, Offset | None]], start: Vector3) -> None:
        given = [(at, start + np.array(way)) for at, way in points if way is not None]
        self.moves = bool(given)
        if not given or given[0][0] > 0.0:
            given = [(0.0, start.copy()), *given]
        self._times, self._places = [at for at, _ in given], [place for _, place in given]

    def at(self, time: float) -> Vector3:
        i = bisect_right(self._times, time)
        if i == 0:
            return self._places[0].copy()
        if i == len(self._times):
            return self._places[-1].copy()
        begin, end = self._times[i - 1 : i + 1]
        phase, _, _ = least_jerk(time, begin, end - begin)
        before, after = self._places[i - 1], self._places[i]
        return before + phase * (after - before)
