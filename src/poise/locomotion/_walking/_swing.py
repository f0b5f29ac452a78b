"""Trajectories of a swing foot: `SwingShape`, `SwingPose`, `SwingFoot`."""

import math
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._checks import checked_number
from poise.dynamics import least_jerk
from poise.errors import ConfigurationError
from poise.locomotion._support import Point, Rotation, Vector3
from poise.locomotion._walking._ground import CLEARANCE, LEVEL, Ground, Placement

RISE = 0.45
"""Phase of the swing at which a foot is at its apex."""


@dataclass(frozen=True, kw_only=True)
class SwingShape:
    """The shape of one swing, over its phase from 0 at lift-off to 1 at touchdown."""

    apex: float  # highest point of the sole, in the world [m]
    depart: float = 0.0  # phase until which the foot goes straight up
    arrive: float = 0.93  # phase at which it is over its goal; from then on, it comes straight down

    def __post_init__(self) -> None:
        if not math.isfinite(self.apex):
            raise ConfigurationError(
                "apex of a swing is not finite", got=self.apex, wanted="a height [m]"
            )
        checked_number(self.depart, "departure of a swing")
        if not self.depart < self.arrive <= 1.0:
            raise ConfigurationError(
                "a swing arrives before it departs, or after its end",
                got=(self.depart, self.arrive),
                wanted="0 <= depart < arrive <= 1",
            )

    def progress(self, phase: float) -> float:
        """Ratio of the horizontal displacement that is behind at a phase."""
        return least_jerk(phase, self.depart, self.arrive - self.depart)[0]

    def height(self, phase: float, begin: float, end: float) -> tuple[float, float, float]:
        """Height of the sole between lift-off and touchdown."""
        apex = max(self.apex, begin, end)
        if phase < RISE:
            ratio, rate, second = least_jerk(phase, 0.0, RISE)
            return begin + ratio * (apex - begin), rate * (apex - begin), second * (apex - begin)
        ratio, rate, second = least_jerk(phase, RISE, 1.0 - RISE)
        return apex + ratio * (end - apex), rate * (end - apex), second * (end - apex)


_SWINGS = ((0.0, 0.93), (0.1, 0.9), (0.15, 0.85), (0.2, 0.8), (0.25, 0.75), (0.3, 0.7))
"""Departure and arrival of a swing, from the smoothest to the one that clears most."""

_SAMPLES = 41
"""Moments at which a swing is looked at."""


def clear_swing(
    begin: Placement,
    goal: Placement,
    size: tuple[float, float],
    height: float,
    ground: Ground,
    number: int,
) -> SwingShape:
    """The smoothest swing above everything that lies under it."""
    high = max(begin.position[2], goal.position[2]) + height
    if not ground.platforms:
        return SwingShape(apex=high)
    phases = np.linspace(0.0, 1.0, _SAMPLES).tolist()
    for depart, arrive in _SWINGS:
        shape = SwingShape(apex=high, depart=depart, arrive=arrive)
        under = [_highest(begin, goal, shape.progress(p), size, ground) for p in phases]
        # What lies between may be higher than both ends.
        apex = max(high, max(under) + height)
        shape = SwingShape(apex=apex, depart=depart, arrive=arrive)
        if _is_clear(shape, begin.position[2], goal.position[2], phases, under):
            return shape
    raise ConfigurationError(
        f"step {number} of the walk would knock against a platform",
        got=f"swing_height {height:g} m",
        wanted="a higher swing, or other steps",
    )


def led_swing(
    begin: Placement,
    goal: Placement,
    size: tuple[float, float],
    height: float,
    ground: Ground,
    depth: float,
) -> SwingShape:
    """A swing whose goal may move: above all platforms where there is one, else the smoothest."""
    if ground.platforms:
        # A swing that would knock against one is made all the same: it may catch the robot.
        with suppress(ConfigurationError):
            return clear_swing(begin, goal, size, height, ground, 0)
    apex = max(begin.position[2], goal.position[2]) + height
    return SwingShape(apex=apex, arrive=1.0 - sinking_phase(depth, apex - goal.position[2]))


def sinking_phase(depth: float, fall: float) -> float:
    """Return the phase in which a foot goes from the ground to the depth at which it aims."""
    # At its end a quintic of least jerk is 10 H s^3 above where it ends, s the time left over all.
    if depth <= 0.0:
        return 0.0
    return (1.0 - RISE) * (0.1 * depth / (depth + max(fall, 0.0))) ** (1 / 3)


def _highest(
    begin: Placement, goal: Placement, ratio: float, size: tuple[float, float], ground: Ground
) -> float:
    """The highest ground under a sole between two places, with a margin around it [m]."""
    x, y = (a + ratio * (b - a) for a, b in zip(begin.position[:2], goal.position[:2], strict=True))
    place = Placement(position=(x, y, 0.0), yaw=begin.yaw + ratio * (goal.yaw - begin.yaw))
    grown = (size[0] + 2.0 * CLEARANCE, size[1] + 2.0 * CLEARANCE)
    return float(ground.heights(place.grid(*grown)).max())


def _is_clear(
    shape: SwingShape, begin: float, end: float, phases: list[float], under: list[float]
) -> bool:
    """Return whether a sole is clear of all that is higher than both ends of its swing."""
    for phase, ground in zip(phases, under, strict=True):
        own = begin if phase < RISE else end
        if ground > own + LEVEL and shape.height(phase, begin, end)[0] < ground + CLEARANCE:
            return False
    return True


FIXED = 0.06
"""The goal does not move any more when the foot is this near to its arrival [s]."""

_FREED = 0.03
"""Height at which a foot that was held on its way up goes on [m]."""

CLEAR = 0.02
"""Height above where it stood from which a swing foot is free to move and turn [m]."""

_SEARCH_SPEED, _SEARCH_ACCELERATION = 0.5, 8.0
"""Descent of a foot that has found no ground [m/s, m/s^2]: what it lacks in height the robot
falls, meanwhile, to the side where the foot should be."""


Motion = tuple[float, float, float]
"""Position [m], velocity [m/s] and acceleration [m/s^2] along one axis of the world; or angles."""


class SwingPose:
    """Pose of a swing foot with its rates."""

    def __init__(self, position: Vector3, rotation: Rotation) -> None:
        self.position, self.rotation = position.copy(), rotation.copy()
        self.velocity: Float64[np.ndarray, "6"] = np.zeros(6)  # linear, angular [m/s, rad/s]
        self.acceleration: Float64[np.ndarray, "6"] = np.zeros(6)  # the same [m/s^2, rad/s^2]
        self._lift_off_height = float(position[2])

    @property
    def slant(self) -> float:
        """Height on the line from lift-off to the goal, over which height counts ahead [m]."""
        return self._lift_off_height


class SwingFoot(SwingPose):
    """Position and orientation of a foot from lift-off to touchdown, with rates."""

    def __init__(
        self,
        position: Vector3,
        rotation: Rotation,
        goal: Placement,
        shape: SwingShape,
        duration: float,
        search_depth: float,
    ) -> None:
        super().__init__(position, rotation)
        self.goal, self.duration = goal, duration
        self.elapsed = 0.0
        self._shape = shape
        self._clears = self._lift_off_height
        self._depth = search_depth
        self._start_rotation = self.rotation
        self._turn = pin.log3(goal.rotation @ rotation.T)
        x, y, _ = position.tolist()
        self._x, self._y = (x, 0.0, 0.0), (y, 0.0, 0.0)
        self._search: tuple[float, float] | None = None

    @property
    def phase(self) -> float:
        """Zero at lift-off, one when the foot is due; above while it looks for the ground."""
        return self.elapsed / self.duration

    @property
    def slant(self) -> float:
        """Height on the line from lift-off to the goal, over which height counts ahead [m]."""
        begin, end = self._lift_off_height, self.goal.position[2]
        return begin + min(self.phase, 1.0) * (end - begin)

    @property
    def searching(self) -> bool:
        """True while it looks for the ground."""
        return self._search is not None

    def search(self) -> None:
        """The foot should have met the ground, and has not: goes on down until it does."""
        if self._search is None:
            self._search = float(self.position[2]), float(self.velocity[2])

    def search_again(self) -> None:
        """Go on down from ground that does not carry, slowly at first."""
        self._search = float(self.position[2]), 0.0

    def rise_at(self, x: float, y: float) -> None:
        """Goes straight up at a place before it goes on along the ground."""
        self._x, self._y = (x, 0.0, 0.0), (y, 0.0, 0.0)
        self._clears = self._lift_off_height + _FREED

    def retime(self, left: float) -> None:
        """The foot is due in another time from now on; its phase stays what it is."""
        phase = self.phase
        if phase < 1.0 and left > 0.0:
            self.duration = left / (1.0 - phase)
            self.elapsed = phase * self.duration

    def advance(self, dt: float, shift: Point) -> None:
        """Moves on."""
        left = self._shape.arrive * self.duration - self.elapsed
        self.elapsed += dt
        clears = self.phase >= RISE or self.position[2] >= self._clears
        if clears and self.elapsed > self._shape.depart * self.duration:
            x, y = self.goal.position[0] + shift[0], self.goal.position[1] + shift[1]
            self._x, self._y = (
                least_jerk_towards(self._x, x, left, dt),
                least_jerk_towards(self._y, y, left, dt),
            )
        (x, vx, ax), (y, vy, ay), (z, vz, az) = self._x, self._y, self._vertical(dt)
        phase, rate, second = least_jerk(self.elapsed, 0.0, self.duration)
        a, b, c = self._turn.tolist()
        self.position = np.array((x, y, z))
        self.rotation = pin.exp3(phase * self._turn) @ self._start_rotation
        self.velocity = np.array((vx, vy, vz, rate * a, rate * b, rate * c))
        self.acceleration = np.array((ax, ay, az, second * a, second * b, second * c))

    def _vertical(self, dt: float) -> Motion:
        """Height and its rates; below the goal if the foot is still in the air when it is due."""
        T, end = self.duration, self.goal.position[2]
        if self._search is None and self.elapsed >= T:
            self._search = end, 0.0
        if self._search is not None:
            return self._deeper(*self._search, dt)
        height, rate, second = self._shape.height(self.phase, self._lift_off_height, end)
        return height, rate / T, second / (T * T)

    def _deeper(self, height: float, rate: float, dt: float) -> Motion:
        """One tick of looking for the ground."""
        lowest, acceleration = self.goal.position[2] - self._depth, 0.0
        if height <= lowest:
            rate = 0.0
        elif rate > -_SEARCH_SPEED:
            acceleration = -_SEARCH_ACCELERATION
            rate = max(rate + acceleration * dt, -_SEARCH_SPEED)
        self._search = max(height + rate * dt, lowest), rate
        return *self._search, acceleration


def least_jerk_towards(axis: Motion, goal: float, left: float, dt: float) -> Motion:
    """One tick of the least-jerk motion that arrives at rest in the time that is left [s]."""
    x, v, a = axis
    if left <= FIXED:
        # Too short to plan anew: three poles, fast and equal, deal with the last millimetre.
        pole = 3.0 / FIXED
        jerk = pole**3 * (goal - x) - 3.0 * pole**2 * v - 3.0 * pole * a
    else:
        jerk = (60.0 * (goal - x) / left - 36.0 * v) / (left * left) - 9.0 * a / left
    return (
        x + dt * (v + dt * (0.5 * a + dt * jerk / 6.0)),
        v + dt * (a + 0.5 * dt * jerk),
        a + dt * jerk,
    )
