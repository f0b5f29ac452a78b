"""`ComMotion`: the COM's velocity along the ground, tick by tick."""

import numpy as np
from jaxtyping import Float64

from poise.balance import ComShifter
from poise.teleop.com_driver import ComDriver, ShifterDriver
from poise.teleop.footing import Footing
from poise.teleop.parameters import TeleopParameters
from poise.teleop.rules import Rules


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
