"""Operator guard: `SampleClock`, `Engagement`, `Tracker` and `OperatorGuard`."""

import math
from collections.abc import Sequence
from enum import Enum

import numpy as np
import pinocchio as pin

from poise._checks import checked_number
from poise.dynamics import rotation_vector
from poise.locomotion._stepping._sample import (
    BodyCommand,
    Device,
    OperatorSample,
    TrackedPose,
    Vector,
    WarnOnce,
    checked_sample,
)
from poise.locomotion._support import Rotation, Vector3

# Period of the slowest device that is followed without gaps [s]: hands move at 5 Hz at most,
# and ten samples a second are the fewest that show it
SLOWEST = 0.1
SILENT_AFTER = SLOWEST  # without a new sample for longer a velocity is unknown [s]
# Without a good sample for longer a device is lost [s]: a link that drops every fourth sample
# drops five in a row once in a thousand
LOST_AFTER = 5 * SLOWEST
LATE = LOST_AFTER  # a sample that is later than the soonest by this counts as lost [s]
_DRIFT = 1e-3  # part of the time by which two clocks drift apart: ten times what quartz does


class SampleClock:
    """Accept samples that are newer than the newest and no later than a link makes them."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Accept any clock from now on."""
        self.newest = self.heard_at = -math.inf
        self._soonest = math.inf

    def accepts(self, stamp: float, time: float) -> bool:
        """Return whether a sample counts, which makes it the newest."""
        # Otherwise a frozen source would be heard for ever.
        if not math.isfinite(stamp) or stamp == self.newest:
            return False
        soonest = time - stamp
        if not self.is_lost(time) and self.newest > -math.inf:
            if not 0.0 < stamp - self.newest <= time - self.heard_at + LATE:
                return False
            soonest = min(soonest, self._soonest + _DRIFT * (time - self.heard_at))
        if time - stamp - soonest > LATE:
            return False
        self.newest, self.heard_at, self._soonest = stamp, time, soonest
        return True

    def lateness(self, stamp: float, time: float) -> float:
        """Return the delay of a sample over the least delay [s]."""
        return time - stamp - self._soonest

    def is_lost(self, time: float) -> bool:
        """Return whether nothing was heard for too long."""
        return abs(time - self.heard_at) > LOST_AFTER


class Engagement:
    """Engagement of a part: from an observed closing of its clutch until that opens."""

    def __init__(self) -> None:
        self.engaged = self._released = False
        self._good_at = -math.inf

    def expire(self, time: float) -> bool:
        """Disengage a lost part; return whether it was engaged until now."""
        engaged = self.engaged
        if abs(time - self._good_at) > LOST_AFTER:
            self.lose()
        return engaged and not self.engaged

    def lose(self) -> None:
        """Disengage until the part has been released and then closed."""
        self.engaged = self._released = False

    def release(self, time: float) -> None:
        """Note an open clutch, at a time of the robot [s]."""
        self.engaged, self._released, self._good_at = False, True, time

    def engage(self, time: float) -> bool:
        """Record a valid sample with a closed clutch; return True while the part is engaged."""
        if self.engaged or self._released:
            self.engaged, self._released, self._good_at = True, False, time
        return self.engaged


# Largest speed at which a part is followed [m/s]: a foot in a brisk walk, a hand that reaches
SPEED_MAX = 2.5
# Distance that is followed without delay after rest [m]: one period of a tracker of 40 Hz
BURST = 0.06
# A sample farther away is another thing's [m]: one period of the slowest device at `SPEED_MAX`
JUMP = SPEED_MAX * SLOWEST + BURST
TURN_SPEED_MAX = 3.0  # of a hand that is tracked [rad/s]: the speed of robots' wrists
# Turn that is followed without delay after rest [rad]: one period of a tracker of 25 Hz, for a
# wrist that is flicked runs ahead of what follows it
TURN_BURST = TURN_SPEED_MAX / 25.0
# Distance between place and integrated velocity [m]: a device may read its own velocity two
# periods of a tracker of 100 Hz late
VELOCITY_ERROR = SPEED_MAX * 0.02


class RateLimiter:
    """Rate-limit a motion: in any n ticks no more than `burst` + n `step`."""

    def __init__(self, step: float, burst: float) -> None:
        self._step, self._burst = step, burst
        self._room = burst

    def part(self, distance: float) -> float:
        """Limit a displacement to that of one tick; return the allowed fraction."""
        most = self._room = min(self._room + self._step, self._burst)
        self._room = max(most - distance, 0.0)
        return 1.0 if distance <= most else most / distance

    def turn(self, rotation: Rotation, goal: Rotation) -> tuple[Rotation, Vector3]:
        """Take one tick of a turn."""
        if rotation is goal:
            return goal, np.zeros(3)
        way = rotation_vector(goal, rotation)
        part = self.part(math.hypot(*way))
        way = part * way
        return (goal if part == 1.0 else pin.exp3(way) @ rotation), way


class VelocityCheck:
    """Velocity that a device sends, for as long as its position moves accordingly."""

    def __init__(self) -> None:
        self._velocity: Vector | None = None
        self._at = -math.inf
        self._sent = self._place = self._apart = np.zeros(3)

    def update(self, velocity: Vector | None, place: Vector, time: float) -> None:
        """Store the values of a valid sample."""
        self._velocity = None
        # Not a number is no smaller either.
        if velocity is None or not math.hypot(*velocity) <= SPEED_MAX:
            return
        since, sent, here = time - self._at, np.array(velocity), np.array(place)
        if 0.0 <= since <= SILENT_AFTER:
            apart = self._apart + 0.5 * since * (self._sent + sent) - (here - self._place)
            # Forgotten no sooner than a velocity counts.
            self._apart = (1.0 - since / (2.0 * SILENT_AFTER)) * apart
        else:
            self._apart = np.zeros(3)
        self._sent, self._place, self._at = sent, here, time
        if math.hypot(*self._apart) <= VELOCITY_ERROR:
            self._velocity = velocity

    def at(self, time: float) -> Vector | None:
        """Return the velocity at a time of the robot [m/s]; None where it is unknown."""
        return self._velocity if 0.0 <= time - self._at <= SILENT_AFTER else None


class Tracker(Engagement):
    """Track a foot or a hand of the operator while it is engaged."""

    def __init__(self, dt: float) -> None:
        super().__init__()
        self._limiter = RateLimiter(dt * SPEED_MAX, BURST)
        self._turning = RateLimiter(dt * TURN_SPEED_MAX, TURN_BURST)
        self._velocity = VelocityCheck()
        self.place: Vector = (0.0, 0.0, 0.0)
        self._goal = self._before = self.place
        self._rotation: Rotation | None = None
        self._turn_goal: Rotation | None = None
        self.turn: Vector3 = np.zeros(3)

    @property
    def turns(self) -> bool:
        """True where the orientation is engaged, too."""
        return self.engaged and self._rotation is not None

    @property
    def step(self) -> Vector3:
        """Displacement in the last tick [m]."""
        return np.subtract(self.place, self._before)

    def velocity(self, time: float) -> Vector | None:
        """Return its velocity at a time of the robot [m/s]; None while unknown or not engaged."""
        return self._velocity.at(time) if self.engaged else None

    def update(
        self, part: TrackedPose | None, time: float, *, foot: tuple[Vector, float] | None = None
    ) -> bool:
        """Take one tick; return whether a sample is good."""
        self._before, self.turn = self.place, np.zeros(3)
        # For a tick at least: what is followed does not jump from one place to another.
        if self.expire(time):
            return False
        good = part is not None and self._accepts(part, time, foot)
        if not self.engaged:
            return good
        if self._rotation is not None and self._turn_goal is not None:
            self._rotation, self.turn = self._turning.turn(self._rotation, self._turn_goal)
        before, goal = self.place, self._goal
        self._before, share = before, self._limiter.part(math.dist(goal, before))
        if share < 1.0:
            (x, y, z), (to_x, to_y, to_z) = before, goal
            goal = (x + share * (to_x - x), y + share * (to_y - y), z + share * (to_z - z))
        self.place = goal
        return good

    def _accepts(self, part: TrackedPose, time: float, foot: tuple[Vector, float] | None) -> bool:
        """Engage, follow or refuse a sample."""
        point, rotation, begins = part.position, rotation_of(part.orientation), not self.engaged
        if foot is not None:
            rotation = None
            # A tracker's position is in no world; `FootTracker` makes a place of it.
            if part.clutch is not None:
                return False
        elif not part.clutch:
            self.release(time)
            return False
        elif rotation is None and part.orientation is not None:
            return False
        if point is None:
            return False
        here = self.place
        if begins:
            here, self._rotation = point if foot is None else foot[0], None
        # Not a number is nowhere near.
        if not math.dist(point, here) <= JUMP or is_turned_away(rotation, self._rotation):
            return False
        if begins and foot is not None:
            if point[2] > foot[1]:
                return False
            self.release(time)
        if not self.engage(time):
            return False
        if rotation is None or self._rotation is None:
            self._rotation = rotation
        self.place, self._goal, self._turn_goal = here, point, rotation
        self._velocity.update(part.velocity, point, time)
        return True


def is_turned_away(rotation: Rotation | None, before: Rotation | None) -> bool:
    """Return whether a rotation is so far from the one before that it is another thing's."""
    if rotation is None or before is None:
        return False
    # A wrist that is flicked turns at 12 rad/s.
    return math.hypot(*rotation_vector(rotation, before)) > 12.0 * SLOWEST


def rotation_of(quaternion: Sequence[float] | None) -> Rotation | None:
    """Return the rotation matrix of a unit quaternion (x, y, z, w); None for what is none."""
    if quaternion is None:
        return None
    length = math.hypot(*quaternion)
    # Messages round to two figures; not a number is not near one either.
    if not abs(length - 1.0) <= 0.01:
        return None
    return pin.Quaternion(np.array(quaternion) / length).toRotationMatrix()


class DeviceStatus(Enum):
    """Fate of the last sample."""

    OK = "ok"
    STALE = "no new sample for a moment: the last one holds"
    REFUSED = "the last sample was refused: the one before holds"
    LOST = "the device stopped sending: the robot comes to rest"
    WAITING = "bring each device down to its foot to take hold of it"
    WALKING = "the robot walks as it is told; when it stands, take hold of each foot anew"
    OVERRULED = "the robot steps by itself so as not to fall; then take hold of each foot anew"


class OperatorGuard:
    """Reject stale, out-of-order or implausible samples, and rate-limit the others.

    A sample counts once, if it is newer than the newest and no more than `LATE` later than the
    soonest (`SampleClock`). Feet and hands are followed by a `Tracker` each, without jumps; a part
    that is lost for `LOST_AFTER`, or found far away, engages again: a foot by being put down at the
    robot's foot, a hand or head by a clutch that was open before, a velocity after one of zero. A
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
        self.head: Rotation | None = None
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
        soles: Sequence[Vector3] = (),
        grounds: Sequence[Vector3] = (),
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
        parts = (None, None) if news is None else news.feet
        for tracker, part, sole, ground in zip(self._feet, parts, soles, grounds, strict=False):
            (x, y, z), highest = sole.tolist(), float(ground[2]) + self._low
            good = tracker.update(part, time, foot=((x, y, z), highest))
            refused = refused or (tracker.engaged and part is not None and not good)
        left, right = self._feet
        self.held = left.engaged, right.engaged
        if sample is not None:
            self._refused, self._came_at = refused, time
        self.status = self._status(time)
        if not any(self.held):
            return None
        feet = self._goal(left, soles[0], grounds, time), self._goal(right, soles[1], grounds, time)
        return OperatorSample(self._clock.newest, feet, body=self._body, upright=self._upright)

    def let_go(self, status: DeviceStatus) -> None:
        """Disengage both feet while the robot steps autonomously, with the reason as status."""
        for tracker in self._feet:
            tracker.lose()
        self.held, self.status = (False, False), status

    def _goal(
        self, tracker: Tracker, sole: Vector3, grounds: Sequence[Vector3], time: float
    ) -> TrackedPose:
        """Position of an engaged device; straight down without one."""
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
        # Sticks do not rest at exactly zero [m/s, rad/s].
        if ahead <= 0.01 and aside <= 0.01 and turn <= 0.02:
            self._walk.release(time)
            return
        if not all(map(math.isfinite, velocity)):
            return
        if self._walk.engage(time):
            self.velocity = velocity

    def _turn_head(self, head: TrackedPose, time: float) -> None:
        if not head.clutch:
            self._look.release(time)
            return
        rotation = rotation_of(head.orientation)
        if rotation is None or is_turned_away(rotation, self.head):
            return
        if self._look.engage(time):
            self.head = rotation

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
