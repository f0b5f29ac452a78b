"""Motion of the COM where velocities are commanded: `ComMotion`, `ComHeight`, `BodyMomentum`."""

import math
from collections.abc import Sequence
from typing import Protocol, runtime_checkable

import numpy as np

from poise.locomotion._pendulum import BodyRotator, ComShifter
from poise.locomotion._stepping._by_velocity._velocity_tasks import VelocityNumbers
from poise.locomotion._stepping._stance import POSITION_GAIN, Footing, TeleopParameters
from poise.locomotion._support import Vector2, Vector3
from poise.locomotion._walking import GIVES, FootRange

_OBSERVED = 20.0
"""Rate at which the observed velocity of the COM follows the measured one [1/s]: noise and the
shock of a landing are gone in two ticks, a sway is not."""


@runtime_checkable
class ComDriver(Protocol):
    """From ZMP references to velocities of the COM.

    Attributes:
        omega: sqrt(g / H) [1/s].
    """

    omega: float

    def drive(
        self, reference: Vector2, position: Vector2, velocity: Vector2, dt: float
    ) -> tuple[Vector2, Vector2]:
        """One tick."""
        ...

    def restart(self, commanded: Vector2, measured: Vector2) -> Vector2:
        """The velocity to go on from when the mode has changed, of the two there are [m/s]."""
        ...


class ShifterDriver:
    """The COM shifter (37), its acceleration integrated."""

    def __init__(self, shifter: ComShifter) -> None:
        self.shifter, self.omega = shifter, shifter.omega

    def drive(
        self, reference: Vector2, position: Vector2, velocity: Vector2, dt: float
    ) -> tuple[Vector2, Vector2]:
        """One tick of (37)."""
        acceleration = self.shifter.acceleration(reference, position, velocity)
        return velocity + dt * acceleration, acceleration

    def restart(self, commanded: Vector2, measured: Vector2) -> Vector2:
        """The measured velocity: an integrator that starts to act starts from what is."""
        del commanded
        return measured


class ComMotion:
    """Integrate the driver's reference, within the support of the soles."""

    def __init__(self, driver: ComDriver, dt: float, leak: float) -> None:
        self.omega = driver.omega
        # Commanded in the last tick [m/s, m/s^2].
        self.velocity: Vector2 = np.zeros(2)
        self.acceleration: Vector2 = np.zeros(2)
        # As measured, smoothed with the commanded acceleration [m/s].
        self.observed: Vector2 = np.zeros(2)
        self._driver, self._dt, self._leak = driver, dt, leak

    def observe(self, measured: Vector2) -> None:
        """Takes a measured velocity, once a tick and before all else."""
        dt = self._dt
        expected = self.observed + dt * self.acceleration
        gain = dt * _OBSERVED / (1.0 + dt * _OBSERVED)
        self.observed = expected + gain * (measured - expected)

    def restart(self) -> None:
        """Contacts have changed: the driver says what to go on from."""
        self.velocity = self._driver.restart(self.velocity, self.observed.copy())

    def cart_table_zmp(self, com: Vector2) -> Vector2:
        """CT-ZMP, eq. (26), of the commanded acceleration [m]."""
        return com - self.acceleration / self.omega**2

    def drive(self, footing: Footing) -> None:
        """One tick."""
        dt, dynamics, before = self._dt, footing.dynamics, self.velocity
        com, reference = dynamics.com[:2], footing.zmp_reference
        # While a sole rocks on its edge the COM moves by itself, which an integral does not notice.
        before = before + dt * self._leak * (dynamics.com_velocity[:2] - before)
        driver = self._driver
        if not isinstance(driver, ShifterDriver):
            self.velocity, self.acceleration = driver.drive(reference, com, before, dt)
            return
        unsupported, setting_off = _straight(driver.shifter, reference, com, before)
        (x, y), (goal_x, goal_y) = com.tolist(), (com - unsupported / self.omega**2).tolist()
        support, goal = footing.support, (goal_x, goal_y)
        kept_x, kept_y = support.towards((x, y), goal) if setting_off else support.nearest(goal)
        self.acceleration = self.omega**2 * np.array([x - kept_x, y - kept_y])
        self.velocity = before + dt * self.acceleration


def _straight(
    shifter: ComShifter, reference: Vector2, com: Vector2, velocity: Vector2
) -> tuple[Vector2, bool]:
    """Return the shifter's acceleration, on a straight line, and whether the COM sets off."""
    free = shifter.unlimited(reference, com, velocity)
    (x, y), (velocity_x, velocity_y) = free.tolist(), velocity.tolist()
    most, limit = max(abs(x), abs(y)), shifter.acceleration_max
    setting_off = x * velocity_x + y * velocity_y >= 0.0
    return (free * (limit / most) if setting_off and most > limit else free), setting_off


_BRAKED = 0.2
"""Part of its largest acceleration with which the COM is braked before a knee is at its limit."""

_LATE = 0.2
"""Delay of braking where the knee of the stance leg is at its limit [s]."""

_DEEPER = 0.01
"""Depth below a swing foot to which the body is lowered for it before it meets a floor [m]."""


class ComHeight:
    """Eq. (15b) with (17a); lower where the legs need it, and steady."""

    def __init__(
        self,
        height: float,
        reach: FootRange,
        parameters: TeleopParameters,
        numbers: VelocityNumbers,
    ) -> None:
        self._height, self._range, self._numbers = height, reach, numbers
        self._dt, self._stoop_max = parameters.dt, parameters.stoop_max
        self._velocity = self.offset = 0.0

    def restart(self, velocity: float) -> None:
        """Go on from the vertical velocity of the CoM [m/s]."""
        self._velocity = velocity

    def room(self, footing: Footing) -> tuple[float, bool]:
        """Return how far the CoM may come down [m], and whether the stance leg gives way."""
        stance = footing.stance
        too_weak = self._too_weak(footing, stance, self._range.hip(stance, footing.dynamics))
        below = min(float(footing.dynamics.com[2]) - self._lowest(footing), -too_weak)
        return max(0.0, below), footing.mode.single and too_weak > GIVES

    def velocity(self, footing: Footing, target: Vector3) -> float:
        """Velocity of the COM upwards [m/s]."""
        p = self._numbers
        hips = [self._range.hip(foot, footing.dynamics) for foot in (0, 1)]
        too_low = self._too_low(footing, hips)
        way = self._reference(footing, target, hips, too_low) - float(footing.dynamics.com[2])
        # At v_lim downwards the robot would fall faster than its legs can carry; and one that is
        # not braked in time goes on beyond where a knee still holds it.
        braking = _BRAKED * p.lift_acceleration
        braked = math.sqrt(2.0 * braking * max(-too_low, 0.0))
        carries = footing.mode.support
        if carries is not None:
            room = max(-self._too_weak(footing, carries, hips[carries]), 0.0)
            braked = min(braked, braking * (math.sqrt(_LATE**2 + 2.0 * room / braking) - _LATE))
        velocity = max(-min(p.lift_speed, braked), min(p.lift_speed, POSITION_GAIN * way))
        change = self._dt * p.lift_acceleration
        self._velocity = max(self._velocity - change, min(self._velocity + change, velocity))
        return self._velocity

    def _too_weak(self, footing: Footing, foot: int, hip: Vector3) -> float:
        return self._range.too_weak(foot, footing.anchors[foot], hip, footing.heading)

    def _too_low(self, footing: Footing, hips: Sequence[Vector3]) -> float:
        """Return the depth of the hips below where the legs hold them; negative for room [m]."""
        carries, heading = footing.mode.support, footing.heading
        feet = (footing.stance,) if footing.mode.single else (0, 1)
        return max(
            self._range.too_low(
                foot, footing.anchors[foot], hips[foot], heading, alone=foot == carries
            )
            for foot in feet
        )

    def _reference(
        self, footing: Footing, target: Vector3, hips: Sequence[Vector3], too_low: float
    ) -> float:
        """Eq. (15b), lower where a leg could not reach its foot, now or at the end [m]."""
        reach, stance, anchors = self._range, footing.stance, footing.anchors
        x, y, height = footing.dynamics.com.tolist()
        zmp_x, zmp_y = footing.zmp_reference.tolist()
        too_high = -math.inf
        for foot, place in ((stance, anchors[stance]), (footing.other, _felt(footing, target))):
            for shift in ((0.0, 0.0), (zmp_x - x, zmp_y - y)):
                too_high = max(too_high, reach.too_high(foot, place, hips[foot], shift))
        lowest = max(height + too_low, self._lowest(footing))
        usual = self._height + footing.ground
        asked = max(usual + self.offset, min(usual, lowest))
        return min(asked, max(height - too_high, lowest))

    def _lowest(self, footing: Footing) -> float:
        return (1.0 - self._stoop_max) * self._height + footing.ground


def _felt(footing: Footing, target: Vector3) -> Vector3:
    """A target no lower than the floor; where there is none, no lower than just below the foot."""
    if not footing.mode.single:
        return target
    x, y, z = target.tolist()
    floor = min(footing.lowest_ground, float(footing.sole(footing.other)[2]) - _DEEPER)
    return np.array([x, y, max(z, floor)])


class BodyMomentum:
    """Eqs (39a) and (39b): integrated in single support, with a leak; zero otherwise."""

    def __init__(self, rotator: BodyRotator | None, dt: float, leak: float) -> None:
        self._rotator, self._dt = rotator, dt
        # A pure integral drives the torso in a limit cycle.
        self._kept = 1.0 - dt * leak
        self.restart()

    def restart(self) -> None:
        """Another mode has begun."""
        self.reference: Vector2 = np.zeros(2)  # about the COM, x and y [kg m^2/s]

    def turn(self, footing: Footing, cart_table_zmp: Vector2) -> None:
        """One tick."""
        if self._rotator is None or not footing.mode.single:
            self.restart()
            return
        rate = self._rotator.momentum_rate(footing.zmp_reference, cart_table_zmp)
        self.reference = self._kept * self.reference + self._dt * rate
