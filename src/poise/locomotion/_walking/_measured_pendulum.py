"""`MeasuredPendulum`: the pendulum of a walk as the robot is now."""

import math

import numpy as np
from jaxtyping import Float64

from poise.locomotion._support import Point, SupportPolygon
from poise.locomotion._walking._body import BodyMotion
from poise.locomotion._walking._flight import Flight, HeldFlight
from poise.locomotion._walking._leg_momentum import FeetAt, LegMomentum
from poise.locomotion._walking._sense import WalkSense
from poise.locomotion._walking._stance import Stance
from poise.locomotion._walking._swing import HeldSwing, SwingFoot


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

    def feet(self, flight: Flight | HeldFlight | None) -> tuple[FeetAt, FeetAt, FeetAt]:
        """Positions [m], velocities [m/s] and accelerations [m/s^2] of both feet."""
        still = (0.0, 0.0)
        rows = [[place.position[:2], still, still] for place in self._stance.feet]
        if flight is not None:
            rows[flight.foot] = self.swing_motion(flight.swing)
        (a, va, aa), (b, vb, ab) = rows
        return (a, b), (va, vb), (aa, ab)

    def swing_motion(self, swing: SwingFoot | HeldSwing) -> list[Point]:
        """Position, velocity and acceleration of the foot in the air, whose height counts."""
        # Over that line: feet that stand count where they are, on whatever step.
        position = swing.position - np.array([0.0, 0.0, swing.slant])
        return [self._counted(row) for row in (position, swing.velocity, swing.acceleration)]

    def _counted(self, row: Float64[np.ndarray, " n"]) -> Point:
        """Place of a foot along the ground, or a rate of it, its height counted in."""
        x, y, z = row[:3].tolist()
        heading = self._body.heading[0]
        return x + self._rise * math.cos(heading) * z, y + self._rise * math.sin(heading) * z

    def mass(self, flight: Flight | HeldFlight | None) -> tuple[Point, Point]:
        """C [m] and its velocity [m/s]."""
        feet, _, _ = self.feet(flight)
        velocities = [(0.0, 0.0), (0.0, 0.0)]
        if flight is not None:
            velocities[flight.foot] = self._counted(self._sense.lower_edge_velocity(flight.foot))
        left, right = velocities
        (x, y, _), (vx, vy, _) = self._sense.com.tolist(), self._sense.com_velocity.tolist()
        return self._legs.joined((x, y), feet), self._legs.joined((vx, vy), (left, right))

    def xi(self, flight: Flight | HeldFlight | None) -> Point:
        """The divergent component [m]."""
        (x, y), (vx, vy) = self.mass(flight)
        return x + vx / self._legs.omega, y + vy / self._legs.omega

    def depth(self, flight: Flight | HeldFlight | None, support: SupportPolygon) -> float:
        """Return the depth of the DCM inside a region of the ZMP, negative outside [m]."""
        feet, _, _ = self.feet(flight)
        return support.depth(self._legs.parted(self.xi(flight), feet))
