"""`OperatorGuard`: which of an operator's samples count, and how fast they are followed."""

import math
from collections.abc import Sequence
from enum import Enum

import numpy as np
from jaxtyping import Float64

from poise._checks import checked_number
from poise.locomotion._stepping._operator._fields import WarnOnce, checked_sample
from poise.locomotion._stepping._operator._sample import (
    BodyCommand,
    Device,
    OperatorSample,
    TrackedPose,
    Vector,
)
from poise.locomotion._stepping._operator._sample_clock import SILENT_AFTER, Engagement, SampleClock
from poise.locomotion._stepping._operator._tracking import Tracker, is_turned_away, rotation_of

# Sticks do not rest at exactly zero [m/s, rad/s]
_STICK_REST, _STICK_TURN_REST = 0.01, 0.02


class DeviceStatus(Enum):
    """Fate of the last sample."""

    OK = "ok"
    STALE = "no new sample for a moment: the last one holds"
    REFUSED = "the last sample was refused: the one before holds"
    LOST = "the device stopped sending: the feet go back to the ground"
    WAITING = "bring each device down to its foot to take hold of it"
    WALKING = "the robot walks as it is told; when it stands, take hold of each foot anew"
    OVERRULED = "the robot steps by itself so as not to fall; then take hold of each foot anew"


class OperatorGuard:
    """Reject stale, out-of-order or implausible samples, and rate-limit the others.

    A sample counts once, if it is newer than the newest and no more than `LATE` later than the
    soonest (`SampleClock`). Feet and hands are followed by a `Tracker` each, without jumps; a part
    that is lost for `LOST_AFTER`, or found far away, engages anew: a foot by being put down at the
    robot's foot, a hand or head by a clutch that was seen open, a velocity after one of zero. A
    foot without a lead is sent straight down.

    Args:
        dt: length of a tick [s].
        low: largest height of a device that is put down, above its foot's ground [m].
        press_depth: depth below the ground to which a foot without a device is sent [m].

    Raises:
        ConfigurationError: a number that is not positive.

    Attributes:
        status: fate of the last sample.
        error: of the device when it was read last, or of vectors in its sample; None if all was
            well.
        velocity: of a walk; zero without an operator.
        held: the devices of the left and the right foot lead them.
        hands: followed, left and right.
        head: orientation of the head that leads the gaze; None while none does.
        rest: the last sample asks for rest of hands and gaze.
    """

    def __init__(self, *, dt: float, low: float = 0.01, press_depth: float = 0.08) -> None:
        checked_number(dt, "dt of the device [s]", above=0.0)
        self._low = checked_number(low, "low of the device [m]", above=0.0)
        self._depth = checked_number(press_depth, "press_depth of the device [m]", above=0.0)
        self._clock = SampleClock()
        self._feet, self.hands = (Tracker(dt), Tracker(dt)), (Tracker(dt), Tracker(dt))
        self._look, self._walk = Engagement(), Engagement()
        self.head: Float64[np.ndarray, "3 3"] | None = None
        self.velocity: Vector = (0.0, 0.0, 0.0)
        self.rest = False
        self._body, self._upright = BodyCommand(), False
        self._refused, self._came_at = False, -math.inf
        self.status, self.held = DeviceStatus.LOST, (False, False)
        self.error: Exception | None = None
        self._warn_once = WarnOnce()
        self._given: object = None
        self._checked: OperatorSample | None = None

    def read(self, device: Device | None, time: float) -> OperatorSample | None:
        """Return a device's sample at a time of the robot [s]; None, and a log, if it fails."""
        if device is None:
            return None
        try:
            given = device.sample(time)
            if given is not self._given or given is None:
                self._given = None
                self._checked, self.error = checked_sample(given)
                self._given = given
        except Exception as error:
            self.error = error
            self._warn_once(error, "the device failed, and counts as silent")
            return None
        if self.error is not None:
            self._warn_once(self.error, "part of what the device gives is ignored")
        return self._checked

    def check(
        self,
        sample: OperatorSample | None,
        time: float,
        soles: Sequence[Float64[np.ndarray, "3"]] = (),
        grounds: Sequence[Float64[np.ndarray, "3"]] = (),
    ) -> OperatorSample | None:
        """Take one tick, after which `hands`, `head`, `rest` and `velocity` are those of it.

        Args:
            sample: of the tick, None for nothing; the newest again is nothing.
            time: of the robot [s].
            soles: places of the left and the right sole [m]; none without a lead of the feet.
            grounds: places of their last stance [m].

        Returns:
            The goal of each foot, after its device or straight down, and the body's command; None
            while neither device leads.
        """
        if sample is not None and sample.time == self._clock.newest:
            sample = None
        news = sample if sample is not None and self._clock.accepts(sample.time, time) else None
        self._take(news, time)
        refused = news is None
        left, right = self._feet
        parts = (None, None) if news is None else news.feet
        for tracker, part, sole, ground in zip(self._feet, parts, soles, grounds, strict=False):
            (x, y, z), highest = sole.tolist(), float(ground[2]) + self._low
            good = tracker.update(part, time, foot=((x, y, z), highest))
            refused = refused or (tracker.engaged and part is not None and not good)
        self.held = left.engaged, right.engaged
        if sample is not None:
            self._refused, self._came_at = refused, time
        self.status = self._status(time)
        if not any(self.held):
            return None
        feet = self._goal(left, soles[0], grounds, time), self._goal(right, soles[1], grounds, time)
        return OperatorSample(self._clock.newest, feet, body=self._body, upright=self._upright)

    def let_go(self, status: DeviceStatus) -> None:
        """Disengage both feet, which the robot leads by itself, with a status that says why."""
        for tracker in self._feet:
            tracker.lose()
        self.held, self.status = (False, False), status

    def _goal(
        self,
        tracker: Tracker,
        sole: Float64[np.ndarray, "3"],
        grounds: Sequence[Float64[np.ndarray, "3"]],
        time: float,
    ) -> TrackedPose:
        """Place of a device that leads; straight down without one."""
        if tracker.engaged:
            return TrackedPose(tracker.place, velocity=tracker.velocity(time))
        lowest = min(float(ground[2]) for ground in grounds)
        return TrackedPose((float(sole[0]), float(sole[1]), lowest - self._depth))

    def _take(self, news: OperatorSample | None, time: float) -> None:
        self._walk.expire(time)
        self._look.expire(time)
        parts = (None, None) if news is None else news.hands
        for hand, part in zip(self.hands, parts, strict=True):
            if part is not None or hand.engaged:
                hand.update(part, time)
        self.rest = news is not None and news.rest
        if news is not None:
            self._upright = news.upright
            if news.body != self._body and all(map(math.isfinite, news.body.numbers)):
                self._body = news.body
            self._steer(news.velocity, time)
            if news.head is not None:
                self._turn_head(news.head, time)
        if not self._walk.engaged:
            self.velocity = (0.0, 0.0, 0.0)
        if not self._look.engaged:
            self.head = None

    def _steer(self, velocity: Vector, time: float) -> None:
        """A velocity counts after one of zero: a stick that was held when it was found does not."""
        ahead, aside, turn = map(abs, velocity)
        if ahead <= _STICK_REST and aside <= _STICK_REST and turn <= _STICK_TURN_REST:
            self._walk.release(time)
            return
        if not all(map(math.isfinite, velocity)):
            return
        self._walk.engage()
        if self._walk.engaged:
            self.velocity = velocity
            self._walk.refresh(time)

    def _turn_head(self, head: TrackedPose, time: float) -> None:
        if not head.clutch:
            self._look.release(time)
            return
        rotation = None if head.orientation is None else rotation_of(head.orientation)
        if rotation is not None:
            begins = self._look.engage()
            if self._look.engaged and (begins or not is_turned_away(rotation, self.head)):
                self.head = rotation
                self._look.refresh(time)

    def _status(self, time: float) -> DeviceStatus:
        left, right = self.held
        if not (left or right):
            return DeviceStatus.LOST if self._clock.is_lost(time) else DeviceStatus.WAITING
        # The robot's clock may have gone back.
        silent = abs(time - self._came_at) > SILENT_AFTER
        if self._refused and not silent:
            return DeviceStatus.REFUSED
        if not (left and right):
            return DeviceStatus.WAITING
        return DeviceStatus.STALE if silent else DeviceStatus.OK
