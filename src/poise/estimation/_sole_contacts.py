"""`SoleContacts`: contact points of the filter come, correct it, and go."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float64

from poise.estimation._config import EstimatorConfig
from poise.estimation._filter import InvariantFilter
from poise.estimation._soles import SeenSole
from poise.robots import Robot

_CERTAIN = 0.95
"""Probability of contact above which a sole is taken not to turn either."""

_CLEAR = 0.02
"""A sole that carries nothing and is so high above those that do is in the air [m]."""

_LOST_TIME, _LOST_SPEED = 0.3, 2.0
"""Where all soles in contact seem to move for so long [s], it is rather the estimate that is wrong,
and its velocity becomes less sure from then on, by so much [m/s/sqrt(Hz)]."""

_ROLLING = 0.02
"""Density of the walk of a sole that leans with its leg and rolls over its edges: its middle is
5 cm from them, goes up and down at some 5 cm/s for a fraction of a second [m/s/sqrt(Hz)]."""

_EYE = np.eye(3)


class SoleContacts:
    """Which soles are at rest on the ground, and what that says of the robot.

    Args:
        robot: whose soles.
        config: what is believed of sensors and contact.
        corrected: the filter, with a contact point for each sole.
        soles: as they are seen, up to date in each update.

    Attributes:
        probability: of contact, by sole.
        walks: densities of the noise with which contact points move until the next update
            [m/s/sqrt(Hz)].
    """

    def __init__(
        self,
        robot: Robot,
        config: EstimatorConfig,
        corrected: InvariantFilter,
        soles: Sequence[SeenSole],
    ) -> None:
        self._names, self._weight = tuple(robot.soles), robot.weight
        self._leans = [sole.leans for sole in robot.soles.values()]
        self._config, self._filter, self._soles = config, corrected, soles
        self._point = config.point**2 * _EYE
        self.walks = np.zeros(len(self._names))
        self.reset()

    def reset(self) -> None:
        """Forgets the past; the filter's contact points are whose they are."""
        self.probability = dict.fromkeys(self._names, 0.0)
        self._time, self._fitted = math.nan, -math.inf
        self._slip_end = dict.fromkeys(self._names, -math.inf)

    @property
    def slipping(self) -> tuple[str, ...]:
        """The soles that are taken to slip."""
        return tuple(name for name in self._names if self._time < self._slip_end[name])

    @property
    def airborne(self) -> list[bool]:
        """Which soles are clear of the ground that others stand on, as of the last update.

        None while none carries: a robot that is let down slowly touches the ground with both.
        """
        held, up = self._filter.held, self._filter.rotation[2]
        heights = [float(up.dot(sole.offset)) for sole in self._soles]
        carrying = [height for height, carries in zip(heights, held, strict=True) if carries]
        ground = max(carrying, default=math.inf)
        return [
            not carries and height - ground > _CLEAR
            for height, carries in zip(heights, held, strict=True)
        ]

    def begin(self, time: float) -> None:
        """The filter has been started, and nothing contradicts it.

        Args:
            time: now [s].
        """
        self._time = self._fitted = time

    def release(self, time: float) -> None:
        """All contacts begin anew.

        Args:
            time: now [s].
        """
        for contact in range(len(self._names)):
            self._filter.release(contact)
        self._slip_end = dict.fromkeys(self._names, -math.inf)
        self.begin(time)

    def update(
        self,
        time: float,
        dt: float,
        wrenches: Mapping[str, Float64[np.ndarray, "6"]],
        turning: Float64[np.ndarray, "3"],
        *,
        fresh: bool,
    ) -> None:
        """Takes in one measurement.

        Args:
            time: of it [s].
            dt: since the last one [s].
            wrenches: of the soles; where there are none at all, all are taken to be pressed.
            turning: what the gyro says [rad/s].
            fresh: whether it says so now.
        """
        self._time, c = time, self._config.contact
        rate = turning - self._filter.gyro_bias
        variance = self._config.encoder**2
        for contact, (name, sole) in enumerate(zip(self._names, self._soles, strict=True)):
            pressed = self._pressed(name, wrenches)
            probability = pressed * self._resting(sole, rate)
            self.probability[name] = probability
            spread = variance * sole.spread + self._point
            if not self._filter.held[contact]:
                if pressed > c.begin:
                    self._filter.hold(contact, sole.offset, spread)
            elif pressed < c.end:
                self._filter.release(contact)
            else:
                self._correct(contact, name, sole, spread)
                if fresh and probability > _CERTAIN and not self._leans[contact]:
                    self._correct_bias(sole, turning, dt)
            walk = self._walk(name, probability)
            self.walks[contact] = max(walk, _ROLLING) if self._leans[contact] else walk
        if not self._filter.holds:
            self._fitted = time
        elif time - self._fitted > _LOST_TIME:
            self._filter.loosen(velocity=_LOST_SPEED * math.sqrt(dt))

    def _correct(
        self, contact: int, name: str, sole: SeenSole, spread: Float64[np.ndarray, "3 3"]
    ) -> None:
        """By a contact point at rest; one that cannot be at rest is put down anew, as slipping."""
        c = self._config.contact
        distance = self._filter.innovate(contact, sole.offset, spread)
        if distance <= c.gate:
            self._filter.correct()
            if self.probability[name] > c.end:
                self._fitted = self._time
        else:
            self._slip_end[name] = self._time + c.slip_time
            self._filter.hold(contact, sole.offset, spread)

    def _correct_bias(self, sole: SeenSole, rate: Float64[np.ndarray, "3"], dt: float) -> None:
        """A sole at rest does not turn, so the kinematics say how the base does."""
        c = self._config.contact
        turn = (c.turn**2 + c.shake**2 * float(rate.dot(rate))) / dt
        spread = self._config.joint_velocity**2 * sole.turning_spread + turn * _EYE
        distance = self._filter.innovate_bias(rate + sole.turning, spread)
        if distance <= c.gate:
            self._filter.correct()

    def _walk(self, name: str, probability: float) -> float:
        """Density of the noise with which a contact point moves."""
        c = self._config.contact
        if self._time < self._slip_end[name]:
            return c.slip
        return c.rest + (1.0 - probability) * (c.slip - c.rest)

    def _pressed(self, name: str, wrenches: Mapping[str, Float64[np.ndarray, "6"]]) -> float:
        """Probability of contact by the normal force."""
        c, wrench = self._config.contact, wrenches.get(name)
        if wrench is None:
            return 0.0 if wrenches else 1.0
        return _logistic((float(wrench[2]) / self._weight - c.load) / c.load_width)

    def _resting(self, sole: SeenSole, rate: Float64[np.ndarray, "3"]) -> float:
        """Probability of rest by the speed that the estimate gives a sole."""
        c, f = self._config.contact, self._filter
        # A few numbers are several times as quick as such than as arrays.
        (x, y, z), (a, b, g) = sole.offset.tolist(), rate.tolist()
        along, aside, up = sole.speed.tolist()
        along, aside, up = along + b * z - g * y, aside + g * x - a * z, up + a * y - b * x
        turned = (r * along + s * aside + t * up for r, s, t in f.rotation.tolist())
        velocity = [v + w for v, w in zip(f.velocity.tolist(), turned, strict=True)]
        return _logistic((c.speed - math.hypot(*velocity)) / c.speed_width)


def _logistic(x: float) -> float:
    """1 / (1 + exp(-x)) without overflow; zero for NaN."""
    if not x > -700.0:
        return 0.0
    return 1.0 / (1.0 + math.exp(-x))
