"""Feet on the ground: `Stance`, and `CarryingArea`, the part of a sole that is loaded."""

import math
from collections.abc import Sequence
from dataclasses import replace

from poise.locomotion._support import Point, Rotation, SolePart, SupportPolygon, both_soles
from poise.locomotion._walking._footsteps import Stand
from poise.locomotion._walking._ground import LEVEL
from poise.locomotion._walking._sense import LOADED, WalkSense
from poise.stack import Contact, SurfaceContact

_TURNING = 0.3
"""A sole that carries and is faster than this turns about the edge of what it stands on [rad/s]."""

_SPREAD = 0.2
"""Rate at which the area grows again while the sole does not turn: ground not tried for a while
may carry [m/s]."""

_LEAST = 0.004
"""Length and width that are always left: on less, nothing could be asked for [m]."""


_SETTLING = 0.15
"""Time constant of the average of the area for plans and at rest: a foot that rocks has another
in every tick [s]."""

_FLAT = 0.25, 0.5
"""Parts of its length and of its width on which a sole carries that lies flat."""


class CarryingArea:
    """A rectangle in a sole on which it may be asked to carry."""

    def __init__(self, sense: WalkSense, foot: int, contact: Contact) -> None:
        self._sense, self._foot = sense, foot
        surface = isinstance(contact, SurfaceContact) and contact.tilts
        self._contact = contact if surface else None
        x, y = contact.pressure_reach.tolist()
        self._reach: Point = (x, y)
        self._lower, self._upper = [-x, -y], [x, y]
        self._told = self._all_of_it = (-x, -y, x, y)
        # Lower and upper edges on the average; all that can carry where nothing is known [m].
        self._average = self._all_of_it
        self._settled: tuple[float, float, float, float] | None = None

    @property
    def lies(self) -> bool:
        """True while the sole seems to lie flat: on an edge, it says nothing of the ground."""
        sizes = zip(self._lower, self._upper, self._reach, _FLAT, strict=True)
        return all(upper - lower >= part * 2.0 * reach for lower, upper, reach, part in sizes)

    def bearing(self, whole: SolePart) -> SolePart:
        """Return the region of the ZMP in single support on this foot."""
        known = self._average
        return whole if known == self._all_of_it else whole.within(*self._open(*known))

    def part(self, size: Point) -> SolePart | None:
        """Return the loaded area of the sole as estimated; None for all of it."""
        edges = self._average
        if edges == self._all_of_it:
            return None
        ends: list[Point] = []
        for axis, side in enumerate(size):
            low, high, most = edges[axis], edges[2 + axis], self._reach[axis]
            # An edge that is where it can be at most is the sole's: contacts keep a margin.
            ends.append(
                (-0.5 * side if low == -most else low, 0.5 * side if high == most else high)
            )
        (a, b), (c, d) = ends
        part = SolePart(0.5 * (a + b), 0.5 * (c + d), b - a, d - c)
        return None if (part.length, part.width) == size else part

    def forget(self) -> None:
        """All of the sole carries, for all that is known."""
        self._lower, self._upper = [-r for r in self._reach], list(self._reach)
        self._settled, self._average = None, self._all_of_it
        self._tell(*self._lower, *self._upper)

    def update(self, dt: float, *, settled: bool = False) -> None:
        """Update the estimate, and the contact's area."""
        self._learn_from(dt)
        self._tell(*(self._average if settled else (*self._lower, *self._upper)))

    def _learn_from(self, dt: float) -> None:
        contact = self._contact
        if contact is None:
            return
        stands = contact.active
        *_, x, y, _ = self._sense.velocities[self._foot]
        still = not stands or (abs(x) <= _TURNING and abs(y) <= _TURNING)
        edges, all_of_it = (*self._lower, *self._upper), self._all_of_it
        if still and edges == all_of_it and self._settled == (all_of_it if stands else None):
            return
        wrench = self._sense.wrenches[self._foot]
        if wrench is None or not stands:
            self._lower, self._upper = [-r for r in self._reach], list(self._reach)
        else:
            _, _, load, m_x, m_y, _ = wrench
            carries = load > LOADED * self._sense.weight
            pressure = (-m_y / load, m_x / load) if carries else (None, None)
            # Turning to the front, about y, the toes go down; to the right, about x, that edge.
            for axis, down in enumerate((y, -x)):
                self._learn(axis, down, pressure[axis], dt)
        self._settle(stands, dt)

    def _tell(self, a: float, b: float, c: float, d: float) -> None:
        """Tells the contact what it does not know yet: its lower and its upper edges."""
        if self._contact is not None and (a, b, c, d) != self._told:
            self._told = (a, b, c, d)
            self._contact.carry_on(*self._open(a, b, c, d))

    def _open(self, a: float, b: float, c: float, d: float) -> tuple[Point, Point]:
        """Lower and upper corner, infinite where edges are where they can be at most [m]."""
        # Those take nothing away: contacts keep a margin, and it may change.
        x, y = self._reach
        lower = (-math.inf if a == -x else a, -math.inf if b == -y else b)
        return lower, (math.inf if c == x else c, math.inf if d == y else d)

    def _settle(self, stands: bool, dt: float) -> None:
        """Averages the area for those who plan, from where the foot came to stand on."""
        edges = (*self._lower, *self._upper)
        if not stands:
            self._settled, self._average = None, self._all_of_it
            return
        a, b, c, d = self._settled or self._all_of_it
        ratio = -math.expm1(-dt / _SETTLING)
        self._settled = (
            a + ratio * (edges[0] - a),
            b + ratio * (edges[1] - b),
            c + ratio * (edges[2] - c),
            d + ratio * (edges[3] - d),
        )
        (a, b, c, d), (x, y) = self._settled, self._reach
        self._average = _whole(a, -x), _whole(b, -y), _whole(c, x), _whole(d, y)

    def _learn(self, axis: int, down: float, pressure: float | None, dt: float) -> None:
        """One axis of the sole."""
        reach, lower, upper = self._reach[axis], self._lower[axis], self._upper[axis]
        if abs(down) <= _TURNING:
            lower, upper = lower - _SPREAD * dt, upper + _SPREAD * dt
        if pressure is not None:
            at = min(max(pressure, -reach), reach)
            if down > _TURNING:
                upper = at
            elif down < -_TURNING:
                lower = at
            lower, upper = min(lower, at), max(upper, at)
        missing = 0.5 * max(_LEAST - (upper - lower), 0.0)
        middle = min(max(0.5 * (lower + upper), -reach + missing), reach - missing)
        self._lower[axis] = max(min(lower, middle - missing), -reach)
        self._upper[axis] = min(max(upper, middle + missing), reach)


def _whole(edge: float, end: float) -> float:
    """An edge, or the end of what can carry where it is nearly there [m]."""
    return end if abs(end - edge) <= LEVEL else edge


_CLOSED, _CLOSED_TURN = 0.025, 0.06
"""Feet so near to side by side are [m, rad]."""

_DRIFT = 0.002
"""Feet that seem to have moved by more than this stand elsewhere [m]."""

_TRUST = 0.5
"""Part of the way that the slope goes towards that of a new stance foot: one foot may
stand on a bump, three in a row do not."""

_STEEPEST = 0.2
"""A sole that is turned farther than this against the slope so far stands on an edge."""


class Stance:
    """Both feet: where they stand, or stood before they were lifted."""

    def __init__(
        self, sense: WalkSense, stand: Stand, margin: float, areas: Sequence[CarryingArea]
    ) -> None:
        self._sense, self._stand, self._margin = sense, stand, margin
        self._areas = areas
        self.feet = list(stand.start)  # where both stand; a foot in the air where it stood
        self.slope: Point = (0.0, 0.0)  # how steeply the ground rises along the world's x and y
        self.support = SupportPolygon([], 0.0)  # where the ZMP can be
        self.parts: list[SolePart | None] = [None, None]
        self._feet: tuple[int, ...] = ()
        self._seen: list[SolePart | None] = [None, None]

    def stand_on(self, feet: tuple[int, ...], heading: float) -> None:
        """Looks at the feet that carry the robot from now on."""
        # A sole that leans with its leg says nothing of the ground.
        foot, *others = feet
        if not others and self._stand.bearings[foot].width > 0.0 and self._areas[foot].lies:
            self._feel(self._sense.sole(foot)[1])
        for foot in feet:
            place = self._sense.placement(foot)
            turns = round((heading - place.yaw) / (2.0 * math.pi))
            yaw = place.yaw + 2.0 * math.pi * turns
            self.feet[foot] = replace(place, yaw=yaw, slope=self.slope)
        self._feet = feet
        self._look(self.parts)

    def refresh(self) -> None:
        """Update the support polygon of two soles, where only a part of one carries, or did."""
        parts = self.parts = self._estimated_parts()
        if len(self._feet) == 2 and not parts == self._seen == [None, None]:
            self._look(parts)

    def _look(self, parts: list[SolePart | None]) -> None:
        self._seen = parts
        sense, stand, (foot, *others) = self._sense, self._stand, self._feet
        if others:
            both = [sense.sole(0), sense.sole(1)]
            self.support = both_soles(both, stand.sizes, self._margin, parts)
        else:
            corners = stand.bearings[foot].corners(*sense.sole(foot), self._margin)
            self.support = SupportPolygon(corners, 0.0)

    def _estimated_parts(self) -> list[SolePart | None]:
        """Return the loaded area of each sole as estimated; None for all of it."""
        (left, right), sizes = self._areas, self._stand.sizes
        return [left.part(sizes[0]), right.part(sizes[1])]

    def follow(self, heading: float) -> None:
        """Looks again at two feet that stand, once they seem to have moved."""
        for foot, place in enumerate(self.feet):
            x, y, _ = self._sense.positions[foot]
            if math.dist((x, y), place.position[:2]) > _DRIFT:
                self.stand_on((0, 1), heading)
                return

    def _feel(self, rotation: Rotation) -> None:
        """Learns from a sole that lies on the ground, world_R_sole."""
        x, y, z = rotation[:, 2].tolist()
        seen = (-x / z, -y / z)
        if math.dist(seen, self.slope) < _STEEPEST:
            a, b = (old + _TRUST * (new - old) for old, new in zip(self.slope, seen, strict=True))
            self.slope = (a, b)

    def bearing(self, foot: int) -> SolePart:
        """Return the region of the ZMP in single support on a foot, as estimated."""
        return self._areas[foot].bearing(self._stand.bearings[foot])

    @property
    def heading(self) -> float:
        """Mean of both feet's [rad]."""
        return 0.5 * (self.feet[0].yaw + self.feet[1].yaw)

    def closed(self, width: float) -> bool:
        """Return whether the feet are side by side."""
        left, right = self.feet
        yaw = self.heading
        dx, dy = (left.position[k] - right.position[k] for k in (0, 1))
        ahead = math.cos(yaw) * dx + math.sin(yaw) * dy
        aside = math.cos(yaw) * dy - math.sin(yaw) * dx
        return (
            abs(ahead) < _CLOSED
            and abs(aside - width) < _CLOSED
            and abs(left.yaw - right.yaw) < _CLOSED_TURN
        )
