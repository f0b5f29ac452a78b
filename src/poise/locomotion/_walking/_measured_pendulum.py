"""`MeasuredPendulum`: the pendulum of a walk as the robot is now."""

import math

from poise.locomotion._support import Point, SupportPolygon
from poise.locomotion._walking._body import BodyMotion
from poise.locomotion._walking._flight import Flight, HeldFlight
from poise.locomotion._walking._leg_momentum import FeetAt, LegMomentum
from poise.locomotion._walking._sense import WalkSense
from poise.locomotion._walking._stance import Stance
from poise.locomotion._walking._swing import HeldSwing, SwingFoot

_STILL = ((0.0, 0.0), (0.0, 0.0))


class MeasuredPendulum:
    """C, its velocity and its divergent component, see `LegMomentum`, from what is measured.

    So is the velocity of the foot in the air: one that lags behind its plan, or drags along the
    ground, has not the momentum that was planned. At 1 m/s of lag C would seem to be 2 cm
    elsewhere on G1, and the ZMP would be sent to an edge for that.
    """

    def __init__(
        self, legs: LegMomentum, rise: float, sense: WalkSense, stance: Stance, body: BodyMotion
    ) -> None:
        self._legs, self._rise = legs, rise
        self._sense, self._stance, self._body = sense, stance, body
        self._known: tuple[list[float] | None, FeetAt, FeetAt] = (None, _STILL, _STILL)

    def places(self, flight: Flight | HeldFlight | None) -> FeetAt:
        """Return the positions of both feet [m]."""
        left, right = self._stance.feet
        a, b = left.position[:2], right.position[:2]
        if flight is None:
            return a, b
        place = self.swing_place(flight.swing)
        return (place, b) if flight.foot == 0 else (a, place)

    def rates(self, flight: Flight | HeldFlight | None) -> tuple[FeetAt, FeetAt]:
        """Return velocities [m/s] and accelerations [m/s^2] of both feet."""
        if flight is None:
            return _STILL, _STILL
        swing, foot = flight.swing, flight.foot
        velocity, acceleration = (
            self._counted(*row[:3].tolist()) for row in (swing.velocity, swing.acceleration)
        )
        return _of_one(foot, velocity), _of_one(foot, acceleration)

    def swing_place(self, swing: SwingFoot | HeldSwing) -> Point:
        """Return the position of the swing foot, whose height counts [m]."""
        x, y, z = swing.position.tolist()
        # Over that line: feet that stand count where they are, on whatever step.
        return self._counted(x, y, z - swing.slant)

    def _counted(self, x: float, y: float, z: float) -> Point:
        """Place of a foot along the ground, or a rate of it, its height counted in."""
        heading = self._body.heading[0]
        return x + self._rise * math.cos(heading) * z, y + self._rise * math.sin(heading) * z

    def mass(self, flight: Flight | HeldFlight | None) -> tuple[Point, Point]:
        """Return C [m] and its velocity [m/s]."""
        feet = self.places(flight)
        # What the state and the feet were that it was computed of last; lists are those of a tick.
        known_com, known_feet, known = self._known
        if flight is None and known_com is self._sense.com and known_feet == feet:
            return known
        velocities = _STILL
        if flight is not None:
            velocity = self._counted(*self._sense.lower_edge_velocity(flight.foot))
            velocities = _of_one(flight.foot, velocity)
        (x, y, _), (vx, vy, _) = self._sense.com, self._sense.com_velocity
        mass = self._legs.joined((x, y), feet), self._legs.joined((vx, vy), velocities)
        self._known = None if flight else self._sense.com, feet, mass
        return mass

    def xi(self, flight: Flight | HeldFlight | None) -> Point:
        """The divergent component [m]."""
        (x, y), (vx, vy) = self.mass(flight)
        return x + vx / self._legs.omega, y + vy / self._legs.omega

    def depth(self, flight: Flight | HeldFlight | None, support: SupportPolygon) -> float:
        """Return the depth of the DCM inside a region of the ZMP, negative outside [m]."""
        return support.depth(self._legs.parted(self.xi(flight), self.places(flight)))


def _of_one(foot: int, rate: Point) -> FeetAt:
    """Return a rate of one foot, and of another that stands."""
    return (rate, (0.0, 0.0)) if foot == 0 else ((0.0, 0.0), rate)
