"""`Device` and `ScriptedDevice`: where samples come from, and one that needs no person.

`DeviceSample` and `DeviceGuard`: what the operator commands, and whether to believe it.
`HandSample`: what is commanded of a hand. `BodySample`: of the body, and how feet are turned.
"""

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import pairwise
from typing import Annotated, Protocol, TypeGuard, runtime_checkable

import numpy as np
from jaxtyping import Float64

from poise._checks import checked_number
from poise._schema import Bounds, Seconds, Vector, checked
from poise.dynamics import least_jerk
from poise.errors import ConfigurationError


@dataclass(frozen=True, slots=True, eq=False)
class HandSample:
    """Where the operator holds the device of one hand; its motion is what counts.

    Attributes:
        position: forward, left and up, as the robot's torso faces, from anywhere that stays where
            it is [m].
        clutch: whether the hand follows. Whoever wants to reach further lets go, moves back, and
            takes hold anew; the hand stays where it is in between.
    """

    position: Float64[np.ndarray, "3"]
    clutch: bool = True


@dataclass(frozen=True, slots=True)
class BodySample:
    """What is commanded beside where feet and hands are; all zero asks for nothing.

    Attributes:
        height: of the COM, over the usual one [m].
        torso: roll, pitch and yaw against upright and facing as the feet do; where torques are
            commanded [rad].
        turns: how the left and the right foot are turned, to the left of the world's x axis; where
            torques are commanded [rad].
    """

    height: float = 0.0
    torso: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turns: tuple[float, float] = (0.0, 0.0)

    @property
    def numbers(self) -> tuple[float, float, float, float, float, float]:
        """Height, roll, pitch, yaw, and both turns."""
        return (self.height, *self.torso, *self.turns)


@dataclass(frozen=True, slots=True, eq=False)
class DeviceSample:
    """Where the operator holds the devices: two for the feet, each of the sole of its side.

    Attributes:
        time: when it was measured, on the operator's clock [s].
        left: position commanded for the left sole, in the controller's world [m].
        right: position commanded for the right sole [m].
        upright: button: bring the torso upright although one foot is in the air.
        hands: what is commanded of the left and of the right hand; None for a hand without a
            device, which stays as it is.
        rest: button: hands that are not held go back to rest.
        body: what is commanded of the body, and how the feet are turned.
        velocity: with which the robot walks by itself, ahead, to the left [m/s] and turning to the
            left [rad/s]; all zero while the operator steps. Where torques are commanded.
    """

    time: float
    left: Float64[np.ndarray, "3"]
    right: Float64[np.ndarray, "3"]
    upright: bool = False
    hands: tuple[HandSample | None, HandSample | None] = (None, None)
    rest: bool = False
    body: BodySample = BodySample()
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def position(self, foot: int) -> Float64[np.ndarray, "3"]:
        """Position commanded for a sole: 0 left, 1 right [m]."""
        return self.left if foot == 0 else self.right


class DeviceStatus(Enum):
    """What became of the last sample."""

    OK = "ok"
    STALE = "no new sample: the last one holds"
    REFUSED = "the last sample was refused: the one before holds"
    LOST = "the device stopped sending: the feet go back to the ground"
    WAITING = "bring each device down to its foot to take hold of it"
    WALKING = "the robot walks as it is told; when it stands, take hold of each foot anew"
    OVERRULED = "the robot steps by itself so as not to fall; then take hold of each foot anew"


class DeviceGuard:
    """Lets no sample through that could move a foot wildly.

    Each device holds its foot or does not. One that holds is followed at `speed_max` on average at
    most, in the robot's time and however often samples come: in any time t by no more than
    `start_max` + `speed_max` t, so that no stream of samples makes a jump. A place further than
    `jump_max` from where the device is followed to is none that a hand got to: it is refused, and
    the last place holds. So is a sample that is not finite, one that is older than the newest, and
    one whose stamp is more than `late_max` further from the newest's than the robot's time has
    passed between them: no link delays that much.

    A device that gives no good sample for `lost_after` lets go of its foot, which is then sent
    straight down. Stamps are then compared with those that come from then on: a clock that jumps
    locks nobody out. The device takes hold again where the foot is, by being put down there: no
    further than `jump_max` from the foot, and no higher than `low` above the ground. It takes hold
    for the first time in the same way.

    Args:
        dt: length of a tick [s].
        low: how far a device may be above its foot's ground to count as put down [m].
        press_depth: how far below the ground a foot without a device is sent [m].
        speed_max: largest speed at which a device is followed [m/s].
        start_max: how far one is followed at once that has not moved for a while [m].
        jump_max: largest distance of a device from where it is followed to [m].
        late_max: largest difference of two samples' delays [s].
        lost_after: [s].

    Raises:
        ConfigurationError: a number that is not positive.

    Attributes:
        status: what became of the last sample.
        velocity: with which the robot shall walk by itself; zero where nobody is heard.
    """

    def __init__(
        self,
        *,
        dt: float,
        low: float,
        press_depth: float,
        speed_max: float = 2.5,
        start_max: float = 0.06,
        jump_max: float = 0.3,
        late_max: float = 0.5,
        lost_after: float = 0.5,
    ) -> None:
        self._lost_after = checked_number(lost_after, "lost_after of the device [s]", above=0.0)
        late = checked_number(late_max, "late_max of the device [s]", above=0.0)
        self._clock = SampleClock(late, lost_after)
        self._press_depth = checked_number(press_depth, "press_depth of the device [m]", above=0.0)
        step = checked_number(dt, "dt of the device [s]", above=0.0) * checked_number(
            speed_max, "speed_max of the device [m/s]", above=0.0
        )
        start = checked_number(start_max, "start_max of the device [m]", above=0.0)
        jump = checked_number(jump_max, "jump_max of the device [m]", above=0.0)
        low = checked_number(low, "low of the device [m]", above=0.0)
        self._grips = tuple(_Grip(step, start, jump, low, lost_after) for _ in range(2))
        self._newest: DeviceSample | None = None
        self._body = BodySample()
        self.velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
        self.status = DeviceStatus.LOST

    def check(
        self,
        sample: DeviceSample | None,
        time: float,
        soles: Sequence[Float64[np.ndarray, "3"]],
        grounds: Sequence[Float64[np.ndarray, "3"]],
    ) -> DeviceSample | None:
        """The sample to follow.

        Args:
            sample: what came since the last tick, None for nothing.
            time: of the robot [s].
            soles: where the left and the right sole are [m].
            grounds: where they stood last on the ground [m].

        Returns:
            Where each device is followed to, or straight below its foot where it does not hold it;
            None while neither does.
        """
        news = sample if sample is not None and self._is_news(sample, time) else None
        if news is not None:
            self._newest = news
            if all(map(math.isfinite, news.body.numbers)):
                self._body = news.body
            if all(map(math.isfinite, news.velocity)):
                self.velocity = news.velocity
        if time - self._clock.heard_at > self._lost_after:
            self.velocity = (0.0, 0.0, 0.0)
        refused = sample is not None and news is None
        for foot, grip in enumerate(self._grips):
            point = None if news is None else news.position(foot)
            believed = grip.update(point, time, soles[foot], float(grounds[foot][2]))
            refused = refused or (grip.place is not None and point is not None and not believed)
        held = [grip.place is not None for grip in self._grips]
        self.status = self._status(held, time, refused=refused, silent=sample is None)
        if self._newest is None or not any(held):
            return None
        lowest = min(float(ground[2]) for ground in grounds) - self._press_depth
        left, right = (
            np.array([*sole[:2], lowest] if grip.place is None else grip.place)
            for grip, sole in zip(self._grips, soles, strict=True)
        )
        newest = self._newest
        return DeviceSample(newest.time, left, right, newest.upright, body=self._body)

    def let_go(self, status: DeviceStatus) -> None:
        """Both devices let go of their feet, which somebody else leads; they may take hold anew.

        Args:
            status: why.
        """
        for grip in self._grips:
            grip.place = None
        self.status = status

    def _status(
        self, held: Sequence[bool], time: float, *, refused: bool, silent: bool
    ) -> DeviceStatus:
        if not any(held):
            lost = time - self._clock.heard_at > self._lost_after
            return DeviceStatus.LOST if lost else DeviceStatus.WAITING
        if refused:
            return DeviceStatus.REFUSED
        if not all(held):
            return DeviceStatus.WAITING
        return DeviceStatus.STALE if silent else DeviceStatus.OK

    def _is_news(self, sample: DeviceSample, time: float) -> bool:
        """Whether a sample says where a device is, and is newer than the newest."""
        if not (is_point(sample.left) or is_point(sample.right)):
            return False
        return self._clock.takes(sample.time, time)


class SampleClock:
    """Says which samples are newer than the newest, and no more late than a link makes them.

    Args:
        late: largest difference of two samples' delays [s].
        lost_after: after so long without a sample any clock is believed again [s].

    Attributes:
        heard_at: when the newest came, in the robot's time [s].
    """

    def __init__(self, late: float, lost_after: float) -> None:
        self._late, self._lost_after = late, lost_after
        self._newest = -math.inf
        self.heard_at = -math.inf

    def takes(self, stamp: float, time: float) -> bool:
        """Whether a sample counts; then it is the newest.

        Args:
            stamp: its time, on the operator's clock [s].
            time: of the robot [s].
        """
        if not math.isfinite(stamp):
            return False
        passed = time - self.heard_at
        news = passed > self._lost_after or 0.0 < stamp - self._newest <= passed + self._late
        if news:
            self._newest, self.heard_at = stamp, time
        return news


class Pursuit:
    """Follows a place by no more than `start` + `step` n in any n ticks.

    Args:
        step: how far in a tick, on average [m].
        start: how far at once, after rest [m].
    """

    def __init__(self, step: float, start: float) -> None:
        self._step, self._start = step, start
        self._left = start  # Of the way that may be gone now [m].

    def follow(self, place: list[float], goal: list[float]) -> list[float]:
        """Where it is after a tick [m].

        Args:
            place: where it is now [m].
            goal: where it is led to [m].
        """
        away = math.dist(goal, place)
        most = self._left = min(self._left + self._step, self._start)
        if away <= most:
            self._left -= away
            return goal
        self._left = 0.0
        return [p + most / away * (g - p) for p, g in zip(place, goal, strict=True)]


class _Grip:
    """How one device holds its foot.

    Args:
        step: how far it is followed in a tick, on average [m].
        start: how far at once, after rest [m].
        jump: how far it may be from where it is followed to [m].
        low: how far above the ground it counts as put down [m].
        lost_after: without a good sample it lets go after this [s].

    Attributes:
        place: where it is followed to [m]; None while it does not hold its foot.
    """

    def __init__(
        self, step: float, start: float, jump: float, low: float, lost_after: float
    ) -> None:
        self._pursuit, self._jump = Pursuit(step, start), jump
        self._low, self._lost_after = low, lost_after
        self.place: list[float] | None = None
        self._goal: list[float] = [0.0] * 3
        self._good_at = -math.inf

    def update(
        self, point: object, time: float, sole: Float64[np.ndarray, "3"], ground: float
    ) -> bool:
        """Takes one tick.

        Args:
            point: where the device is now [m]; None for nothing new, and anything for a bad one.
            time: of the robot [s].
            sole: where its foot is [m].
            ground: height of the place where the foot stood last [m].

        Returns:
            Whether the point is followed.
        """
        if self.place is not None and time - self._good_at > self._lost_after:
            # For a tick at least: what is followed does not go from one place to another at once.
            self.place = None
            return False
        good = is_point(point) and self._holds(point.tolist(), time, sole, ground)
        if self.place is not None:
            self.place = self._pursuit.follow(self.place, self._goal)
        return good

    def _holds(
        self, point: list[float], time: float, sole: Float64[np.ndarray, "3"], ground: float
    ) -> bool:
        """Whether the device holds its foot, or takes hold of it now, and is to be followed."""
        if self.place is None and self._is_put_down(point, sole, ground):
            self.place = sole.tolist()
        good = self.place is not None and self._is_near(point, self.place)
        if good:
            self._goal, self._good_at = point, time
        return good

    def _is_put_down(
        self, point: list[float], sole: Float64[np.ndarray, "3"], ground: float
    ) -> bool:
        return self._is_near(point, sole.tolist()) and point[2] - ground <= self._low

    def _is_near(self, point: list[float], place: list[float]) -> bool:
        return math.dist(point, place) <= self._jump


def is_point(value: object) -> TypeGuard[np.ndarray]:
    """Whether a value is a place: a device may send anything."""
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
