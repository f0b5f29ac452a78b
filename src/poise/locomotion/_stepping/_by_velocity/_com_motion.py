"""`ComMotion`: the COM's velocity along the ground, tick by tick, where velocities are commanded.

`ComDriver`: what moves the COM so that the ZMP gets to its reference; the COM shifter is one.
"""

from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float64

from poise.locomotion._pendulum import ComShifter
from poise.locomotion._stepping._stance import Footing

_OBSERVED = 20.0
"""How fast the observed velocity of the COM follows the measured one, beside what the commanded
acceleration says [1/s]: noise and the shock of a landing are gone in two ticks, a sway is not."""


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
        """One tick."""
        ...

    def restart(
        self, commanded: Float64[np.ndarray, "2"], measured: Float64[np.ndarray, "2"]
    ) -> Float64[np.ndarray, "2"]:
        """The velocity to go on from when the mode has changed, of the two there are [m/s]."""
        ...


class ShifterDriver:
    """The COM shifter (37), its acceleration integrated."""

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
    """Integrate the driver's reference, within the support of the soles."""

    def __init__(self, driver: ComDriver, dt: float, leak: float) -> None:
        self.omega = driver.omega
        # Commanded in the last tick [m/s, m/s^2].
        self.velocity: Float64[np.ndarray, "2"] = np.zeros(2)
        self.acceleration: Float64[np.ndarray, "2"] = np.zeros(2)
        # As measured, smoothed with the commanded acceleration [m/s].
        self.observed: Float64[np.ndarray, "2"] = np.zeros(2)
        self._driver, self._dt, self._leak = driver, dt, leak

    def observe(self, measured: Float64[np.ndarray, "2"]) -> None:
        """Takes a measured velocity, once a tick and before all else.

        Joint velocities and the gyroscope are noisy, and at the moment of a landing they are those
        of a shock: what begins anew from them alone begins with a jump, which robot and ZMP follow.
        """
        dt = self._dt
        expected = self.observed + dt * self.acceleration
        gain = dt * _OBSERVED / (1.0 + dt * _OBSERVED)
        self.observed = expected + gain * (measured - expected)

    def restart(self) -> None:
        """Contacts have changed: the driver says what to go on from."""
        self.velocity = self._driver.restart(self.velocity, self.observed.copy())

    def cart_table_zmp(self, com: Float64[np.ndarray, "2"]) -> Float64[np.ndarray, "2"]:
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
