"""Swing foot: `HeldFlight` of a `FootMotion`, and `Flight` along a swing of its own."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.dynamics import least_jerk
from poise.locomotion._support import Point, Rotation, Vector3
from poise.locomotion._walking._commands import Foothold
from poise.locomotion._walking._ground import (
    FIXED,
    RISE,
    Motion,
    Placement,
    SwingShape,
    least_jerk_towards,
    sinking_phase,
)
from poise.locomotion._walking._sense import WalkSense
from poise.locomotion._walking._settings import WalkSettings

_RATE = 2.0
"""Largest rates of foothold [m/s] and time of touchdown [s/s]."""

_HELD, _BACK = 0.04, 0.015
"""A foot that rises and is pushed aside with more than this part of the weight, more than upwards,
is held by something; it goes so far back from it [m]."""

_FREED = 0.03
"""Height at which a foot that was blocked while rising continues [m]."""

_SHORT, _EARLY = 0.08, 0.03
"""Contact so far from the foothold [m], and earlier than this before it is due [s], is with
something on its way."""

CLEAR = 0.02
"""Height above where it stood from which a swing foot is free to move and turn [m]."""

_SEARCH_SPEED, _SEARCH_ACCELERATION = 0.5, 8.0
"""Descent of a foot that has found no ground [m/s, m/s^2]: what it lacks in height the robot
falls, meanwhile, to the side where the foot should be."""


class HeldFlight:
    """Swing foot moved by a `FootMotion`, from lift-off to touchdown.

    Attributes:
        foot: 0 for the left one, 1 for the right one.
        goal: where it would come down: where it is now.
        position: of the sole in the world [m].
        rotation: world_R_sole.
        velocity: of the sole, linear and angular, in the world [m/s, rad/s].
        acceleration: the same [m/s^2, rad/s^2].
    """

    def __init__(self, foot: int, position: Vector3, rotation: Rotation, goal: Placement) -> None:
        self.foot, self.goal = foot, goal
        self.position, self.rotation = position.copy(), rotation.copy()
        self.velocity: Float64[np.ndarray, "6"] = np.zeros(6)
        self.acceleration: Float64[np.ndarray, "6"] = np.zeros(6)
        # Since lift-off, until touchdown is due, and since the foot reached its depth [s]: no one
        # expects one that is held, which may come down in any tick.
        self.elapsed = self.left = self.waited = 0.0
        self.phase = 0.0  # zero at lift-off, one when due; above while it looks for the ground
        self._begin = self.end = float(position[2])  # heights of lift-off and of the aim [m]

    def move(self, position: Vector3, velocity: Vector3, rotation: Rotation, yaw: float) -> None:
        """Set the pose of a tick.

        Args:
            position: of the sole in the world [m].
            velocity: of the sole in the world [m/s].
            rotation: world_R_sole.
            yaw: heading of the sole in the world [rad].
        """
        self.position, self.rotation = position, rotation
        self.velocity[:3] = velocity
        x, y, z = position.tolist()
        self.goal = Placement(position=(x, y, z), yaw=yaw)

    def land(self) -> None:
        """Do nothing: the source of the foot's motion puts it down."""

    @property
    def slant(self) -> float:
        """Height on the line from lift-off to the goal, over which height counts ahead [m]."""
        return self._begin + min(self.phase, 1.0) * (self.end - self._begin)


class Flight(HeldFlight):
    """Swing foot whose place and time of touchdown are still open."""

    def __init__(
        self,
        foot: int,
        position: Vector3,
        rotation: Rotation,
        goal: Placement,
        shape: SwingShape,
        time: float,
        settings: WalkSettings,
        swung: float | None = None,
    ) -> None:
        super().__init__(foot, position, rotation, goal)
        depth = settings.touchdown_depth
        self.elapsed, self.phase = swung or 0.0, 0.0 if swung is None else RISE
        self.left, self.end = time - self.elapsed, goal.position[2] - depth
        self._shape, self._sinking = shape, sinking_phase(depth, shape.apex - goal.position[2])
        self._duration = self.left / (1.0 - self._sinking)  # from phase 0 to 1 [s]
        self._settings, self._lands, self._clears = settings, False, self._begin
        self._start_rotation, self._turn = self.rotation, pin.log3(goal.rotation @ rotation.T)
        x, y, _ = position.tolist()
        self._x, self._y = (x, 0.0, 0.0), (y, 0.0, 0.0)
        self._search: Point | None = None
        self.given = False  # its foothold was asked for
        self.made: Foothold | None = None  # that one, once the foot has landed
        self.stood = self.hovering = 0.0  # since then, and last without load [s]

    @property
    def is_open(self) -> bool:
        """True while place and time of touchdown may still change."""
        return not self._lands and (self.left > FIXED or self.left == 0.0)

    def aim(
        self, place: Point, left: float, carries: Callable[[int, Placement], bool], dt: float
    ) -> None:
        """Take foothold [m] and time left [s] nearer to those, on ground that carries."""
        (x, y, z), (a, b) = self.goal.position, self.goal.slope
        by_x, by_y = place[0] - x, place[1] - y
        most = _RATE * dt
        if by_x != 0.0 or by_y != 0.0:
            ratio = min(1.0, most / max(math.hypot(by_x, by_y), 1e-9))
            by_x, by_y = ratio * by_x, ratio * by_y
            position = (x + by_x, y + by_y, z + a * by_x + b * by_y)
            moved = replace(self.goal, position=position)
            if carries(self.foot, moved):
                self.goal = moved
        if self.left > 0.0:
            self.left += min(max(left - self.left, -most), most)

    def land(self) -> None:
        """Move straight down from the current position of the foot."""
        if not self._lands:
            x, y, _ = self.position.tolist()
            self.goal = replace(self.goal, position=(x, y, self.goal.position[2]))
            self._lands, self.left = True, 0.0

    def is_down(self, sense: WalkSense) -> bool:
        """Return whether the foot has met the ground; without a measurement, it has when due."""
        wrench, least = sense.wrenches[self.foot], self._settings.touchdown_force * sense.weight
        if wrench is None:
            met = self.phase >= 1.0
        else:
            met = wrench[2] >= least and (self.phase >= RISE or self.searching)
        return met and not self.on_its_way(sense)

    def on_its_way(self, sense: WalkSense) -> bool:
        """Return whether contact cannot be with the ground at the foothold."""
        if self.left <= _EARLY:
            return False
        x, y, _ = sense.lower_edge(self.foot)[0].tolist()
        return math.dist((x, y), self.goal.position[:2]) > _SHORT

    def count(self, dt: float) -> None:
        self.elapsed += dt
        self.left = max(self.left - dt, 0.0)

    def get_clear(self, sense: WalkSense) -> None:
        """Move a foot that is blocked while rising back from the obstacle, then straight up."""
        if self.phase >= RISE:
            return
        push_x, push_y, up = sense.relative_force(self.foot)
        aside = math.hypot(push_x, push_y)
        if aside > _HELD and aside > up:
            x, y, _ = sense.lower_edge(self.foot)[0].tolist()
            self._x = (x + _BACK * push_x / aside, 0.0, 0.0)
            self._y = (y + _BACK * push_y / aside, 0.0, 0.0)
            self._clears = self._begin + _FREED

    @property
    def searching(self) -> bool:
        return self._search is not None

    def search_again(self) -> None:
        """Go on down from ground that does not carry, slowly at first."""
        self._search = float(self.position[2]), 0.0

    def retime(self) -> None:
        """Fit the rest of the swing into the time left; look for the ground once that is over."""
        before_ground = 1.0 - self._sinking - self.phase
        if self.left > 0.0 and before_ground > 0.0:
            self._duration = self.left / before_ground
        elif self.left == 0.0 and self._search is None:
            self._search = float(self.position[2]), float(self.velocity[2])

    def advance(self, dt: float) -> None:
        T, shape = self._duration, self._shape
        left = (shape.arrive - self.phase) * T
        self.phase += dt / T
        clears = self.phase >= RISE or self.position[2] >= self._clears
        if clears and self.phase > shape.depart:
            x, y, _ = self.goal.position
            self._x = least_jerk_towards(self._x, x, left, dt)
            self._y = least_jerk_towards(self._y, y, left, dt)
        if self.phase >= 1.0:
            self.waited += dt
            self._search = self._search or (self.end, 0.0)
        if self._search is not None:
            vertical = self._deeper(*self._search, dt)
        else:
            height, rate, second = shape.height(self.phase, self._begin, self.end)
            vertical = height, rate / T, second / (T * T)
        (x, vx, ax), (y, vy, ay), (z, vz, az) = self._x, self._y, vertical
        part, rate, second = least_jerk(self.phase, 0.0, 1.0)
        a, b, c = (self._turn / T).tolist()
        self.position = np.array((x, y, z))
        self.rotation = pin.exp3(part * self._turn) @ self._start_rotation
        self.velocity = np.array((vx, vy, vz, rate * a, rate * b, rate * c))
        second /= T
        self.acceleration = np.array((ax, ay, az, second * a, second * b, second * c))

    def _deeper(self, height: float, rate: float, dt: float) -> Motion:
        """One tick of looking for the ground."""
        lowest, acceleration = self.end - self._settings.search_depth, 0.0
        if height <= lowest:
            rate = 0.0
        elif rate > -_SEARCH_SPEED:
            acceleration = -_SEARCH_ACCELERATION
            rate = max(rate + acceleration * dt, -_SEARCH_SPEED)
        self._search = max(height + rate * dt, lowest), rate
        return *self._search, acceleration
