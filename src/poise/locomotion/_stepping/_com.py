"""`ComMotion`: the COM's velocity along the ground, tick by tick.

`BodyMomentum`: the angular momentum that the body rotator asks for.
`ComHeight`: how high the COM shall be, and how fast it goes there.
`ComDriver`: what moves the COM so that the ZMP gets to its reference; two of them.
"""

from collections import deque
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float64

from poise.locomotion._pendulum import BodyRotator, ComShifter, natural_frequency
from poise.locomotion._preview import PreviewControl
from poise.locomotion._stepping._footing import Footing
from poise.locomotion._stepping._parameters import TeleopParameters
from poise.locomotion._stepping._reach import FootRange
from poise.locomotion._stepping._rules import Rules


class BodyMomentum:
    """Eqs (39a) and (39b): integrated in single support, with a leak; zero otherwise.

    Args:
        rotator: None where it shall not act.
        parameters: length of a tick and leak.
        rules: departures from the paper.

    Attributes:
        wanted: about the COM, x and y [kg m^2/s].
    """

    def __init__(
        self, rotator: BodyRotator | None, parameters: TeleopParameters, rules: Rules
    ) -> None:
        self._rotator, self._dt = rotator, parameters.dt
        leak = parameters.dt * parameters.momentum_leak
        self._kept = 1.0 - leak if rules.leaking_momentum else 1.0
        self.restart()

    @property
    def acts(self) -> bool:
        """Whether there is a rotator."""
        return self._rotator is not None

    def restart(self) -> None:
        """Another mode has begun."""
        self.wanted: Float64[np.ndarray, "2"] = np.zeros(2)

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
        self.wanted = self._kept * self.wanted + self._dt * rate


_HERE = np.zeros(2)


class ComHeight:
    """Eq. (15b) with (17a); lower where the legs need it, and steady.

    Args:
        height: of the COM above the soles at the start, H [m].
        reach: of the legs.
        parameters: gains and speeds.
        rules: departures from the paper.
    """

    def __init__(
        self, height: float, reach: FootRange, parameters: TeleopParameters, rules: Rules
    ) -> None:
        self._height, self._range = height, reach
        self._parameters, self._rules = parameters, rules
        self._velocity = 0.0

    def room_below(self, footing: Footing) -> float:
        """How far the COM may still come down [m].

        Args:
            footing: of the tick.
        """
        if not self._rules.stooping:
            return 0.0
        return max(0.0, float(footing.dynamics.com[2]) - self._lowest(footing))

    def velocity(self, footing: Footing, target: Float64[np.ndarray, "3"]) -> float:
        """Velocity of the COM upwards [m/s].

        Args:
            footing: of the tick.
            target: where the foot that is not the stance is sent [m].
        """
        p = self._parameters
        wanted = p.k_v * (self._wanted(footing, target) - float(footing.dynamics.com[2]))
        if not self._rules.gentle:
            return max(-p.v_lim, min(p.v_lim, wanted))
        wanted = max(-p.lift_speed, min(p.lift_speed, wanted))
        change = p.dt * p.lift_acceleration
        self._velocity = max(self._velocity - change, min(self._velocity + change, wanted))
        return self._velocity

    def _wanted(self, footing: Footing, target: Float64[np.ndarray, "3"]) -> float:
        """Eq. (15b), lower where a leg could not reach its foot, now or at the end [m]."""
        nominal = self._height + footing.ground
        if not self._rules.stooping:
            return nominal
        com, stance, anchors = footing.dynamics.com, footing.stance, footing.anchors
        hips = [self._range.hip(foot, footing.dynamics) for foot in (0, 1)]
        too_high = max(
            self._range.too_high(foot, place, hips[foot], shift)
            for foot, place in ((stance, anchors[stance]), (footing.other, target))
            for shift in (_HERE, footing.zmp_reference - com[:2])
        )
        # A leg that carries bends no further than its ankle lets the sole stay level.
        too_low = max(
            self._range.too_low(foot, anchors[foot], hips[foot], footing.heading)
            for foot in ((stance,) if footing.mode.single else (0, 1))
        )
        lowest = max(float(com[2]) + too_low, self._lowest(footing))
        return min(nominal, max(float(com[2]) - too_high, lowest))

    def _lowest(self, footing: Footing) -> float:
        return (1.0 - self._parameters.stoop_max) * self._height + footing.ground


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


class PreviewDriver:
    """Preview control as a baseline: the reference goes through a buffer of N ticks first.

    What the controller takes for the present is the reference of N ticks ago; the buffer holds
    what comes after it. So a reference that jumps acts N T later, and the ZMP begins to move
    earlier.

    Args:
        height: of the COM [m].
        dt: length of a tick [s].
        length: N.
    """

    def __init__(self, height: float, dt: float, length: int) -> None:
        self.control = PreviewControl(height, dt, length)
        self.omega = natural_frequency(height)
        self._buffer: deque[Float64[np.ndarray, "2"]] = deque(maxlen=length)
        self._acceleration = np.zeros(2)

    def drive(
        self,
        reference: Float64[np.ndarray, "2"],
        position: Float64[np.ndarray, "2"],
        velocity: Float64[np.ndarray, "2"],
        dt: float,
    ) -> tuple[Float64[np.ndarray, "2"], Float64[np.ndarray, "2"]]:
        """One tick, with the position fed back."""
        del dt
        missing = self.control.length - len(self._buffer)
        self._buffer.extend([reference.copy()] * max(missing, 1))
        # The newest reference is N ticks ahead: until then nothing is to be seen of it.
        state = np.stack((position, velocity, self._acceleration))
        jerk = self.control.jerk(state, np.stack(self._buffer))
        _, velocity, self._acceleration = self.control.advance(state, jerk)
        return velocity, self._acceleration

    def restart(
        self, commanded: Float64[np.ndarray, "2"], measured: Float64[np.ndarray, "2"]
    ) -> Float64[np.ndarray, "2"]:
        """The commanded velocity: the pattern goes on across modes."""
        del measured
        return commanded


class ComMotion:
    """Integrates what the driver wants, within what the soles can support.

    Args:
        driver: COM shifter or preview control.
        parameters: length of a tick and leak.
        rules: departures from the paper.

    Attributes:
        omega: sqrt(g / H) [1/s].
        velocity: commanded in the last tick [m/s].
        acceleration: likewise [m/s^2].
    """

    def __init__(self, driver: ComDriver, parameters: TeleopParameters, rules: Rules) -> None:
        self.omega = driver.omega
        self.velocity: Float64[np.ndarray, "2"] = np.zeros(2)
        self.acceleration: Float64[np.ndarray, "2"] = np.zeros(2)
        self._driver, self._parameters, self._rules = driver, parameters, rules

    def restart(self, measured: Float64[np.ndarray, "2"]) -> None:
        """Contacts have changed: the driver says what to go on from.

        Args:
            measured: velocity of the COM [m/s].
        """
        self.velocity = self._driver.restart(self.velocity, measured)

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
        if self._rules.felt_velocity:
            measured = dynamics.com_velocity[:2]
            before = before + p.dt * p.velocity_leak * (measured - before)
        driver = self._driver
        if not (self._rules.supported and isinstance(driver, ShifterDriver)):
            self.velocity, self.acceleration = driver.drive(reference, com, before, p.dt)
            return
        wanted, setting_off = _straight(driver.shifter, reference, com, before)
        start, goal = (float(com[0]), float(com[1])), com - wanted / self.omega**2
        point = (float(goal[0]), float(goal[1]))
        support = footing.support
        kept = support.towards(start, point) if setting_off else support.nearest(point)
        self.acceleration = self.omega**2 * (com - np.array(kept))
        self.velocity = before + p.dt * self.acceleration


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
    most, limit = float(np.abs(free).max()), shifter.acceleration_max
    setting_off = float(free @ velocity) >= 0.0
    return (free * (limit / most) if setting_off and most > limit else free), setting_off
