"""`BodyMotion`: height, heading and COM of a body whose steps are made while it walks."""

import math
from collections.abc import Mapping

import numpy as np

from poise.locomotion._support import Point
from poise.locomotion._walking._dcm_plan import DcmMotion
from poise.locomotion._walking._footsteps import Stand
from poise.locomotion._walking._swing import Motion, least_jerk_towards
from poise.locomotion._walking._tasks import CarriedTarget, ComMotion


class BodyMotion:
    """References of the body, and of all that goes along with it.

    The pendulum's mass C, see `LegMomentum`, follows the divergent component of motion; height and
    heading go to what the next stand asks for.

    Attributes:
        rise: height of the COM in the world, with rates [m].
        heading: with rates [rad].
    """

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
        self.rise: Motion = (0.0, 0.0, 0.0)
        self.heading: Motion = (0.0, 0.0, 0.0)

    def begin(self, mass: Point, height: float, heading: float) -> None:
        """Begins at rest."""
        self._mass = mass
        self.rise, self.heading = (height, 0.0, 0.0), (heading, 0.0, 0.0)

    def move(self, height: float, heading: float, time: float, dt: float) -> None:
        """Moves on towards a height [m] and a heading [rad], to be there in a time [s]."""
        self._lowered = least_jerk_towards(self._lowered, self._crouch, self._lowering, dt)
        self._lowering = max(self._lowering - dt, 0.0)
        self.rise = least_jerk_towards(self.rise, height, time, dt)
        self.heading = least_jerk_towards(self.heading, heading, time, dt)

    def follow(self, dcm: tuple[DcmMotion, DcmMotion], dt: float) -> tuple[Point, Point, Point]:
        """Move C on, C' = omega (xi - C); return it with its rates."""
        (x, vx), (y, vy) = dcm
        w, kept = self._omega, math.exp(-self._omega * dt)
        self._mass = x + (self._mass[0] - x) * kept, y + (self._mass[1] - y) * kept
        rates = (w * (x - self._mass[0]), w * (y - self._mass[1]))
        return self._mass, rates, (w * (vx - rates[0]), w * (vy - rates[1]))

    def carry(self, com: ComMotion) -> None:
        """Take everything along that goes with the body."""
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
