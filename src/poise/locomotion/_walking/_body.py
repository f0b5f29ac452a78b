"""Body of a walk: `BodyMotion`, its references, `BodyHeight`, and the `MeasuredPendulum`."""

import math
from collections.abc import Mapping

import numpy as np

from poise.locomotion._support import Point, SupportPolygon, side
from poise.locomotion._walking._dcm import DcmMotions, FeetAt, LegMomentum
from poise.locomotion._walking._flight import HeldFlight
from poise.locomotion._walking._footsteps import Gait, Stand
from poise.locomotion._walking._ground import FIXED, Motion, Placement, least_jerk_towards
from poise.locomotion._walking._legs import Leg
from poise.locomotion._walking._sense import WalkSense
from poise.locomotion._walking._stance import Stance
from poise.locomotion._walking._tasks import CarriedTarget, ComMotion

_FALL = 1.0
"""Square of the time of a descent over its height [s^2/m]: a least jerk keeps 0.4 of the weight."""


class BodyMotion:
    """References of the body and of the targets that move with it."""

    def __init__(
        self,
        standing: Stand,
        crouch: float,
        lowering: float,
        omega: float,
        carried: Mapping[str, CarriedTarget],
    ) -> None:
        self._standing, self._omega = standing, omega
        self._crouch, self._lowering = crouch, lowering
        self._lowered: Motion = (0.0, 0.0, 0.0)
        self._carried = carried
        self._heading_before = 0.5 * (standing.start[0].yaw + standing.start[1].yaw)
        self._mass: Point = (0.0, 0.0)
        self.rise: Motion = (0.0, 0.0, 0.0)  # height of the CoM in the world, with rates [m]
        self.heading: Motion = (0.0, 0.0, 0.0)  # with rates [rad]

    def begin(self, mass: Point, height: float, heading: float) -> None:
        self._mass = mass
        self.rise, self.heading = (height, 0.0, 0.0), (heading, 0.0, 0.0)

    def move(self, height: float, heading: float, time: float, dt: float) -> None:
        """Move towards a height [m] and a heading [rad], to be there in a time [s]."""
        self._lowered = least_jerk_towards(self._lowered, self._crouch, self._lowering, dt)
        self._lowering = max(self._lowering - dt, 0.0)
        self.rise = least_jerk_towards(self.rise, height, time, dt)
        self.heading = least_jerk_towards(self.heading, heading, time, dt)

    def follow(self, dcm: DcmMotions, dt: float) -> tuple[Point, Point, Point]:
        """Move C on, C' = omega (xi - C); return it with its rates."""
        (x, vx), (y, vy) = dcm
        w, kept = self._omega, math.exp(-self._omega * dt)
        self._mass = x + (self._mass[0] - x) * kept, y + (self._mass[1] - y) * kept
        rates = (w * (x - self._mass[0]), w * (y - self._mass[1]))
        return self._mass, rates, (w * (vx - rates[0]), w * (vy - rates[1]))

    def carry(self, com: ComMotion) -> None:
        """Move the targets that follow the body."""
        if not self._carried:
            return
        (x, y, z), (vx, vy, vz), (ax, ay, az) = com
        (x0, y0, z0), (low, lowers, faster) = self._standing.com, self._lowered
        heading, turns, second = self.heading
        body = np.array(
            (
                (x - x0, y - y0, z + low - z0, heading - self._heading_before),
                (vx, vy, vz + lowers, turns),
                (ax, ay, az + faster, second),
            )
        )
        for target in self._carried.values():
            target.write(body)


LOWEST = 0.9
"""Part of its height to which the CoM goes down so that a leg reaches where it catches the
robot."""

_BODY_TIME = 0.25
"""The body turns and rises no faster than it takes for a goal this far away [s]."""


class BodyHeight:
    """Height and heading of the body that the next stand needs."""

    def __init__(self, sense: WalkSense, stand: Stand, leg: Leg, gait: Gait, height: float) -> None:
        self._sense, self._out, self._leg = sense, 0.5 * stand.width, leg
        self._gait, self._height = gait, height

    def goal(
        self,
        stance: Stance,
        flight: HeldFlight | None,
        now: float,
        *,
        slow: bool,
        offset: float = 0.0,
        lowest: float = LOWEST,
    ) -> tuple[float, float, float]:
        """Return height [m] and heading [rad] of the body, and the time until then [s]."""
        left, right = stance.feet
        low, yaw, time = min(left.position[2], right.position[2]), stance.heading, 0.0
        feet = [left, right]
        if flight is not None:
            foot = feet[1 - flight.foot]
            # A foot that looks for the ground takes the body down with it.
            sought = min(flight.goal.position[2], float(flight.position[2]))
            low, yaw = min(foot.position[2], sought), 0.5 * (foot.yaw + flight.goal.yaw)
            time, feet[flight.foot] = flight.left, flight.goal
        asked = self._height + offset
        least = low + min(lowest * self._height, asked)
        height = max(self._reached(feet, low + asked, yaw, time), least)
        drop = now - height
        if drop > 0.0 and height < low + asked:
            return height, yaw, max(time, math.sqrt(_FALL * drop), FIXED)
        time = max(time + 0.5 * self._gait.double_support, _BODY_TIME)
        return height, yaw, max(time, self._gait.shift_time) if slow else time

    def _reached(self, feet: list[Placement], height: float, yaw: float, time: float) -> float:
        """Return the height of the CoM at which both legs will reach their feet [m]."""
        (x, y, _), (vx, vy, _) = self._sense.com, self._sense.com_velocity
        x, y = x + time * vx, y + time * vy
        left, ahead = self._out * math.cos(yaw), self._out * math.sin(yaw)
        for foot, place in enumerate(feet):
            out, position = side(foot), place.position
            hip = (x - out * ahead, y + out * left)
            height = min(height, position[2] + self._leg.highest(math.dist(hip, position[:2])))
        return height


class MeasuredPendulum:
    """C, its velocity and its DCM, see `LegMomentum`, from measurements."""

    def __init__(
        self, legs: LegMomentum, rise: float, sense: WalkSense, stance: Stance, body: BodyMotion
    ) -> None:
        self._legs, self._rise = legs, rise
        self._sense, self._stance, self._body = sense, stance, body

    def places(self, flight: HeldFlight | None) -> FeetAt:
        """Return the positions of both feet [m]."""
        left, right = self._stance.feet
        a, b = left.position[:2], right.position[:2]
        if flight is None:
            return a, b
        place = self.swing_place(flight)
        return (place, b) if flight.foot == 0 else (a, place)

    def rates(self, flight: HeldFlight | None) -> tuple[FeetAt, FeetAt]:
        """Return velocities [m/s] and accelerations [m/s^2] of both feet."""
        if flight is None:
            still = _of_one(0, (0.0, 0.0))
            return still, still
        velocity, acceleration = (
            _of_one(flight.foot, self._counted(*row[:3].tolist()))
            for row in (flight.velocity, flight.acceleration)
        )
        return velocity, acceleration

    def swing_place(self, flight: HeldFlight) -> Point:
        """Return the position of the swing foot, whose height counts [m]."""
        x, y, z = flight.position.tolist()
        # Over that line: feet that stand count where they are, on whatever step.
        return self._counted(x, y, z - flight.slant)

    def _counted(self, x: float, y: float, z: float) -> Point:
        """Place of a foot along the ground, or a rate of it, its height counted in."""
        heading = self._body.heading[0]
        return x + self._rise * math.cos(heading) * z, y + self._rise * math.sin(heading) * z

    def mass(self, flight: HeldFlight | None) -> tuple[Point, Point]:
        """Return C [m] and its velocity [m/s]."""
        feet = self.places(flight)
        velocities = _of_one(0, (0.0, 0.0))
        if flight is not None:
            velocity = self._counted(*self._sense.lower_edge_velocity(flight.foot))
            velocities = _of_one(flight.foot, velocity)
        (x, y, _), (vx, vy, _) = self._sense.com, self._sense.com_velocity
        return self._legs.joined((x, y), feet), self._legs.joined((vx, vy), velocities)

    def xi(self, flight: HeldFlight | None) -> Point:
        """The DCM [m]."""
        (x, y), (vx, vy) = self.mass(flight)
        return x + vx / self._legs.omega, y + vy / self._legs.omega

    def depth(self, flight: HeldFlight | None, support: SupportPolygon) -> float:
        """Return the depth of the DCM inside a region of the ZMP, negative outside [m]."""
        return support.depth(self._legs.parted(self.xi(flight), self.places(flight)))


def _of_one(foot: int, rate: Point) -> FeetAt:
    """Return a rate of one foot, and of another that stands."""
    return (rate, (0.0, 0.0)) if foot == 0 else ((0.0, 0.0), rate)
