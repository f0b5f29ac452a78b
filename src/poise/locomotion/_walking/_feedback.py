"""`DcmFeedback`: the ZMP that brings the robot back to its reference.

All of it lies in the horizontal plane: vectors are x and y in the world. Two numbers are a third as
expensive plain as in arrays.
"""

from poise.locomotion._support import Point, SupportPolygon
from poise.locomotion._walking._leg_momentum import JoinedSupport

_FADE = 0.05
"""How long a ZMP that somebody else has asked for goes on counting [s]: for longer, the divergent
component would leave its way meanwhile, which grows by a fifth in that time."""


class DcmFeedback:
    """Feedback of the divergent component of motion, inside the soles.

    With xi = c + cdot / omega and the reference's own ZMP r_ref = c_ref - cdd_ref / omega^2,

        r = r_ref + (1 + k / omega) (xi - xi_ref)        taken into the support polygon
        cdd = omega^2 (c - r)

    as Englsberger, Ott, Albu-Schaeffer (2015, "Three-Dimensional Bipedal Walking Control Based on
    Divergent Component of Motion") have it; the error dies out with the rate k while the ZMP is
    free.

    Attributes:
        error: of the divergent component, xi - xi_ref [m].
        zmp: r [m].
    """

    def __init__(self, omega: float, gain: float) -> None:
        self.omega, self._gain = omega, gain
        self.zmp = (0.0, 0.0)
        self.begin()

    def begin(self) -> None:
        """Forgets the error."""
        self.error = self._offset = (0.0, 0.0)
        self._continues_from: Point | None = None

    def continue_from(self, zmp: Point) -> None:
        """Begin the next tick at a ZMP and fade into the feedback's own: a bumpless transfer."""
        self._continues_from = zmp

    def acceleration(
        self,
        com: Point,
        velocity: Point,
        reference: tuple[Point, Point, Point],
        support: SupportPolygon | JoinedSupport,
        dt: float = 0.0,
        gain: float | None = None,
    ) -> Point:
        """Return the horizontal acceleration of the CoM [m/s^2]."""
        w = self.omega
        factor = 1.0 + (self._gain if gain is None else gain) / w
        (px, py), (rx, ry), (sx, sy) = reference
        (cx, cy), (vx, vy) = com, velocity
        ex, ey = cx - px + (vx - rx) / w, cy - py + (vy - ry) / w
        x, y = support.nearest((px - sx / (w * w) + factor * ex, py - sy / (w * w) + factor * ey))
        if self._continues_from is not None:
            from_x, from_y = self._continues_from
            self._continues_from, self._offset = None, (from_x - x, from_y - y)
        if self._offset != (0.0, 0.0):
            off_x, off_y = self._offset
            x, y = support.nearest((x + off_x, y + off_y))
            left = max(0.0, 1.0 - dt / _FADE)
            self._offset = left * off_x, left * off_y
        self.error, self.zmp = (ex, ey), (x, y)
        return w * w * (cx - x), w * w * (cy - y)
