"""`CarryingArea`: which part of a sole lies on something, learned from how the sole turns."""

import math

from poise.locomotion._support import Point, SolePart
from poise.locomotion._walking._sense import WalkSense
from poise.stack import Contact, SurfaceContact

_TURNING = 0.3
"""A sole that carries and is faster than this turns about the edge of what it stands on [rad/s]."""

_CARRIES = 0.1
"""Part of the weight under which a sole says nothing of the ground."""

_SPREAD = 0.2
"""How fast the area grows again while the sole does not turn: what has not been tried for a while
may carry [m/s]."""

_LEAST = 0.004
"""Length and width that are always left: on less, nothing could be asked for [m]."""


_SETTLING = 0.15
"""Over which the area is averaged that plans count on, and whoever stands without a step to make: a
foot that rocks has another in every tick, and a ZMP that should rest in it would be thrown to and
fro [s]."""

_WHOLE = 1e-3
"""An average this near to the edge is there [m]."""

_FLAT = 0.25, 0.5
"""Parts of its length and of its width on which a sole carries that lies flat."""


class CarryingArea:
    """A rectangle in a sole on which it may be asked to carry.

    A sole whose middle lies on an edge turns about it as soon as the centre of pressure is asked
    for on the side where there is nothing: the measured one stays on the edge. On that side the
    area ends there, then. Where pressure is measured, something carries; all else grows back slowly
    while the sole lies still.
    """

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
        """Whether the sole seems to lie flat: on an edge, it says nothing of the ground."""
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
        """Update the estimate, and the contact's area.

        While feet are held the contact has the average: a sole that rocks has another area in
        every tick, and one that stands on an edge tips over where all of it is taken to carry.
        """
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
            carries = load > _CARRIES * self._sense.weight
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
    return end if abs(end - edge) <= _WHOLE else edge
