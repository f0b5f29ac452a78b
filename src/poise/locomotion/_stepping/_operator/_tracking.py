"""`Tracker`: follows a foot or hand of the operator while it leads, no faster than it may."""

import math
from collections.abc import Sequence

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.dynamics import rotation_vector
from poise.locomotion._stepping._operator._sample import TrackedPose, Vector
from poise.locomotion._stepping._operator._sample_clock import SILENT_AFTER, SLOWEST, Engagement

# Largest speed at which a part is followed [m/s]: a foot in a brisk walk, a hand that reaches
SPEED_MAX = 2.5
# Distance that is followed without delay after rest [m]: one period of a tracker of 40 Hz
BURST = 0.06
# A sample farther away is another thing's [m]: one period of the slowest device at `SPEED_MAX`
JUMP = SPEED_MAX * SLOWEST + BURST
TURN_SPEED_MAX = 3.0  # of a hand that is followed [rad/s]: what wrists of robots reach
# Turn that is followed without delay after rest [rad]: one period of a tracker of 25 Hz, for a
# wrist that is flicked runs ahead of what follows it
TURN_BURST = TURN_SPEED_MAX / 25.0
TURN_JUMP = 12.0 * SLOWEST  # between samples [rad]: a wrist that is flicked, at 12 rad/s
# Delay with which a device may read its own velocity [s]: two periods of a tracker of 100 Hz
VELOCITY_DELAY = 0.02
VELOCITY_ERROR = SPEED_MAX * VELOCITY_DELAY  # distance between place and integrated velocity [m]
# Time constant with which that distance is forgotten [s]: no less than a velocity counts
VELOCITY_MEMORY = 2 * SILENT_AFTER
UNIT_ERROR = 0.01  # of a quaternion's length: messages round to two figures

Rotation = Float64[np.ndarray, "3 3"]

_STILL: Float64[np.ndarray, "3"] = np.zeros(3)
_STILL.flags.writeable = False


class RateLimiter:
    """Rate-limit a motion: in any n ticks no more than `burst` + n `step`."""

    def __init__(self, step: float, burst: float) -> None:
        self._step, self._burst = step, burst
        self._room = burst

    def part(self, distance: float) -> float:
        """Take one tick of a way; return which part of it is gone."""
        most = self._room = min(self._room + self._step, self._burst)
        self._room = max(most - distance, 0.0)
        return 1.0 if distance <= most else most / distance

    def turn(self, rotation: Rotation, goal: Rotation) -> tuple[Rotation, Float64[np.ndarray, "3"]]:
        """Take one tick of a turn."""
        if rotation is goal:
            return goal, _STILL
        way = rotation_vector(goal, rotation)
        part = self.part(math.hypot(*way))
        way = part * way
        return (goal if part == 1.0 else pin.exp3(way) @ rotation), way


class VelocityCheck:
    """Velocity that a device sends, for as long as its position moves accordingly."""

    def __init__(self) -> None:
        self._velocity: Vector | None = None
        self._at = -math.inf
        self._sent: Sequence[float] = (0.0, 0.0, 0.0)
        self._place: Sequence[float] = (0.0, 0.0, 0.0)
        self._apart: Sequence[float] = (0.0, 0.0, 0.0)

    def update(self, velocity: Vector | None, place: Vector, time: float) -> None:
        """Take what came with a good sample."""
        self._velocity = None
        # Not a number is no smaller either.
        if velocity is None or not math.hypot(*velocity) <= SPEED_MAX:
            return
        since = time - self._at
        if 0.0 <= since <= SILENT_AFTER:
            kept = 1.0 - since / VELOCITY_MEMORY
            self._apart = [
                kept * (apart + 0.5 * since * (old + new) - (now - before))
                for apart, old, new, now, before in zip(
                    self._apart, self._sent, velocity, place, self._place, strict=True
                )
            ]
        else:
            self._apart = (0.0, 0.0, 0.0)
        self._sent, self._place, self._at = velocity, place, time
        if math.hypot(*self._apart) <= VELOCITY_ERROR:
            self._velocity = velocity

    def at(self, time: float) -> Vector | None:
        """Return the velocity at a time of the robot [m/s]; None where it is unknown."""
        return self._velocity if 0.0 <= time - self._at <= SILENT_AFTER else None


class Tracker(Engagement):
    """Follow a foot or a hand of the operator while it leads."""

    def __init__(self, dt: float) -> None:
        super().__init__()
        self._limiter = RateLimiter(dt * SPEED_MAX, BURST)
        self._turning = RateLimiter(dt * TURN_SPEED_MAX, TURN_BURST)
        self._velocity = VelocityCheck()
        self.place: Vector = (0.0, 0.0, 0.0)
        self._goal = self.place
        self._rotation: Rotation | None = None
        self._turn_goal: Rotation | None = None
        self.step = self.turn = _STILL

    @property
    def turns(self) -> bool:
        """The part leads by its orientation, too."""
        return self.engaged and self._rotation is not None

    def velocity(self, time: float) -> Vector | None:
        """Return its velocity at a time of the robot [m/s]; None while unknown or not engaged."""
        return self._velocity.at(time) if self.engaged else None

    def update(
        self, part: TrackedPose | None, time: float, *, foot: tuple[Vector, float] | None = None
    ) -> bool:
        """Take one tick."""
        self.step = self.turn = _STILL
        # For a tick at least: what is followed does not jump from one place to another.
        if self.expire(time):
            return False
        good = part is not None and self._accepts(part, time, foot)
        if not self.engaged:
            return good
        if self._rotation is not None and self._turn_goal is not None:
            self._rotation, self.turn = self._turning.turn(self._rotation, self._turn_goal)
        before, share = self.place, self._limiter.part(math.dist(self._goal, self.place))
        if share == 1.0:
            self.place = self._goal
        else:
            (x, y, z), (to_x, to_y, to_z) = before, self._goal
            self.place = (x + share * (to_x - x), y + share * (to_y - y), z + share * (to_z - z))
        if foot is None:
            self.step = np.subtract(self.place, before)
        return good

    def _accepts(self, part: TrackedPose, time: float, foot: tuple[Vector, float] | None) -> bool:
        """Engage, follow or refuse a sample."""
        point, rotation = part.position, None
        if foot is None:
            if not part.clutch:
                self.release(time)
                return False
            if part.orientation is not None:
                rotation = rotation_of(part.orientation)
                if rotation is None:
                    return False
        elif part.clutch is not None:
            # A tracker's position is in no world; `FootTracker` makes a place of it.
            return False
        if point is None:
            return False
        if self.engaged:
            if self._is_elsewhere(point, rotation):
                return False
        elif not self._begins(point, time, foot):
            return False
        if rotation is None or self._rotation is None:
            self._rotation = rotation
        self._goal, self._turn_goal = point, rotation
        self.refresh(time)
        self._velocity.update(part.velocity, point, time)
        return True

    def _begins(self, point: Vector, time: float, foot: tuple[Vector, float] | None) -> bool:
        if not all(map(math.isfinite, point)):
            return False
        begin = point
        if foot is not None:
            begin, highest = foot
            if math.dist(point, begin) > JUMP or point[2] > highest:
                return False
            self.release(time)
        if not self.engage():
            return False
        self.place, self._rotation = begin, None
        return True

    def _is_elsewhere(self, point: Vector, rotation: Rotation | None) -> bool:
        # Not a number is nowhere near.
        if not math.dist(point, self.place) <= JUMP:
            return True
        return rotation is not None and is_turned_away(rotation, self._rotation)


def is_turned_away(rotation: Rotation, before: Rotation | None) -> bool:
    """Return whether a rotation is so far from the one before that it is another thing's."""
    return before is not None and math.hypot(*rotation_vector(rotation, before)) > TURN_JUMP


def rotation_of(quaternion: Sequence[float]) -> Rotation | None:
    """Return the rotation matrix of a unit quaternion (x, y, z, w); None for what is none."""
    length = math.hypot(*quaternion)
    # Not a number is not near one either.
    if not abs(length - 1.0) <= UNIT_ERROR:
        return None
    return pin.Quaternion(np.array(quaternion) / length).toRotationMatrix()
