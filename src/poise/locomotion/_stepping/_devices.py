"""Devices of an operator: `TrackedFeet`, by two trackers, and `ScriptedDevice`, by `WayPoint`s."""

import math
from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Annotated

import numpy as np
import pinocchio as pin
from msgspec.structs import replace

from poise._checks import checked_number
from poise._schema import Bounds, Seconds, Vector as VectorOf, checked
from poise.dynamics import least_jerk
from poise.errors import ConfigurationError
from poise.locomotion._stepping._guard import SLOWEST, Engagement
from poise.locomotion._stepping._sample import (
    FieldError,
    OperatorSample,
    TrackedPose,
    Vector,
    WarnOnce,
    checked_sample,
)
from poise.locomotion._stepping._step_teleoperator import StepTeleoperator
from poise.locomotion._support import Vector3


class FootTracker:
    """From a tracker's motion while its clutch is closed to the place of its foot."""

    # p = p_0 + s R(yaw) (x - x_0), with the foot's place p_0, the tracker's x_0 and the robot's
    # heading `yaw` when the clutch closed, and the scale s. `OperatorGuard` bounds its speed.

    def __init__(self, scale: float = 1.0) -> None:
        self._engagement, self._ahead = Engagement(), 0.0
        self._scale = checked_number(scale, "scale of the trackers' ways", above=0.0)
        self._offset: Vector3 = np.zeros(3)

    def follow(
        self, tracker: TrackedPose | None, place: Vector | Vector3, ahead: float, time: float
    ) -> TrackedPose | None:
        """Store a sample of the tracker."""
        engagement = self._engagement
        engagement.expire(time)
        point = None if tracker is None else tracker.position
        if tracker is None or point is None or not all(map(math.isfinite, point)):
            engagement.lose()
            return None
        if not tracker.clutch:
            engagement.release(time)
            return None
        begins = not engagement.engaged
        if not engagement.engage(time):
            return None
        if begins:
            self._ahead = ahead
            self._offset = np.subtract(place, self._way(point))
        rate = tracker.velocity
        if rate is not None:
            rate = self._way(rate) if all(map(math.isfinite, rate)) else None
        return TrackedPose.of(self._offset + self._way(point), velocity=rate)

    def _way(self, forward_left_up: Sequence[float]) -> Vector3:
        return self._scale * along_ahead(forward_left_up, self._ahead)


class TrackedFeet:
    """Two trackers as a `Device`: each moves its foot while its clutch is closed (`FootTracker`).

    A foot that is let go is lowered where it is. Hands, head and all else of a sample pass.

    Args:
        teleoperator: of the feet.
        newest: returns the newest sample since its last call, in which feet have clutches; None for
            nothing. It is called every tick, and must not wait.
        scale: way of a foot over way of its tracker.

    Attributes:
        error: which vectors in the last sample were none; None for all well. A tracker without a
            position counts as disconnected, and is logged to `poise`, once for each kind.
    """

    def __init__(
        self,
        teleoperator: StepTeleoperator,
        newest: Callable[[], OperatorSample | None],
        *,
        scale: float = 1.0,
    ) -> None:
        self._teleoperator, self._newest = teleoperator, newest
        self._trackers = (FootTracker(scale), FootTracker(scale))
        self._places = [rest_place(teleoperator, foot) for foot in (0, 1)]
        self.error: FieldError | None = None
        self._warn_once = WarnOnce()

    def sample(self, time: float) -> OperatorSample | None:
        """Return the goals of the feet, with the trackers' time.

        Args:
            time: of the robot [s].

        Returns:
            None where nothing new came.
        """
        came, self.error = checked_sample(self._newest())
        if self.error is not None:
            self._warn_once(self.error, "part of what a tracker sends is left out")
        if came is None:
            return None
        left, right = (self._follow(foot, came.feet[foot], time) for foot in (0, 1))
        return replace(came, feet=(left, right))

    def _follow(self, foot: int, tracker: TrackedPose | None, time: float) -> TrackedPose:
        tracked, teleoperator = self._trackers[foot], self._teleoperator
        led = tracked.follow(tracker, self._places[foot], teleoperator.ahead, time)
        led = led or TrackedPose(rest_place(teleoperator, foot))
        self._places[foot] = led.position or self._places[foot]
        return led


def rest_place(teleoperator: StepTeleoperator, foot: int) -> Vector:
    """Return the goal of a foot without a command: its position, or straight down [m]."""
    estimator, mode = teleoperator.estimator, teleoperator.mode
    x, y, z = estimator.anchors[foot].tolist()
    if not mode.single or mode.support == foot:
        return x, y, z
    x, y, _ = estimator.sole(foot).tolist()
    return x, y, z - teleoperator.parameters.press_depth


def along_ahead(vector: Sequence[float], ahead: float) -> Vector3:
    """Return a vector given forward, left and up of a robot along the world's axes."""
    (forward, left, up), c, s = vector, math.cos(ahead), math.sin(ahead)
    return np.array([c * forward - s * left, s * forward + c * left, up])


# Forward, left and up from where the foot stood at the start [m]
Offset = Annotated[tuple[float, float, float], VectorOf(3, Bounds(most=10.0, unit="m"))]

# Axis times angle, forward, left and up, as the torso faces [rad]
Turn = Annotated[tuple[float, float, float], VectorOf(3, Bounds(most=3.0, unit="rad"))]


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
