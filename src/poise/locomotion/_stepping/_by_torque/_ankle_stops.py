"""`AnkleStops`: leaves ankles to their stops where the ground tilts soles beyond their range."""

import math

from poise.locomotion._stepping._by_torque._righting import GROUND
from poise.locomotion._stepping._stance import Footing
from poise.locomotion._walking import KNEE
from poise.robots import Robot
from poise.stack import JointLimit, SurfaceContact

_NEAR, _BACK = 0.005, 0.03
"""How near to a limit an ankle is left to its stop, and how far it has to come back from there
until the limit holds again [rad]."""


class AnkleStops:
    """Leave an ankle to its stop while its sole leans on an edge: the sole turns with the shank."""

    def __init__(self, robot: Robot, contacts: list[SurfaceContact], limit: JointLimit) -> None:
        self._contacts, self._limit = contacts, limit
        self._first = robot.nq - robot.nj
        # Pinocchio counts the world and the floating base before the joints.
        self._ankles = [
            [joint - 2 for joint in robot.leg_joints(contact.frame)[KNEE + 1 :]]
            for contact in contacts
        ]
        self._least, self._most = limit.q_min.tolist(), limit.q_max.tolist()
        self._at_stop = dict[int, tuple[bool, bool]]()
        self.reset()

    def reset(self) -> None:
        """All limits hold."""
        for ankles in self._ankles:
            for ankle in ankles:
                self._leave(ankle, False, False)

    def update(self, footing: Footing) -> None:
        """One tick."""
        for foot, contact in enumerate(self._contacts):
            up_x, up_y, _ = footing.soles[foot][1][2].tolist()
            tilted = math.hypot(up_x, up_y) > GROUND
            for ankle in self._ankles[foot]:
                at_lower, at_upper = self._at_stop[ankle]
                if not (tilted or at_lower or at_upper):
                    continue
                angle = float(footing.dynamics.q[self._first + ankle])
                below, above = angle - self._least[ankle], self._most[ankle] - angle
                self._leave(
                    ankle,
                    contact.active and (below < _BACK if at_lower else tilted and below < _NEAR),
                    contact.active and (above < _BACK if at_upper else tilted and above < _NEAR),
                )

    def _leave(self, ankle: int, at_lower: bool, at_upper: bool) -> None:
        if self._at_stop.get(ankle) != (at_lower, at_upper):
            self._at_stop[ankle] = at_lower, at_upper
            self._limit.leave_to_stop(ankle, at_lower=at_lower, at_upper=at_upper)
