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
"""Least length and width of the area [m]."""


_SETTLING = 0.15
"""Time constant of the average of the area for plans and at rest: a foot that rocks has another
in every tick [s]."""

_FLAT = 0.25, 0.5
"""Parts of its length and of its width on which a sole carries that lies flat."""


_Edges = tuple[float, ...]
"""Lower edges along x and y of a rectangle in a sole, then its upper ones [m]."""


class CarryingArea:
    """Rectangle of a sole that may bear load."""

    def __init__(self, sense: WalkSense, foot: int, contact: Contact) -> None:
        self._sense, self._foot = sense, foot
        surface = isinstance(contact, SurfaceContact) and contact.tilts
        self._contact = contact if surface else None
        x, y = contact.pressure_reach.tolist()
        self.whole: _Edges = (-x, -y, x, y)  # of all that can carry
        self.edges = self._told = self._average = self.whole
        self._settled: _Edges | None = None

    @property
    def lies(self) -> bool:
        """True while the sole seems flat: on an edge, it does not measure the ground."""
        return all(
            self.edges[2 + k] - self.edges[k] >= _FLAT[k] * 2.0 * self.whole[2 + k] for k in (0, 1)
        )

    def bearing(self, whole: SolePart) -> SolePart:
        """Return the region of the ZMP in single support on this foot."""
        known = self._average
        return whole if known == self.whole else whole.within(*self._open(known))

    def part(self, size: Point) -> SolePart | None:
        """Return the loaded area of the sole as estimated; None for all of it."""
        if self._average == self.whole:
            return None
        length, width = size
        ends = (-0.5 * length, -0.5 * width, 0.5 * length, 0.5 * width)
        # An edge that is where it can be at most is the sole's: contacts keep a margin.
        edges = zip(self._average, self.whole, ends, strict=True)
        a, b, c, d = (end if edge == most else edge for edge, most, end in edges)
        part = SolePart(0.5 * (a + c), 0.5 * (b + d), c - a, d - b)
        return None if (part.length, part.width) == size else part

    def forget(self) -> None:
        """All of the sole carries, for all that is known."""
        self.edges, self._average, self._settled = self.whole, self.whole, None
        self._tell(self.edges)

    def update(self, dt: float, *, settled: bool = False) -> None:
        self._learn_from(dt)
        self._tell(self._average if settled else self.edges)

    def _learn_from(self, dt: float) -> None:
        contact = self._contact
        if contact is None:
            return
        stands = contact.active
        *_, x, y, _ = self._sense.velocities[self._foot]
        still = not stands or (abs(x) <= _TURNING and abs(y) <= _TURNING)
        known = self._settled == (self.whole if stands else None)
        if still and known and self.edges == self.whole:
            return
        wrench = self._sense.wrenches[self._foot]
        if wrench is None or not stands:
            self.edges = self.whole
        else:
            _, _, load, m_x, m_y, _ = wrench
            carries = load > LOADED * self._sense.weight
            pressure = (-m_y / load, m_x / load) if carries else (None, None)
            # Turning to the front, about y, the toes go down; to the right, about x, that edge.
            low_x, high_x = self._learn(0, y, pressure[0], dt)
            low_y, high_y = self._learn(1, -x, pressure[1], dt)
            self.edges = low_x, low_y, high_x, high_y
        self._settle(stands, dt)

    def _tell(self, edges: _Edges) -> None:
        """Set the contact's edges where they have changed."""
        if self._contact is not None and edges != self._told:
            self._told = edges
            self._contact.carry_on(*self._open(edges))

    def _open(self, edges: _Edges) -> tuple[Point, Point]:
        """Lower and upper corner, infinite where edges are where they can be at most [m]."""
        # Those take nothing away: contacts keep a margin, and it may change.
        pairs = zip(edges, self.whole, strict=True)
        a, b, c, d = (math.copysign(math.inf, most) if e == most else e for e, most in pairs)
        return (a, b), (c, d)

    def _settle(self, stands: bool, dt: float) -> None:
        """Average the area for planning, since the foot came to stand."""
        if not stands:
            self._settled, self._average = None, self.whole
            return
        ratio, before = -math.expm1(-dt / _SETTLING), self._settled or self.whole
        pairs = zip(before, self.edges, strict=True)
        self._settled = known = tuple(old + ratio * (new - old) for old, new in pairs)
        # An edge that is nearly where it can be at most is there.
        pairs = zip(known, self.whole, strict=True)
        self._average = tuple(most if abs(most - e) <= LEVEL else e for e, most in pairs)

    def _learn(self, axis: int, down: float, pressure: float | None, dt: float) -> Point:
        """Return lower and upper edge along one axis of the sole."""
        reach, lower, upper = self.whole[2 + axis], self.edges[axis], self.edges[2 + axis]
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
        return max(min(lower, middle - missing), -reach), min(max(upper, middle + missing), reach)


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
        # A sole that leans with its leg does not measure the slope of the ground.
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
        # Of each sole as estimated; None for all of it.
        pairs = zip(self._areas, self._stand.sizes, strict=True)
        parts = self.parts = [area.part(size) for area, size in pairs]
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

    def follow(self, heading: float) -> None:
        """Looks again at two feet that stand, once they seem to have moved."""
        for foot, place in enumerate(self.feet):
            x, y, _ = self._sense.positions[foot]
            if math.dist((x, y), place.position[:2]) > _DRIFT:
                self.stand_on((0, 1), heading)
                return

    def _feel(self, rotation: Rotation) -> None:
        """Update the ground's slope by a flat sole, world_R_sole."""
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
