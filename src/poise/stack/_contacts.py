"""`SurfaceContact`: a rectangle flat on the ground.

`PointContact`: a point that can push but not twist.
"""

import math

import numpy as np
from jaxtyping import Float64, Int64

from poise._checks import checked_number
from poise.errors import ConfigurationError
from poise.robots import Robot
from poise.stack._contact import Contact


class PointContact(Contact):
    """A point contact: three forces in a friction pyramid, no moment.

    With f along the contact's axes: |f_x| <= friction f_z, |f_y| <= friction f_z. Only the linear
    acceleration of the frame is held.

    Args:
        frame: the frame in contact; its z axis is the contact normal.
        friction: Coulomb coefficient of the pyramid.
        damping: how fast a residual velocity dies out [1/s].
        min_load: least normal force while loaded, by the robot's weight.
        name: what reports call it; the frame when None.
    """

    def __init__(
        self,
        frame: str,
        *,
        friction: float = 0.7,
        damping: float = 20.0,
        min_load: float = 0.02,
        name: str | None = None,
    ) -> None:
        super().__init__(
            frame, friction=friction, damping=damping, min_load=min_load, dim=3, name=name
        )

    def _make_cone(self, robot: Robot) -> Float64[np.ndarray, "rows dim"]:  # noqa: ARG002
        mu = self.friction
        return np.array([[1.0, 0.0, -mu], [-1.0, 0.0, -mu], [0.0, 1.0, -mu], [0.0, -1.0, -mu]])


TORSION_FRACTION = 0.5
"""Fraction of `friction * half diagonal` that the yaw moment may use when nothing is given.

A rectangle resting on its four corners holds at most `friction * half diagonal * f_z` in pure yaw;
half of it leaves the other half to the tangential forces, which the ten rows treat apart."""


class SurfaceContact(Contact):
    """A rectangular surface contact with the ten rows of Ahn et al. 2024: C F <= 0.

    With F = [f; m] along the contact's axes at the rectangle's centre,

        |f_x| <= friction f_z,  |f_y| <= friction f_z        friction pyramid, 4 rows
        |m_x| <= width/2 f_z,   |m_y| <= length/2 f_z        centre of pressure inside, 4 rows
        |m_z| <= torsion f_z                                 yaw moment, 2 rows

    Where the leg of a sole lacks a joint, the contact holds what is `Sole.controlled`, and bears no
    moment about the axis that is not. A sole that leans with its leg stands on its lower edge, left
    or right, where m_x = 0, and what acts does so at the middle of that edge. Within `FULL_TILT` of
    flat it goes over from one edge to the other. The yaw moment is what friction holds on an edge.

    Args:
        frame: a sole of the robot, or any frame if `length` and `width` are given.
        friction: Coulomb coefficient of the pyramid (its corner reaches sqrt(2) times as far as
            the cone of the same coefficient).
        length: along the frame's x [m]; the sole's own when None.
        width: along the frame's y [m]; the sole's own when None.
        torsion: bound of the yaw moment per normal force [m]; half of `friction` times the half
            diagonal when None. An edge has its own.
        margin: how far the centre of pressure stays inside the edges [m].
        damping: how fast a residual velocity dies out [1/s].
        min_load: least normal force while loaded, by the robot's weight.
        name: what reports call it; the frame when None.
    """

    def __init__(
        self,
        frame: str,
        *,
        friction: float = 0.7,
        length: float | None = None,
        width: float | None = None,
        torsion: float | None = None,
        margin: float = 0.005,
        damping: float = 20.0,
        min_load: float = 0.02,
        name: str | None = None,
    ) -> None:
        super().__init__(
            frame, friction=friction, damping=damping, min_load=min_load, dim=6, name=name
        )
        self._size = (length, width)
        for value, what in ((length, "length"), (width, "width"), (torsion, "torsion")):
            if value is not None:
                checked_number(value, f"{what} of contact {self.name!r} [m]", above=0.0)
        self._torsion = torsion
        self._margin = checked_number(margin, f"margin of contact {self.name!r} [m]")

    @property
    def margin(self) -> float:
        """How far the centre of pressure stays inside the edges [m]; the cone is made of it."""
        return self._margin

    def _held_components(self, robot: Robot) -> Int64[np.ndarray, " dim"]:
        sole = robot.soles.get(self.frame)
        return self.chosen if sole is None else np.array(sole.controlled)

    def _make_cone(self, robot: Robot) -> Float64[np.ndarray, "rows dim"]:
        length, width = self._rectangle(robot)
        x, y = length / 2.0 - self.margin, width / 2.0 - self.margin
        if min(x, y) <= 0.0:
            raise ConfigurationError(
                f"margin of contact {self.name!r} leaves nothing of the surface",
                got=self.margin,
                wanted=f"less than {min(length, width) / 2.0:g} m",
            )
        self.pressure_reach[:] = x, y
        if 3 not in self.chosen:
            self.parameters[-1] = width / 2.0
            return _edge_cone(self.friction, x)[:, self.chosen]
        half_diagonal = math.hypot(length, width) / 2.0
        torsion = self._torsion or TORSION_FRACTION * self.friction * half_diagonal
        limits = {0: self.friction, 1: self.friction, 3: y, 4: x, 5: torsion}
        bounded = [component for component in limits if component in self.chosen]
        cone = np.zeros((2 * len(bounded), 6))
        for i, component in enumerate(bounded):
            cone[2 * i, component], cone[2 * i + 1, component] = 1.0, -1.0
            cone[2 * i : 2 * i + 2, 2] = -limits[component]
        return cone[:, self.chosen]

    def _rectangle(self, robot: Robot) -> tuple[float, float]:
        sole = robot.soles.get(self.frame)
        length = self._size[0] or (sole.length if sole else None)
        width = self._size[1] or (sole.width if sole else None)
        if length is None or width is None:
            raise ConfigurationError(
                f"contact {self.name!r} is not on a sole of robot {robot.name!r}",
                got=self.frame,
                wanted="a sole, or length and width [m]",
                choices=robot.soles,
            )
        return length, width


def _edge_cone(friction: float, half: float) -> Float64[np.ndarray, "10 6"]:
    """The cone of an edge along x, exactly: that of a rectangle without width.

    The nearer the pressure comes to an end of the edge, the less yaw moment its friction holds
    (Caron, Pham, Nakamura 2015, "Stability of Surface Contacts for Humanoid Robots"):

        |f_x| <= friction f_z,  |f_y| <= friction f_z,  |m_y| <= half f_z
        |half f_y + friction m_y| <= friction half f_z - m_z
        |half f_y - friction m_y| <= friction half f_z + m_z

    Args:
        friction: Coulomb coefficient.
        half: of the edge's length [m].
    """
    f_x, f_y, f_z, _, m_y, m_z = np.eye(6)
    pairs = [
        (f_x, friction * f_z),
        (f_y, friction * f_z),
        (m_y, half * f_z),
        (half * f_y + friction * m_y, friction * half * f_z - m_z),
        (half * f_y - friction * m_y, friction * half * f_z + m_z),
    ]
    return np.array([sign * row - most for row, most in pairs for sign in (1.0, -1.0)])
