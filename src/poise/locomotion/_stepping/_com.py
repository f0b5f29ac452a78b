"""`ComMotion`: the COM's velocity along the ground, tick by tick.

`BodyMomentum`: the angular momentum that the body rotator asks for.
`ComHeight`: how high the COM shall be, and how fast it goes there.
`ComDriver`: what moves the COM so that the ZMP gets to its reference; the COM shifter is one.
"""

import math
from collections.abc import Sequence
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float64

from poise.locomotion._pendulum import BodyRotator, ComShifter, pole_zero_damping
from poise.locomotion._stepping._footing import Footing
from poise.locomotion._stepping._parameters import TeleopParameters
from poise.locomotion._stepping._reach import FootRange


class BodyMomentum:
    """Eqs (39a) and (39b): integrated in single support, with a leak; zero otherwise.

    Args:
        rotator: None where it shall not act.
        parameters: length of a tick and leak.

    Attributes:
        reference: about the COM, x and y [kg m^2/s].
    """

    def __init__(self, rotator: BodyRotator | None, parameters: TeleopParameters) -> None:
        self._rotator, self._dt = rotator, parameters.dt
        # A pure integral drives the torso in a limit cycle.
        self._kept = 1.0 - parameters.dt * parameters.momentum_leak
        self.restart()

    def restart(self) -> None:
        """Another mode has begun."""
        self.reference: Float64[np.ndarray, "2"] = np.zeros(2)

    def turn(self, footing: Footing, cart_table_zmp: Float64[np.ndarray, "2"]) -> None:
        """One tick.

        Args:
            footing: of the tick.
            cart_table_zmp: CT-ZMP [m].
        """
        if self._rotator is None or not footing.mode.single:
            self.restart()
            return
        rate = self._rotator.momentum_rate(footing.zmp_reference, cart_table_zmp)
        self.reference = self._kept * self.reference + self._dt * rate


_OBSERVED = 20.0
"""How fast the observed velocity of the COM follows the measured one, beside what the commanded
acceleration says [1/s]: noise and the shock of a landing are gone in two ticks, a sway is not."""

_BRAKED = 0.2
"""Part of its largest acceleration with which the COM is braked before a knee is at its limit: by
torques it follows some 0.2 s late. With 0.5 Romeo's knee was at its torque before it stood."""

_LATE = 0.2
"""How late that is where the knee of the leg that carries alone is at its limit [s]: beyond that
nothing brakes."""

_GIVES = 0.01
"""How far below where a knee holds the hip may be before the other foot is put down [m]."""

_DEEPER = 0.01
"""How far below a foot in the air the body comes down for it where it has felt no floor [m]."""


class ComHeight:
    """Eq. (15b) with (17a); lower where the legs need it, and steady.

    Args:
        height: of the COM above the soles at the start, H [m].
        reach: of the legs.
        parameters: gains and speeds.

    Attributes:
        offset: how much higher than at the start the operator asks for, as far as legs allow [m].
    """

    def __init__(self, height: float, reach: FootRange, parameters: TeleopParameters) -> None:
        self._height, self._range, self._parameters = height, reach, parameters
        self._velocity = self.offset = 0.0

    def restart(self, velocity: float) -> None:
        """Somebody else has led the COM, and it moves as it does now.

        Args:
            velocity: upwards [m/s].
        """
        self._velocity = velocity

    def room(self, footing: Footing) -> tuple[float, bool]:
        """What is left over the foot that carries.

        Args:
            footing: of the tick.

        Returns:
            How far the COM may still come down [m]; and whether the leg gives way: the body is too
            low for the knee that carries alone, and will not come up again.
        """
        stance = footing.stance
        too_weak = self._too_weak(footing, stance, self._range.hip(stance, footing.dynamics))
        below = min(float(footing.dynamics.com[2]) - self._lowest(footing), -too_weak)
        return max(0.0, below), footing.mode.single and too_weak > _GIVES

    def velocity(self, footing: Footing, target: Float64[np.ndarray, "3"]) -> float:
        """Velocity of the COM upwards [m/s].

        Args:
            footing: of the tick.
            target: where the foot that is not the stance is sent [m].
        """
        p = self._parameters
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
        velocity = max(-min(p.lift_speed, braked), min(p.lift_speed, p.k_v * way))
        change = p.dt * p.lift_acceleration
        self._velocity = max(self._velocity - change, min(self._velocity + change, velocity))
        return self._velocity

    def _too_weak(self, footing: Footing, foot: int, hip: Float64[np.ndarray, "3"]) -> float:
        return self._range.too_weak(foot, footing.anchors[foot], hip, footing.heading)

    def _too_low(self, footing: Footing, hips: Sequence[Float64[np.ndarray, "3"]]) -> float:
        """How far the hips are too low for what carries; negative for room [m].

        A leg that carries bends no further than its ankle lets the sole stay level.
        """
        carries, heading = footing.mode.support, footing.heading
        feet = (footing.stance,) if footing.mode.single else (0, 1)
        return max(
            self._range.too_low(
                foot, footing.anchors[foot], hips[foot], heading, alone=foot == carries
            )
            for foot in feet
        )

    def _reference(
        self,
        footing: Footing,
        target: Float64[np.ndarray, "3"],
        hips: Sequence[Float64[np.ndarray, "3"]],
        too_low: float,
    ) -> float:
        """Eq. (15b), lower where a leg could not reach its foot, now or at the end [m].

        Not for a target below the floor: there the body would be coming down when the foot lands.
        """
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
        return (1.0 - self._parameters.stoop_max) * self._height + footing.ground


def _felt(footing: Footing, target: Float64[np.ndarray, "3"]) -> Float64[np.ndarray, "3"]:
    """A target no lower than the floor; where there is none, no lower than just below the foot."""
    if not footing.mode.single:
        return target
    x, y, z = target.tolist()
    floor = min(footing.lowest_ground, float(footing.sole(footing.other)[2]) - _DEEPER)
    return np.array([x, y, max(z, floor)])


@runtime_checkable
class ComDriver(Protocol):
    """From ZMP references to velocities of the COM.

    Attributes:
        omega: sqrt(g / H) [1/s].
    """

    omega: float

    def drive(
        self,
        reference: Float64[np.ndarray, "2"],
        position: Float64[np.ndarray, "2"],
        velocity: Float64[np.ndarray, "2"],
        dt: float,
    ) -> tuple[Float64[np.ndarray, "2"], Float64[np.ndarray, "2"]]:
        """One tick.

        Args:
            reference: of the ZMP; may jump [m].
            position: of the COM, estimated [m].
            velocity: of the COM, commanded in the last tick [m/s].
            dt: length of a tick [s].

        Returns:
            The next velocity [m/s] and its acceleration [m/s^2].
        """
        ...

    def restart(
        self, commanded: Float64[np.ndarray, "2"], measured: Float64[np.ndarray, "2"]
    ) -> Float64[np.ndarray, "2"]:
        """The velocity to go on from when the mode has changed, of the two there are [m/s]."""
        ...


class ShifterDriver:
    """The COM shifter (37), its acceleration integrated.

    Args:
        shifter: the feedback.
    """

    def __init__(self, shifter: ComShifter) -> None:
        self.shifter, self.omega = shifter, shifter.omega

    def drive(
        self,
        reference: Float64[np.ndarray, "2"],
        position: Float64[np.ndarray, "2"],
        velocity: Float64[np.ndarray, "2"],
        dt: float,
    ) -> tuple[Float64[np.ndarray, "2"], Float64[np.ndarray, "2"]]:
        """One tick of (37)."""
        acceleration = self.shifter.acceleration(reference, position, velocity)
        return velocity + dt * acceleration, acceleration

    def restart(
        self, commanded: Float64[np.ndarray, "2"], measured: Float64[np.ndarray, "2"]
    ) -> Float64[np.ndarray, "2"]:
        """The measured velocity: an integrator that starts to act starts from what is."""
        del commanded
        return measured


class ComMotion:
    """Integrates the driver's reference, within what the soles can support.

    Args:
        driver: COM shifter or preview control.
        parameters: length of a tick and leak.

    Attributes:
        omega: sqrt(g / H) [1/s].
        velocity: commanded in the last tick [m/s].
        acceleration: commanded in the last tick [m/s^2].
        observed: velocity as measured, with what was commanded made smooth [m/s].
        borrowed: zero: nothing is asked for that the soles do not give.
    """

    def __init__(self, driver: ComDriver, parameters: TeleopParameters) -> None:
        self.omega, self.borrowed = driver.omega, 0.0
        self.velocity: Float64[np.ndarray, "2"] = np.zeros(2)
        self.acceleration: Float64[np.ndarray, "2"] = np.zeros(2)
        self.observed: Float64[np.ndarray, "2"] = np.zeros(2)
        self._driver, self._parameters = driver, parameters

    def observe(self, measured: Float64[np.ndarray, "2"]) -> None:
        """Takes a measured velocity, once a tick and before all else.

        Joint velocities and the gyroscope are noisy, and at the moment of a landing they are those
        of a shock: what begins anew from them alone begins with a jump, which robot and ZMP follow.

        Args:
            measured: velocity of the COM [m/s].
        """
        dt = self._parameters.dt
        expected = self.observed + dt * self.acceleration
        gain = dt * _OBSERVED / (1.0 + dt * _OBSERVED)
        self.observed = expected + gain * (measured - expected)

    def restart(self) -> None:
        """Contacts have changed: the driver says what to go on from."""
        self.velocity = self._driver.restart(self.velocity, self.observed.copy())

    def cart_table_zmp(self, com: Float64[np.ndarray, "2"]) -> Float64[np.ndarray, "2"]:
        """CT-ZMP, eq. (26), of the commanded acceleration [m].

        Args:
            com: x and y [m].
        """
        return com - self.acceleration / self.omega**2

    def drive(self, footing: Footing) -> None:
        """One tick.

        Args:
            footing: of the tick.
        """
        p, dynamics, before = self._parameters, footing.dynamics, self.velocity
        com, reference = dynamics.com[:2], footing.zmp_reference
        # While a sole rocks on its edge the COM moves by itself, which an integral does not notice.
        before = before + p.dt * p.velocity_leak * (dynamics.com_velocity[:2] - before)
        driver = self._driver
        if not isinstance(driver, ShifterDriver):
            self.velocity, self.acceleration = driver.drive(reference, com, before, p.dt)
            return
        unsupported, setting_off = _straight(driver.shifter, reference, com, before)
        (x, y), (goal_x, goal_y) = com.tolist(), (com - unsupported / self.omega**2).tolist()
        support, goal = footing.support, (goal_x, goal_y)
        kept_x, kept_y = support.towards((x, y), goal) if setting_off else support.nearest(goal)
        self.acceleration = self.omega**2 * np.array([x - kept_x, y - kept_y])
        self.velocity = before + p.dt * self.acceleration


_FADE = 0.3
"""How long a ZMP that somebody else has led goes on counting [s]."""

_BEYOND, _BORROWING, _REPAYING = 0.003, 0.05, 1.5
"""So far beyond the support the CT-ZMP is asked for of trunk, arms and leg [m]; in what time that
counts for all, and in what time they are taken to be back after it [s]."""


class ComFeedback:
    """The COM shifter (37) where accelerations are commanded: feedback on what is measured.

    Under the gain rule its CT-ZMP is r + k_s (xi - r) with the divergent component xi; what another
    k_d than the rule's damps is added. Far from its reference that leaves the soles, where a limit
    on each axis by itself loses the direction: the reference is taken a_lim / k_p ahead of xi, on
    the straight way, and the CT-ZMP to the nearest place that may be asked for, see
    `Footing.asked`. So a component that is about to leave the soles is braked first.

    Args:
        shifter: gains.
        dt: length of a tick [s].

    Attributes:
        borrowed: how much more than the sole that carries alone gives has been asked for lately,
            from 0 to 1.
        omega: sqrt(g / H) [1/s].
        velocity: measured in the last tick [m/s].
        acceleration: commanded in the last tick [m/s^2].
        observed: velocity as measured [m/s].
    """

    def __init__(self, shifter: ComShifter, dt: float) -> None:
        self.omega, self._dt = shifter.omega, dt
        self.borrowed = 0.0
        self._gain = 1.0 + shifter.kp / shifter.omega**2
        rule = pole_zero_damping(shifter.kp, shifter.omega)
        self._damping = (shifter.kd - rule) / shifter.omega**2
        self._ahead = shifter.acceleration_max / shifter.kp
        self.velocity: Float64[np.ndarray, "2"] = np.zeros(2)
        self.acceleration: Float64[np.ndarray, "2"] = np.zeros(2)
        self.observed: Float64[np.ndarray, "2"] = np.zeros(2)
        self._offset = (0.0, 0.0)

    def take_over(self, zmp: Float64[np.ndarray, "2"], footing: Footing) -> None:
        """Goes on from where somebody else has led the ZMP, without a jump.

        Its reference begins where it asks for that ZMP, and fades into its own.

        Args:
            zmp: as asked for last [m].
            footing: of the tick.
        """
        com, velocity = footing.dynamics.com[:2], footing.dynamics.com_velocity[:2]
        capture = com + velocity / self.omega
        begin = capture + (capture + self._damping * velocity - zmp) / (self._gain - 1.0)
        x, y = (begin - footing.zmp_reference).tolist()
        self._offset = (x, y)

    def observe(self, measured: Float64[np.ndarray, "2"]) -> None:
        """Takes the measured velocity of the COM [m/s]: an estimator has made it smooth."""
        self.observed = measured.copy()

    def restart(self) -> None:
        """Contacts have changed: it remembers nothing that could be wrong."""

    def cart_table_zmp(self, com: Float64[np.ndarray, "2"]) -> Float64[np.ndarray, "2"]:
        """CT-ZMP, eq. (26), of the commanded acceleration [m].

        Args:
            com: x and y [m].
        """
        return com - self.acceleration / self.omega**2

    def drive(self, footing: Footing) -> None:
        """One tick.

        Args:
            footing: of the tick.
        """
        com_x, com_y, _ = footing.dynamics.com.tolist()
        self.velocity = footing.dynamics.com_velocity[:2].copy()
        speed_x, speed_y = self.velocity.tolist()
        x, y = com_x + speed_x / self.omega, com_y + speed_y / self.omega
        goal_x, goal_y = footing.zmp_reference.tolist()
        off_x, off_y = self._offset
        to_x, to_y = goal_x + off_x - x, goal_y + off_y - y
        kept = 1.0 - self._dt / _FADE
        self._offset = off_x * kept, off_y * kept
        near = min(1.0, self._ahead / max(math.hypot(to_x, to_y), 1e-9))
        pull = near * (self._gain - 1.0)
        damp_x, damp_y = self._damping * speed_x, self._damping * speed_y
        zmp = footing.asked.nearest((x - pull * to_x + damp_x, y - pull * to_y + damp_y))
        beyond = footing.mode.single and footing.support.depth(zmp) < -_BEYOND
        change = self._dt / _BORROWING if beyond else -self._dt / _REPAYING
        self.borrowed = min(max(self.borrowed + change, 0.0), 1.0)
        stiffness = self.omega**2
        self.acceleration = np.array([stiffness * (com_x - zmp[0]), stiffness * (com_y - zmp[1])])


def _straight(
    shifter: ComShifter,
    reference: Float64[np.ndarray, "2"],
    com: Float64[np.ndarray, "2"],
    velocity: Float64[np.ndarray, "2"],
) -> tuple[Float64[np.ndarray, "2"], bool]:
    """The COM shifter's acceleration, and whether it sets off: then one factor shortens both axes.

    The COM goes straight from foot to foot, and not along one axis first, beside the soles. And
    a_lim is for setting off; a COM that is on its way must be braked by what the soles give.
    """
    free = shifter.unlimited(reference, com, velocity)
    (x, y), (velocity_x, velocity_y) = free.tolist(), velocity.tolist()
    most, limit = max(abs(x), abs(y)), shifter.acceleration_max
    setting_off = x * velocity_x + y * velocity_y >= 0.0
    return (free * (limit / most) if setting_off and most > limit else free), setting_off
