"""`TrackedFeet`: two trackers, each of which leads a foot by its motion: a `Device`.

`FootTracker`: when a tracker leads, and where to. `rest_place`: where a foot goes that nothing
leads. `along_ahead`: forward, left and up in the world.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np
from msgspec.structs import replace

from poise._checks import checked_number
from poise.locomotion._stepping._operator import (
    Engagement,
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
    """From a tracker's motion while its clutch is closed to the place of its foot.

    p = p_0 + s R(yaw) (x - x_0), with the foot's place p_0, the tracker's x_0 and the robot's
    heading `yaw` when the clutch closed, and the scale s. A tracker that is found, or found again
    after half a second, has to be seen open first. `OperatorGuard` bounds how fast the place moves.
    """

    def __init__(self, scale: float = 1.0) -> None:
        self._engagement, self._ahead = Engagement(), 0.0
        self._scale = checked_number(scale, "scale of the trackers' ways", above=0.0)
        self._offset: Vector3 = np.zeros(3)

    def follow(
        self, tracker: TrackedPose | None, place: Vector | Vector3, ahead: float, time: float
    ) -> TrackedPose | None:
        """Take what the tracker sends."""
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
    """Two trackers as a `Device`: each leads its foot while its clutch is closed (`FootTracker`).

    A foot that is let go is lowered where it is. Hands, head and all else of a sample pass.

    Args:
        teleoperator: whose feet are led.
        newest: returns the newest sample since its last call, in which feet have clutches; None for
            nothing. It is called every tick, and must not wait.
        scale: way of a foot over way of its tracker.

    Attributes:
        error: which vectors in the last sample were none; None for all well. A tracker without a
            position counts as gone; the logger `poise` says so, each kind once.
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
        """Return where the trackers lead the feet, with the trackers' time.

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
    """Return the goal of a foot that nothing leads: its place, or straight down [m]."""
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
