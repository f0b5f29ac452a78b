"""`DeviceGuard`: whether to believe what the operator commands of the feet."""

import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64

from poise._checks import checked_number
from poise.locomotion._stepping._operator._pursuit import DeviceRate, Pursuit, is_point
from poise.locomotion._stepping._operator._sample_clock import SampleClock
from poise.locomotion._stepping._operator._samples import BodySample, DeviceSample, DeviceStatus

_STILL = (0.01, 0.01, 0.02)
"""A velocity that is no larger is none: sticks do not rest at exactly zero [m/s, m/s, rad/s]."""

_MOMENT = 0.1
"""A device that has said nothing for longer is silent [s]; slower ones than ten a second are."""


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
    for the first time in the same way. A velocity with which the robot shall walk counts once there
    was a sample without any: a stick that was held when the device was found does nothing.

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
        self._grips = tuple(_Grip(step, start, jump, low, lost_after, speed_max) for _ in range(2))
        self._newest: DeviceSample | None = None
        self._body = BodySample()
        self.velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
        self._rested, self._walked_at = False, -math.inf
        self._refused, self._said_at = False, -math.inf
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
            sample: what came since the last tick, None for nothing; the newest again is nothing.
            time: of the robot [s].
            soles: where the left and the right sole are [m].
            grounds: where they stood last on the ground [m].

        Returns:
            Where each device is followed to, or straight below its foot where it does not hold it;
            None while neither does.
        """
        if sample is not None and self._clock.is_newest(sample.time):
            sample = None
        news = sample if sample is not None and self._clock.takes(sample.time, time) else None
        if news is not None:
            self._newest = news
            if all(map(math.isfinite, news.body.numbers)):
                self._body = news.body
            if all(map(math.isfinite, news.velocity)):
                self.velocity, self._walked_at = self._walked(news.velocity), time
        if self._clock.is_lost(time) or abs(time - self._walked_at) > self._lost_after:
            self.velocity, self._rested = (0.0, 0.0, 0.0), False
        refused = news is None
        for foot, grip in enumerate(self._grips):
            point, rate = (None, None) if news is None else (news.position(foot), news.rates[foot])
            believed = grip.update(point, rate, time, soles[foot], float(grounds[foot][2]))
            refused = refused or (grip.place is not None and point is not None and not believed)
        held = self.held
        if sample is not None:
            self._refused, self._said_at = refused, time
        self.status = self._status(held, time)
        if self._newest is None or not any(held):
            return None
        lowest = min(float(ground[2]) for ground in grounds) - self._press_depth
        rates = self._grips[0].velocity(time), self._grips[1].velocity(time)
        left, right = (
            np.array([*sole[:2], lowest] if grip.place is None else grip.place)
            for grip, sole in zip(self._grips, soles, strict=True)
        )
        newest = self._newest
        return DeviceSample(newest.time, left, right, newest.upright, body=self._body, rates=rates)

    @property
    def held(self) -> tuple[bool, bool]:
        """Whether the left and the right device hold their feet."""
        left, right = self._grips
        return left.place is not None, right.place is not None

    def let_go(self, status: DeviceStatus) -> None:
        """Both devices let go of their feet, which somebody else leads; they may take hold anew.

        Args:
            status: why.
        """
        for grip in self._grips:
            grip.place = None
        self.status = status

    def _walked(self, velocity: tuple[float, float, float]) -> tuple[float, float, float]:
        """The velocity that counts: one that was there when the device was found does not."""
        if all(abs(part) <= least for part, least in zip(velocity, _STILL, strict=True)):
            self._rested = True
            return (0.0, 0.0, 0.0)
        return velocity if self._rested else (0.0, 0.0, 0.0)

    def _status(self, held: Sequence[bool], time: float) -> DeviceStatus:
        if not any(held):
            return DeviceStatus.LOST if self._clock.is_lost(time) else DeviceStatus.WAITING
        # The robot's clock may have gone back.
        silent = abs(time - self._said_at) > _MOMENT
        if self._refused and not silent:
            return DeviceStatus.REFUSED
        if not all(held):
            return DeviceStatus.WAITING
        return DeviceStatus.STALE if silent else DeviceStatus.OK


class _Grip:
    """How one device holds its foot.

    Args:
        step: how far it is followed in a tick, on average [m].
        start: how far at once, after rest [m].
        jump: how far it may be from where it is followed to [m].
        low: how far above the ground it counts as put down [m].
        lost_after: without a good sample it lets go after this [s].
        fastest: velocity that no hand has [m/s].

    Attributes:
        place: where it is followed to [m]; None while it does not hold its foot.
    """

    def __init__(
        self,
        step: float,
        start: float,
        jump: float,
        low: float,
        lost_after: float,
        fastest: float,
    ) -> None:
        self._rate = DeviceRate(fastest)
        self._pursuit, self._jump = Pursuit(step, start), jump
        self._low, self._lost_after = low, lost_after
        self.place: list[float] | None = None
        self._goal: list[float] = [0.0] * 3
        self._good_at = -math.inf

    def update(
        self,
        point: object,
        rate: object,
        time: float,
        sole: Float64[np.ndarray, "3"],
        ground: float,
    ) -> bool:
        """Takes one tick.

        Args:
            point: where the device is now [m]; None for nothing new, and anything for a bad one.
            rate: how fast it moves [m/s]; likewise.
            time: of the robot [s].
            sole: where its foot is [m].
            ground: height of the place where the foot stood last [m].

        Returns:
            Whether the point is followed.
        """
        # The robot's clock may have gone back.
        if self.place is not None and abs(time - self._good_at) > self._lost_after:
            # For a tick at least: what is followed does not go from one place to another at once.
            self.place = None
            return False
        good = is_point(point) and self._holds(point.tolist(), time, sole, ground)
        if good:
            self._rate.tell(rate, self._goal, time)
        if self.place is not None:
            self.place = self._pursuit.follow(self.place, self._goal)
        return good

    def velocity(self, time: float) -> Float64[np.ndarray, "3"] | None:
        """How fast it says that it moves [m/s]; None where it does not, or does not hold its foot.

        Args:
            time: of the robot [s].
        """
        return None if self.place is None else self._rate.at(time)

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
