"""`SurfaceContact`: a rectangle flat on the ground.

`PointContact`: a point that can push but not twist.
"""

import math
from typing import Any, cast

import numpy as np
from jaxtyping import Float64, Int64

from poise._checks import checked_number
from poise.errors import ConfigurationError
from poise.robots import Robot
from poise.stack._contact import Contact

_ALL_OF_IT = (-math.inf, -math.inf), (math.inf, math.inf)
"""Lower and upper corner of the loaded area of a surface until `carry_on` changes it [m]."""


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


class SurfaceContact(Contact):
    """A rectangular surface contact: C F <= 0.

    With F = [f; m] along the contact's axes at the rectangle's centre, and X and Y half its length
    and width, `margin` inside,

        |f_x| <= friction f_z,  |f_y| <= friction f_z        friction pyramid, 4 rows
        |m_x| <= Y f_z,         |m_y| <= X f_z               centre of pressure inside, 4 rows
         m_z  <= friction (X + Y) f_z - |Y f_x + friction m_x| - |X f_y + friction m_y|
        -m_z  <= friction (X + Y) f_z - |Y f_x - friction m_x| - |X f_y - friction m_y|

    The last two, eight rows, are the yaw moment that friction holds. Together the sixteen are
    exactly the wrenches of forces in the pyramid at the four corners (Caron, Pham, Nakamura 2015,
    "Stability of Surface Contacts for Humanoid Robots"). The nearer the centre of pressure comes to
    an edge, the less yaw moment there is, and none in a corner. Where `torsion` is given,

        |m_z| <= torsion f_z                                 2 rows in place of the eight

    stands for them, which makes the ten rows of Ahn et al. 2024. A sole that is
    loaded at its edge can then turn.

    Where the leg of a sole lacks a joint, the contact holds the components `Sole.controlled`, and
    bears no moment about the other axis. A sole that tilts with its leg stands on its lower edge,
    left or right, where m_x = 0, and the wrench acts at the middle of that edge. Within `FULL_TILT`
    of flat the edges are blended. The yaw moment is bounded by the friction on the edge.

    Args:
        frame: a sole of the robot, or any frame if `length` and `width` are given.
        friction: Coulomb coefficient of the pyramid (its corner reaches sqrt(2) times as far as
            the cone of the same coefficient).
        length: along the frame's x [m]; the sole's own when None.
        width: along the frame's y [m]; the sole's own when None.
        torsion: bound of the yaw moment per normal force, wherever the centre of pressure is [m];
            what friction holds when None. An edge has its own.
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
        # The cone of a rectangle is linear in half its length and half its width, see `carry_on`.
        self._surface: tuple[Float64[np.ndarray, "rows 6"], ...] = ()
        self._carries = _ALL_OF_IT
        self._margin = checked_number(margin, f"margin of contact {self.name!r} [m]")

    @property
    def margin(self) -> float:
        """Distance of the CoP kept from the edges [m]; `set_margin` changes it."""
        return self._margin

    def set_margin(self, margin: float) -> None:
        """Set how far the centre of pressure stays inside the edges, from the next tick on.

        The area set by `carry_on` stays. The strategies "whole_body" and "reduced" read it; "osf"
        keeps to the margin that it was made with.

        Args:
            margin: [m].

        Raises:
            ConfigurationError: it is negative or not finite, or leaves nothing of the surface.
        """
        checked_number(margin, f"margin of contact {self.name!r} [m]")
        robot = self._robot
        if robot is not None:
            self.pressure_reach[:] = self._reach(robot, margin)
        self._margin = margin
        if robot is not None and self.tilts:
            self.carry_on(*self._carries)
        elif robot is not None:
            self.cone[:] = self._make_cone(robot)

    @property
    def tilts(self) -> bool:
        """True where it bears moments about both own axes: not on an edge, see `Sole.leans`."""
        return 3 in self.chosen and 4 in self.chosen

    def carry_on(self, lower: tuple[float, float], upper: tuple[float, float]) -> None:
        """Set the part of the surface that lies on something, from the next tick on.

        With the middle p of that rectangle the cone is that of a smaller surface, of the wrench
        about p: m_p = m - p x f. The strategies "whole_body" and "reduced" read it; "osf" keeps to
        the whole surface.

        Args:
            lower: its corner with the least x and y along the contact's axes [m]; what lies outside
                of the surface, `margin` inside, is cut.
            upper: the one with the greatest [m].

        Raises:
            ConfigurationError: it is not bound to a robot, or stands on an edge; or the corners are
                no such corners.
        """
        if self._robot is None or not self.tilts:
            raise ConfigurationError(
                f"contact {self.name!r} has no surface that could shrink",
                got=repr(self),
                wanted="a contact that is bound to a robot and bears moments about x and y",
            )
        if not _is_rectangle(lower, upper):
            raise ConfigurationError(
                f"contact {self.name!r} cannot carry on that",
                got=(lower, upper),
                wanted="least x and y, then greatest x and y [m]; infinite where there is no edge",
            )
        self._carries = lower, upper
        reach = self.pressure_reach.tolist()
        least, most = (
            [min(max(c, -r), r) for c, r in zip(corner, reach, strict=True)]
            for corner in (lower, upper)
        )
        (x, y), (px, py) = (
            [0.5 * (b + sign * a) for a, b in zip(least, most, strict=True)] for sign in (-1, 1)
        )
        shift = np.eye(6)
        shift[3, 2], shift[4, 2], shift[5, :2] = -py, px, (py, -px)
        plain, per_x, per_y = self._surface
        self.cone[:] = ((plain + x * per_x + y * per_y) @ shift)[:, self.chosen]

    def _held_components(self, robot: Robot) -> Int64[np.ndarray, " dim"]:
        sole = robot.soles.get(self.frame)
        return self.chosen if sole is None else np.array(sole.controlled)

    def _make_cone(self, robot: Robot) -> Float64[np.ndarray, "rows dim"]:
        x, y = self.pressure_reach[:] = self._reach(robot, self._margin)
        if 3 not in self.chosen:
            self.parameters[3 + 2 * self.dim] = self._rectangle(robot)[1] / 2.0
            # On an edge along x, a rectangle without width, some rows are none or there twice.
            rows = _rectangle_cone(self.friction, x, 0.0, None, yaws=True)[:, self.chosen] + 0.0
            rows = rows[rows.any(axis=1)]
            return rows[np.sort(np.unique(rows, axis=0, return_index=True)[1])]
        plain, long, wide = (
            _rectangle_cone(self.friction, *size, self._torsion, yaws=5 in self.chosen)
            for size in ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))
        )
        self._surface = plain, long - plain, wide - plain
        return (plain + x * (long - plain) + y * (wide - plain))[:, self.chosen]

    def _reach(self, robot: Robot, margin: float) -> tuple[float, float]:
        """Half of length and width, less a margin [m]."""
        length, width = self._rectangle(robot)
        x, y = length / 2.0 - margin, width / 2.0 - margin
        if min(x, y) <= 0.0:
            raise ConfigurationError(
                f"margin of contact {self.name!r} leaves nothing of the surface",
                got=margin,
                wanted=f"less than {min(length, width) / 2.0:g} m",
            )
        return x, y

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


def _is_rectangle(lower: object, upper: object) -> bool:
    try:
        (left, back), (right, front) = cast("Any", (lower, upper))
        # Not so of NaN. Rounding may take a line of no width for one that is turned over.
        return bool(left <= right + 1e-9 and back <= front + 1e-9)
    except (TypeError, ValueError):
        return False


def _rectangle_cone(
    friction: float, x: float, y: float, torsion: float | None, *, yaws: bool
) -> Float64[np.ndarray, "rows 6"]:
    """The cone of a rectangle, see `SurfaceContact`."""
    f_x, f_y, f_z, m_x, m_y, m_z = np.eye(6)
    pairs = [(f_x, friction * f_z), (f_y, friction * f_z), (m_x, y * f_z), (m_y, x * f_z)]
    if yaws and torsion is not None:
        pairs.append((m_z, torsion * f_z))
    elif yaws:
        for sign in (1.0, -1.0):
            across, along = y * f_x + sign * friction * m_x, x * f_y + sign * friction * m_y
            most = friction * (x + y) * f_z - sign * m_z
            pairs += [(across + along, most), (across - along, most)]
    return _two_sided(pairs)


def _two_sided(
    pairs: list[tuple[Float64[np.ndarray, "6"], Float64[np.ndarray, "6"]]],
) -> Float64[np.ndarray, "rows 6"]:
    """Rows C F <= 0 of |row F| <= most F."""
    return np.array([sign * row - most for row, most in pairs for sign in (1.0, -1.0)])
