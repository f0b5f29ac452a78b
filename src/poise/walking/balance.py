"""`DcmFeedback`: the ZMP that brings the robot back to its reference."""

from collections.abc import Sequence

from poise.balance.support import Point, SupportPolygon


class DcmFeedback:
    """Feedback of the divergent component of motion, inside the soles.

    With xi = c + cdot / omega and the reference's own ZMP r_ref = c_ref - cdd_ref / omega^2,

        r = r_ref + (1 + k / omega) (xi - xi_ref)        taken into the support polygon
        cdd = omega^2 (c - r)

    as Englsberger, Ott, Albu-Schaeffer (2015, "Three-Dimensional Bipedal Walking Control Based on
    Divergent Component of Motion") have it; the error dies out with the rate k while the ZMP is
    free.

    Args:
        omega: natural frequency of the COM over the ground [1/s].
        gain: k [1/s].

    Attributes:
        error: of the divergent component, xi - xi_ref [m].
        zmp: r [m].
    """

    def __init__(self, omega: float, gain: float) -> None:
        self.omega, self._gain = omega, 1.0 + gain / omega
        self.error: Point = (0.0, 0.0)
        self.zmp: Point = (0.0, 0.0)

    def acceleration(
        self,
        com: Point,
        velocity: Point,
        reference: tuple[Sequence[float], Sequence[float], Sequence[float]],
        support: SupportPolygon,
    ) -> Point:
        """The COM's horizontal acceleration [m/s^2].

        Args:
            com: as measured [m].
            velocity: as measured [m/s].
            reference: position, velocity and acceleration of the COM.
            support: where the ZMP can be.
        """
        w = self.omega
        wanted, error = [0.0, 0.0], [0.0, 0.0]
        for k in (0, 1):
            position, speed, pull = (part[k] for part in reference)
            error[k] = com[k] - position + (velocity[k] - speed) / w
            wanted[k] = position - pull / (w * w) + self._gain * error[k]
        self.error = (error[0], error[1])
        self.zmp = support.nearest((wanted[0], wanted[1]))
        return (w * w * (com[0] - self.zmp[0]), w * w * (com[1] - self.zmp[1]))
