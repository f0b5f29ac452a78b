"""`PlanShift`: the walk carried on beside its plan, and a foothold moved to catch the robot."""

import math

Pair = tuple[float, float]


class PlanShift:
    """What moved footholds do to the references, exactly, on the linear inverted pendulum.

    If from time T on the ZMP's reference lies D beside its plan, a divergent component xi that
    stays bounded has to be D e^{-omega (T - t)} beside its own before, and D after. The COM
    follows with cdot = omega (xi - c).

    Args:
        omega: natural frequency of the COM over the ground [1/s].

    Attributes:
        settled: how far the ZMP's reference lies beside the plan now [m].
        coming: how much farther it will from the next foothold on [m].
        com: how far the COM's reference lies beside the plan [m].
        velocity: rate of `com` [m/s].
        acceleration: rate of `velocity` [m/s^2].
    """

    def __init__(self, omega: float) -> None:
        self._omega = omega
        self.settled: Pair = (0.0, 0.0)
        self.coming: Pair = (0.0, 0.0)
        self.com: Pair = (0.0, 0.0)
        self.velocity: Pair = (0.0, 0.0)
        self.acceleration: Pair = (0.0, 0.0)

    def advance(self, dt: float, left: float) -> None:
        """Moves on.

        Args:
            dt: since the last call [s].
            left: until the ZMP goes over to the next foothold [s].
        """
        w, fade = self._omega, math.exp(-self._omega * max(left, 0.0))
        blend = math.exp(-w * dt)
        com, velocity, acceleration = [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]
        for k in (0, 1):
            ahead = self.coming[k] * fade
            xi = self.settled[k] + ahead
            com[k] = xi + (self.com[k] - xi) * blend
            velocity[k] = w * (xi - com[k])
            acceleration[k] = w * (w * ahead - velocity[k])
        self.com, self.velocity = (com[0], com[1]), (velocity[0], velocity[1])
        self.acceleration = (acceleration[0], acceleration[1])

    def land(self, shift: Pair) -> None:
        """A foot came down so far beside its plan [m]."""
        self.settled, self.coming = shift, (0.0, 0.0)
