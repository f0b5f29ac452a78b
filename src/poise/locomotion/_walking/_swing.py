"""`SwingFoot`: the way of a foot through the air."""

import math

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.dynamics import least_jerk
from poise.locomotion._walking._footsteps import RISE, Placement, SwingShape

_FIXED = 0.06
"""The goal does not move any more when the foot is this near to its arrival [s]."""

_SEARCH_SPEED, _SEARCH_ACCELERATION = 0.1, 1.5
"""How a foot that has found no ground goes on down [m/s, m/s^2]."""


class SwingFoot:
    """Position and orientation of a foot from lift-off to touchdown, with rates.

    Height and orientation follow quintics of least jerk: no speed and no acceleration at lift-off,
    at the apex and at the goal. The horizontal way is one too, planned anew each tick for the time
    that is left, so that the goal may move while the foot is on its way. A foot that has found no
    ground goes on down slowly.

    Args:
        position: of the sole at lift-off [m].
        rotation: world_R_sole at lift-off.
        goal: where it should come down.
        shape: of its way.
        duration: of the swing [s].
        search_depth: how far below the goal it looks for the ground [m].
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
        low, end = float(position[2]), goal.position[2]
        self._z = (low, max(shape.apex, low, end), end)
        self._depth = search_depth
        self._start_rotation = rotation.copy()
        cos, sin = math.cos(goal.yaw), math.sin(goal.yaw)
        flat = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        self._turn = pin.log3(flat @ rotation.T)
        # x and y: position, velocity, acceleration each.
        self._way = [[float(position[k]), 0.0, 0.0] for k in (0, 1)]
        self._searched = 0.0
        self._speed = 0.0
        self.rotation: Float64[np.ndarray, "3 3"] = self._start_rotation
        self.position: Float64[np.ndarray, "3"] = position.copy()
        self.velocity: Float64[np.ndarray, "6"] = np.zeros(6)
        self.acceleration: Float64[np.ndarray, "6"] = np.zeros(6)

    @property
    def share(self) -> float:
        """How much of the swing is over; above one while the foot looks for the ground."""
        return self.elapsed / self.duration

    @property
    def exhausted(self) -> bool:
        """Whether it has looked for the ground as far down as it may."""
        return self._searched >= self._depth

    def stop_here(self) -> None:
        """Comes straight down from where the foot is."""
        x, y = (axis[0] for axis in self._way)
        self._way = [[x, 0.0, 0.0], [y, 0.0, 0.0]]
        self.goal = Placement(position=(x, y, self.goal.position[2]), yaw=self.goal.yaw)
        self.elapsed = max(self.elapsed, RISE * self.duration)

    def advance(self, dt: float, shift: tuple[float, float]) -> None:
        """Moves on.

        Args:
            dt: since the last call [s].
            shift: of the goal, along the world's x and y [m].
        """
        left = self._shape.arrive * self.duration - self.elapsed
        self.elapsed += dt
        if self.elapsed > self._shape.depart * self.duration:
            for k in (0, 1):
                _towards(self._way[k], self.goal.position[k] + shift[k], left, dt)
        z, speed, rise = self._vertical(dt)
        share, rate, second = least_jerk(self.elapsed, 0.0, self.duration)
        x, y = self._way
        self.position = np.array([x[0], y[0], z])
        turn, spin = self._turn, rate * self._turn
        self.velocity = np.array([x[1], y[1], speed, spin[0], spin[1], spin[2]])
        bend = second * turn
        self.acceleration = np.array([x[2], y[2], rise, bend[0], bend[1], bend[2]])
        self.rotation = pin.exp3(share * turn) @ self._start_rotation

    def _vertical(self, dt: float) -> tuple[float, float, float]:
        low, high, end = self._z
        up = RISE * self.duration
        if self.elapsed < up:
            share, rate, second = least_jerk(self.elapsed, 0.0, up)
            return low + share * (high - low), rate * (high - low), second * (high - low)
        if self.elapsed < self.duration:
            share, rate, second = least_jerk(self.elapsed, up, self.duration - up)
            return high + share * (end - high), rate * (end - high), second * (end - high)
        push = 0.0
        if self.exhausted:
            self._speed = 0.0
        elif self._speed < _SEARCH_SPEED:
            push = _SEARCH_ACCELERATION
            self._speed = min(self._speed + push * dt, _SEARCH_SPEED)
        self._searched = min(self._searched + self._speed * dt, self._depth)
        return end - self._searched, -self._speed, -push


def _towards(axis: list[float], goal: float, left: float, dt: float) -> None:
    """One tick along the way of least jerk that arrives at rest in the time that is left."""
    x, v, a = axis
    if left <= _FIXED:
        # Too short to plan anew: a stiff, well damped pull has the last millimetre.
        rate = 3.0 / _FIXED
        jerk = rate**3 * (goal - x) - 3.0 * rate**2 * v - 3.0 * rate * a
    else:
        jerk = (60.0 * (goal - x) / left - 36.0 * v) / (left * left) - 9.0 * a / left
    axis[0] = x + dt * (v + dt * (0.5 * a + dt * jerk / 6.0))
    axis[1] = v + dt * (a + 0.5 * dt * jerk)
    axis[2] = a + dt * jerk
