"""`HandGrip`: how one device leads its hand: while its clutch is closed, by its motion alone.

`HeadGrip`: how a headset leads the gaze: while its clutch is closed, by where it looks.
`Clutch`: from when until when a device leads.
"""

import math

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.dynamics import rotation_vector
from poise.locomotion._stepping._operator._pursuit import DeviceRate, Pursuit, is_point
from poise.locomotion._stepping._operator._samples import HandSample, HeadSample

_START, _JUMP = 0.06, 0.3
"""How far a device is followed at once, and beyond what distance it is another thing [m]."""

_TURN_START, _TURN_JUMP = 0.12, 1.2
"""Likewise of how it is turned [rad]: a wrist that is flicked runs ahead of what follows it."""

LATE, LOST_AFTER = 0.5, 0.5
"""Largest difference of two samples' delays, and silence after which a device is lost [s]."""

_STILL: Float64[np.ndarray, "3"] = np.zeros(3)
_STILL.flags.writeable = False

_UNIT = 0.01
"""How far a quaternion's length may be from one: messages round their numbers."""


class Clutch:
    """When a device leads: from when its clutch closes, which has to be seen, until it opens.

    One that is closed when it is found, or found again, leads nothing until it was open. Without a
    good sample for half a second it is lost.

    Attributes:
        holds: whether the device leads.
    """

    def __init__(self) -> None:
        self._was_open = self.holds = False
        self._good_at = -math.inf

    def expire(self, time: float) -> None:
        """Lets go of what is lost, at a time of the robot [s]; also where that has gone back."""
        if abs(time - self._good_at) > LOST_AFTER:
            self.lose()

    def lose(self) -> None:
        """The device is gone: whatever comes next has to be seen open first."""
        self.holds = self._was_open = False

    def open(self, time: float) -> None:
        """It is seen open, at a time of the robot [s]."""
        self.holds, self._was_open, self._good_at = False, True, time

    def takes_hold(self) -> bool:
        """It is seen closed: whether it takes hold now."""
        if self.holds or not self._was_open:
            return False
        self.holds, self._was_open = True, False
        return True

    def good(self, time: float) -> None:
        """There was a good sample, at a time of the robot [s]."""
        self._good_at = time


class TurnPursuit:
    """Follows an orientation by no more than `start` + `step` n in any n ticks.

    Args:
        step: how far in a tick, on average [rad].

    Attributes:
        place: what is followed to; None for nothing.
    """

    def __init__(self, step: float) -> None:
        self._pursuit = Pursuit(step, _TURN_START)
        self.place: Float64[np.ndarray, "3 3"] | None = None
        self._goal: Float64[np.ndarray, "3 3"] | None = None

    def lead(
        self, goal: Float64[np.ndarray, "3 3"] | None, begin: Float64[np.ndarray, "3 3"] | None
    ) -> None:
        """Where it is led from now on.

        Args:
            goal: None for nowhere: what follows begins anew.
            begin: where it is when it is led for the first time.
        """
        self._goal = goal
        if goal is None:
            self.place = None
        elif self.place is None:
            self.place = begin

    def follow(self) -> Float64[np.ndarray, "3"]:
        """Takes one tick; the rotation vector by which it turned, along the fixed axes [rad]."""
        if self.place is None or self._goal is None or self.place is self._goal:
            return _STILL
        way = rotation_vector(self._goal, self.place)
        part = self._pursuit.part(math.hypot(*way))
        turn = part * way
        self.place = self._goal if part == 1.0 else pin.exp3(turn) @ self.place
        return turn


class HandGrip:
    """How one device leads its hand.

    The device takes hold where the hand is when its clutch closes. From then on its
    motion counts, at `speed_max` on average at most and in any time t by no more than 6 cm +
    `speed_max` t, and how it turns from then on, likewise by no more than 0.12 rad +
    `turn_speed_max` t. A place that no hand got to, more than 30 cm away or turned by more than 1.2
    rad, is refused, and so is what is no orientation. One that gives an orientation at times only
    turns its hand from the first of each time on.

    Args:
        dt: length of a tick [s].
        speed_max: largest speed at which a device is followed [m/s].
        turn_speed_max: largest speed at which it is turned after [rad/s].

    Attributes:
        turns: whether it turns its hand, too.
        turn: how far its device turned in the last tick, a rotation vector along the axes of the
            torso [rad].
        rate: how fast it moves.
    """

    def __init__(self, dt: float, speed_max: float, turn_speed_max: float = 3.0) -> None:
        self._pursuit = Pursuit(dt * speed_max, _START)
        self._turning = TurnPursuit(dt * turn_speed_max)
        self.rate = DeviceRate(speed_max)
        self._clutch = Clutch()
        self._place: list[float] = [0.0] * 3
        self._goal: list[float] = [0.0] * 3
        self.turn: Float64[np.ndarray, "3"] = _STILL

    @property
    def holds(self) -> bool:
        """Whether the device leads its hand."""
        return self._clutch.holds

    @property
    def turns(self) -> bool:
        """Whether it turns it."""
        return self.holds and self._turning.place is not None

    def update(self, sample: HandSample | None, time: float) -> Float64[np.ndarray, "3"]:
        """Takes one tick.

        Args:
            sample: what came; None for nothing new.
            time: of the robot [s].

        Returns:
            How far the device moved that holds its hand [m].
        """
        self._clutch.expire(time)
        if sample is not None:
            self._take(sample, time)
        if not self.holds:
            self.turn = _STILL
            return _STILL
        self.turn = self._turning.follow()
        before, self._place = self._place, self._pursuit.follow(self._place, self._goal)
        return np.subtract(self._place, before)

    def _take(self, sample: HandSample, time: float) -> None:
        if not sample.clutch:
            self._clutch.open(time)
            return
        rotation = None
        if sample.orientation is not None:
            rotation = rotation_of(sample.orientation)
            if rotation is None:
                return
        if not is_point(sample.position):
            return
        point: list[float] = sample.position.tolist()
        if self._clutch.takes_hold():
            self._place = point
            self._turning.lead(None, None)
        elif not (self.holds and self._is_near(point, rotation)):
            return
        self._turning.lead(rotation, rotation)
        self._goal = point
        self._clutch.good(time)
        self.rate.tell(sample.velocity, point, time)

    def _is_near(self, point: list[float], rotation: Float64[np.ndarray, "3 3"] | None) -> bool:
        if math.dist(point, self._place) > _JUMP:
            return False
        return rotation is None or not _is_elsewhere(rotation, self._turning.place)


class HeadGrip:
    """How a headset leads the gaze.

    While its clutch is closed the gaze goes where it looks, at `speed_max` on average at most, and
    stays where it is when that opens, or when the headset is lost. One that turned by more than 1.2
    rad from one sample to the next is refused, and so is what is no orientation.

    Args:
        dt: length of a tick [s].
        speed_max: largest speed at which it is followed [rad/s].
    """

    def __init__(self, dt: float, speed_max: float) -> None:
        self._turning = TurnPursuit(dt * speed_max)
        self._clutch = Clutch()
        self._last: Float64[np.ndarray, "3 3"] | None = None

    @property
    def holds(self) -> bool:
        """Whether the headset leads the gaze."""
        return self._clutch.holds

    def update(
        self, sample: HeadSample | None, time: float, gaze: Float64[np.ndarray, "3 3"]
    ) -> Float64[np.ndarray, "3 3"]:
        """Takes one tick.

        Args:
            sample: what came; None for nothing new.
            time: of the robot [s].
            gaze: where it goes now, from there it is led when the headset takes hold.

        Returns:
            Where it goes from this tick on.
        """
        self._clutch.expire(time)
        if sample is not None:
            self._take(sample, time, gaze)
        if not self.holds or self._turning.place is None:
            return gaze
        self._turning.follow()
        return self._turning.place

    def _take(self, sample: HeadSample, time: float, gaze: Float64[np.ndarray, "3 3"]) -> None:
        if not sample.clutch:
            self._clutch.open(time)
            return
        rotation = rotation_of(sample.orientation)
        if rotation is None:
            return
        if self._clutch.takes_hold():
            self._turning.lead(None, None)
        elif not self.holds or _is_elsewhere(rotation, self._last):
            return
        self._turning.lead(rotation, gaze)
        self._last = rotation
        self._clutch.good(time)


def _is_elsewhere(
    rotation: Float64[np.ndarray, "3 3"], before: Float64[np.ndarray, "3 3"] | None
) -> bool:
    """Whether it is turned so far from what was before that it is another thing."""
    if before is None or rotation is before:
        return False
    return math.hypot(*rotation_vector(rotation, before)) > _TURN_JUMP


def rotation_of(quaternion: object) -> Float64[np.ndarray, "3 3"] | None:
    """The rotation matrix of a unit quaternion (x, y, z, w); None for what is none.

    Args:
        quaternion: a device may send anything.
    """
    if not (
        isinstance(quaternion, np.ndarray)
        and quaternion.shape == (4,)
        and quaternion.dtype == np.float64
    ):
        return None
    length = math.hypot(*quaternion.tolist())
    # Not a number is not near one either.
    if not abs(length - 1.0) <= _UNIT:
        return None
    return pin.Quaternion(quaternion / length).toRotationMatrix()
