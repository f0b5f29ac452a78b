"""`SwingFoot`: trajectory of a swing foot. `HeldSwing`: pose of one that is held."""

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.dynamics import least_jerk
from poise.locomotion._support import Point
from poise.locomotion._walking._ground import Placement
from poise.locomotion._walking._swing_shape import RISE, SwingShape

_FIXED = 0.06
"""The goal does not move any more when the foot is this near to its arrival [s]."""

_CLEAR = 0.03
"""A foot that was held on its way up goes on when it is higher than where it stood by this [m]."""

_SEARCH_SPEED, _SEARCH_ACCELERATION = 0.5, 8.0
"""How a foot that has found no ground goes on down [m/s, m/s^2]: what it lacks in height the robot
falls, meanwhile, to the side where the foot should be."""


Motion = tuple[float, float, float]
"""Position [m], velocity [m/s] and acceleration [m/s^2] along one axis of the world; or angles."""


class SwingFoot:
    """Position and orientation of a foot from lift-off to touchdown, with rates.

    Height and orientation follow quintics of least jerk: no speed and no acceleration at lift-off,
    at the apex and at the goal. Along the ground it is one too, planned anew each tick for the time
    that is left, so that the goal may move while the foot is in the air. A foot that has found no
    ground goes on down slowly.
    """

    def __init__(
        self,
        position: Float64[np.ndarray, "3"],
        rotation: Float64[np.ndarray, "3 3"],
        goal: Placement,
        shape: SwingShape,
        duration: float,
        search_depth: float,
    ) -> None:
        self.goal, self.duration = goal, duration
        self.elapsed = 0.0
        self._shape = shape
        self._lift_off_height = float(position[2])
        self._clears = self._lift_off_height
        self._depth = search_depth
        self._start_rotation = rotation.copy()
        self._turn = pin.log3(goal.rotation @ rotation.T)
        x, y, _ = position.tolist()
        self._x, self._y = (x, 0.0, 0.0), (y, 0.0, 0.0)
        self._search: tuple[float, float] | None = None
        self.rotation: Float64[np.ndarray, "3 3"] = self._start_rotation
        self.position: Float64[np.ndarray, "3"] = position.copy()
        self.velocity: Float64[np.ndarray, "6"] = np.zeros(6)
        self.acceleration: Float64[np.ndarray, "6"] = np.zeros(6)

    @property
    def phase(self) -> float:
        """Zero at lift-off, one when the foot is due; above while it looks for the ground."""
        return self.elapsed / self.duration

    @property
    def slant(self) -> float:
        """Height of the straight line from lift-off to the goal, by the time that is over [m]."""
        begin, end = self._lift_off_height, self.goal.position[2]
        return begin + min(self.phase, 1.0) * (end - begin)

    @property
    def searching(self) -> bool:
        """Whether it looks for the ground."""
        return self._search is not None

    def search(self) -> None:
        """The foot should have met the ground, and has not: goes on down until it does."""
        if self._search is None:
            self._search = float(self.position[2]), float(self.velocity[2])

    def search_again(self) -> None:
        """What it met does not carry it: goes on down from there, slowly at first."""
        self._search = float(self.position[2]), 0.0

    def rise_at(self, x: float, y: float) -> None:
        """Goes straight up at a place before it goes on along the ground."""
        self._x, self._y = (x, 0.0, 0.0), (y, 0.0, 0.0)
        self._clears = self._lift_off_height + _CLEAR

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


class HeldSwing:
    """Pose of a held swing foot, with rates; set anew in each tick.

    Attributes:
        position: of the sole [m].
        rotation: world_R_sole.
        velocity: linear then angular [m/s, rad/s].
        acceleration: linear then angular [m/s^2, rad/s^2].
        slant: height of the ground below it, over which its height counts as a way ahead [m].
    """

    def __init__(
        self, position: Float64[np.ndarray, "3"], rotation: Float64[np.ndarray, "3 3"]
    ) -> None:
        self.position, self.rotation = position.copy(), rotation.copy()
        self.velocity: Float64[np.ndarray, "6"] = np.zeros(6)
        self.acceleration: Float64[np.ndarray, "6"] = np.zeros(6)
        self.slant = float(position[2])


def least_jerk_towards(axis: Motion, goal: float, left: float, dt: float) -> Motion:
    """One tick of the least-jerk motion that arrives at rest in the time that is left [s]."""
    x, v, a = axis
    if left <= _FIXED:
        # Too short to plan anew: three poles, fast and equal, deal with the last millimetre.
        pole = 3.0 / _FIXED
        jerk = pole**3 * (goal - x) - 3.0 * pole**2 * v - 3.0 * pole * a
    else:
        jerk = (60.0 * (goal - x) / left - 36.0 * v) / (left * left) - 9.0 * a / left
    return (
        x + dt * (v + dt * (0.5 * a + dt * jerk / 6.0)),
        v + dt * (a + 0.5 * dt * jerk),
        a + dt * jerk,
    )
