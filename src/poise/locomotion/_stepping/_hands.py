"""`HandLeader`: arms that follow the operator's hands, whatever leads the feet.

`HandGrip`: how one device leads its hand: while its clutch is closed, by its motion alone.
`HandStatus`: what a hand does.
"""

import math
from enum import Enum

import numpy as np
from jaxtyping import Float64

from poise._checks import checked_number
from poise.dynamics import RobotState
from poise.locomotion._stepping._arms import ArmMotion
from poise.locomotion._stepping._guard import Pursuit, SampleClock, is_point
from poise.locomotion._stepping._samples import DeviceSample, HandSample
from poise.robots import Robot
from poise.stack import JointTask


class HandStatus(Enum):
    """What a hand does."""

    REST = "at rest, or on its way there"
    HELD = "stays where it was let go"
    LED = "follows its device"
    REACH = "at the edge of its reach: it comes no further"


_START, _JUMP = 0.06, 0.3
"""How far a device is followed at once, and beyond what distance it is another thing [m]."""

_LATE, _LOST_AFTER = 0.5, 0.5
"""Largest difference of two samples' delays, and silence after which a device is lost [s]."""

_KP_REST, _KP_LED = 25.0, 150.0
"""Stiffness of the arms' joints at rest, where it is that of the posture, and led [1/s^2]."""

_STIFFEN = 0.5
"""How long arms take to become stiff when a hand is led, and soft again at rest [s]."""

_KI, _BIAS_MAX = 150.0, 30.0
"""How fast what led joints lag by becomes a bias [1/s^3], for what a hand carries and nobody knows
of; and the largest one [rad/s^2]."""

_EDGE = 0.03
"""At the edge of its reach a hand's place is no further ahead than this [m]: when the device comes
back, so does the hand at once."""


class HandGrip:
    """How one device leads its hand.

    The device takes hold where the hand is when its clutch closes, which has to be seen: one that
    is closed when it is found, or found again, leads nothing until it was open. From then on its
    motion counts, at `speed_max` on average at most and in any time t by no more than 6 cm +
    `speed_max` t. A place that no hand got to, more than 30 cm away, is refused; a device without a
    good sample for half a second lets go.

    Args:
        dt: length of a tick [s].
        speed_max: largest speed at which a device is followed [m/s].

    Attributes:
        holds: whether the device leads its hand.
    """

    def __init__(self, dt: float, speed_max: float) -> None:
        self._pursuit = Pursuit(dt * speed_max, _START)
        self._was_open = self.holds = False
        self._place: list[float] = [0.0] * 3
        self._goal: list[float] = [0.0] * 3
        self._good_at = -math.inf

    def update(self, sample: HandSample | None, time: float) -> Float64[np.ndarray, "3"]:
        """Takes one tick.

        Args:
            sample: what came; None for nothing new.
            time: of the robot [s].

        Returns:
            How far the device moved that holds its hand [m].
        """
        if self.holds and time - self._good_at > _LOST_AFTER:
            self.holds = self._was_open = False
        if sample is not None:
            self._take(sample, time)
        if not self.holds:
            return np.zeros(3)
        before, self._place = self._place, self._pursuit.follow(self._place, self._goal)
        return np.subtract(self._place, before)

    def _take(self, sample: HandSample, time: float) -> None:
        if not sample.clutch:
            self.holds, self._was_open = False, True
            return
        if not is_point(sample.position):
            return
        point: list[float] = sample.position.tolist()
        if not self.holds and self._was_open:
            self.holds, self._was_open, self._place = True, False, point
            self._goal, self._good_at = point, time
        elif self.holds and math.dist(point, self._place) <= _JUMP:
            self._goal, self._good_at = point, time


class HandLeader:
    """Leads the arms by an operator's hands, or brings them back to rest.

    What counts is the motion of a device while its clutch is closed, `scale` times, along the axes
    of the torso: hands go along with a body that walks, and where it leans no arm is thrown about.
    `task` has the arms' joints follow a model of the arms (`ArmMotion`), smooth and within reach.
    It belongs into a level below the balance.

    Args:
        robot: with arms or without, which is led by nothing then.
        dt: length of a tick [s].
        q_rest: configuration of the arms at rest; the robot's home when None.
        weight: of the task in its level.
        scale: motion of a hand over that of its device.
        speed_max: of a hand [m/s].
        acceleration_max: of a hand [m/s^2].

    Raises:
        ConfigurationError: a number that is not positive.

    Attributes:
        task: of the arms' joints; None without arms.
        names: of the hands that are led.
        status: what each hand does.
        places: where each hand is led to, in the torso's frame [m].
    """

    def __init__(
        self,
        robot: Robot,
        *,
        dt: float,
        q_rest: Float64[np.ndarray, " nq"] | None = None,
        weight: float = 1.0,
        scale: float = 1.0,
        speed_max: float = 1.5,
        acceleration_max: float = 5.0,
    ) -> None:
        self._dt = checked_number(dt, "dt of the hands [s]", above=0.0)
        self._scale = checked_number(scale, "scale of the hands", above=0.0)
        self._speed = checked_number(speed_max, "speed_max of the hands [m/s]", above=0.0)
        checked_number(acceleration_max, "acceleration_max of the hands [m/s^2]", above=0.0)
        self._joints = robot.nj
        self._arms = ArmMotion(
            robot,
            robot.q_home if q_rest is None else q_rest,
            dt=dt,
            speed_max=speed_max,
            acceleration_max=acceleration_max,
        )
        self.names = self._arms.names
        self.task: JointTask | None = None
        if self._arms.joints:
            self.task = JointTask(self._arms.joints, kp=_KP_REST, weight=weight, name="arms")
            self.task.bind(robot)
        self.reset()

    def reset(self) -> None:
        """Forgets the past: the arms are at rest."""
        self._arms.reset()
        self._clock = SampleClock(_LATE, _LOST_AFTER)
        self._grips = [HandGrip(self._dt, self._speed) for _ in self.names]
        self._bias, self._stiff = np.zeros(len(self._arms.joints)), 0.0
        self.places = [hand.copy() for hand in self._arms.hands]
        self.status = [HandStatus.REST for _ in self.names]
        if self.task is not None:
            self.task.set_gains(_KP_REST)
        self._set_target()

    def lead(self, sample: DeviceSample | None, state: RobotState) -> None:
        """Sets what the arms do in the tick that begins.

        Args:
            sample: what the device gave; None for nothing new.
            state: as it is measured or estimated.
        """
        if self.task is None:
            return
        news = sample if sample is not None and self._clock.takes(sample.time, state.time) else None
        for hand, grip in enumerate(self._grips):
            motion = grip.update(None if news is None else news.hands[hand], state.time)
            self.places[hand] = self.places[hand] + self._scale * motion
            if grip.holds:
                self.status[hand] = HandStatus.LED
            elif news is not None and news.rest:
                self.status[hand] = HandStatus.REST
            elif self.status[hand] is not HandStatus.REST:
                self.status[hand] = HandStatus.HELD
        rests = [status is HandStatus.REST for status in self.status]
        self._arms.advance(
            [None if rest else place for rest, place in zip(rests, self.places, strict=True)]
        )
        for hand, here in enumerate(self._arms.hands):
            self._stop_at_edge(hand, here)
        self._stiffen(led=not all(rests), state=state)
        self._set_target()

    def targets(
        self, position: Float64[np.ndarray, "3"], rotation: Float64[np.ndarray, "3 3"]
    ) -> tuple[Float64[np.ndarray, "3"], ...]:
        """Where each hand is led to in the world [m].

        Args:
            position: of the torso [m].
            rotation: world_R_torso.
        """
        return tuple(position + rotation @ place for place in self.places)

    def _stop_at_edge(self, hand: int, here: Float64[np.ndarray, "3"]) -> None:
        """A hand that comes no further says so, and its place stays near."""
        if self.status[hand] is HandStatus.REST:
            self.places[hand] = here
        elif self._arms.blocked[hand]:
            if self.status[hand] is HandStatus.LED:
                self.status[hand] = HandStatus.REACH
            way = self.places[hand] - here
            self.places[hand] = here + way * min(1.0, _EDGE / max(math.hypot(*way), 1e-9))

    def _stiffen(self, *, led: bool, state: RobotState) -> None:
        """Arms that are led are stiff, and learn what they carry; at rest they forget it."""
        change = self._dt / _STIFFEN if led else -self._dt / _STIFFEN
        before, self._stiff = self._stiff, min(max(self._stiff + change, 0.0), 1.0)
        lag = self._arms.q - state.q[-self._joints :][self._arms.index]
        bias = self._bias + self._dt * _KI * lag
        self._bias = np.clip(self._stiff * bias, -_BIAS_MAX, _BIAS_MAX)
        if self.task is not None and self._stiff != before:
            kp = _KP_REST + self._stiff * (_KP_LED - _KP_REST)
            self.task.set_gains(kp)

    def _set_target(self) -> None:
        if self.task is not None:
            self.task.set_target(self._arms.q, self._arms.v, self._arms.a + self._bias)
