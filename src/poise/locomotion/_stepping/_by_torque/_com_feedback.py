"""`ComFeedback`: the COM's acceleration along the ground, where torques are commanded."""

import math

import numpy as np
from jaxtyping import Float64

from poise.locomotion._pendulum import ComShifter, pole_zero_damping
from poise.locomotion._stepping._stance import Footing

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
