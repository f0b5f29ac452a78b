"""`FootstepPlan`: which foot comes down where and when.

`Ground`: how high it is where a foot comes down.
`SwingShape`: how high a foot is, and how far ahead, through a swing.
`Gait` and `Stride`: how a robot walks, and where to.
"""

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Annotated

import numpy as np
from jaxtyping import Float64

from poise._checks import checked_number
from poise._schema import Bounds, Number, Vector, checked
from poise.dynamics import least_jerk
from poise.errors import ConfigurationError

LARGEST = 10.0
"""No length, time or gain of a walk is larger, whatever its unit; most are far smaller."""


def yaw_rotation(yaw: float) -> Float64[np.ndarray, "2 2"]:
    """Rotation of the horizontal plane by an angle [rad]."""
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[c, -s], [s, c]])


@dataclass(frozen=True, kw_only=True)
class Ground:
    """A floor at one height with platforms on it.

    Attributes:
        height: of the floor in the world [m].
        platforms: what stands on it, each a `Ground.Platform`.
    """

    @checked()
    @dataclass(frozen=True, kw_only=True)
    class Platform:
        """A box on the floor whose top a robot may step on.

        Attributes:
            center: of its footprint in the world [m].
            size: along its x, along its y, and its height [m].
            yaw: its rotation about z [rad].
        """

        center: Annotated[tuple[float, float], Vector(2, Bounds(unit="m"))]
        size: Annotated[tuple[float, float, float], Vector(3, Bounds(positive=True, unit="m"))]
        yaw: Number = 0.0

        def heights(self, points: Float64[np.ndarray, "n 2"]) -> Float64[np.ndarray, " n"]:
            """The platform's height where it is under a point, else zero [m]."""
            local = (points - np.array(self.center)) @ yaw_rotation(self.yaw)
            inside = (np.abs(local) <= 0.5 * np.array(self.size[:2])).all(axis=1)
            return np.where(inside, self.size[2], 0.0)

    height: float = 0.0
    platforms: tuple[Platform, ...] = ()

    def heights(self, points: Float64[np.ndarray, "n 2"]) -> Float64[np.ndarray, " n"]:
        """Height of the ground under each point [m]."""
        rise = np.zeros(len(points))
        for platform in self.platforms:
            rise = np.maximum(rise, platform.heights(points))
        return self.height + rise


RISE = 0.45
"""Phase of the swing at which a foot is at its apex."""


@dataclass(frozen=True, kw_only=True)
class SwingShape:
    """The shape of one swing, over its phase from 0 at lift-off to 1 at touchdown.

    Attributes:
        apex: highest point of the sole, in the world [m].
        depart: phase at which the foot leaves its place sideways; before, it goes straight up.
        arrive: phase at which it is over its goal; from then on, it comes straight down.
    """

    apex: float
    depart: float = 0.0
    arrive: float = 0.93

    def __post_init__(self) -> None:
        if not math.isfinite(self.apex):
            raise ConfigurationError(
                "apex of a swing is not finite", got=self.apex, wanted="a height [m]"
            )
        checked_number(self.depart, "departure of a swing")
        if not self.depart < self.arrive <= 1.0:
            raise ConfigurationError(
                "a swing arrives before it departs, or after its end",
                got=(self.depart, self.arrive),
                wanted="0 <= depart < arrive <= 1",
            )

    def progress(self, phase: float) -> float:
        """Ratio of the horizontal displacement that is behind at a phase."""
        return least_jerk(phase, self.depart, self.arrive - self.depart)[0]

    def height(self, phase: float, begin: float, end: float) -> tuple[float, float, float]:
        """Height of the sole between lift-off and touchdown.

        Args:
            phase: of the swing.
            begin: height at lift-off [m].
            end: height at touchdown [m].

        Returns:
            Height [m] and its first and second derivative by the phase [m].
        """
        apex = max(self.apex, begin, end)
        if phase < RISE:
            ratio, rate, second = least_jerk(phase, 0.0, RISE)
            return begin + ratio * (apex - begin), rate * (apex - begin), second * (apex - begin)
        ratio, rate, second = least_jerk(phase, RISE, 1.0 - RISE)
        return apex + ratio * (end - apex), rate * (end - apex), second * (end - apex)


_MOST_STEPS = 1e3
"""More steps than this are no walk but a mistake."""

_SHORTEST_SWING = 0.1
"""A foot needs this long at least from lift-off to touchdown [s]."""


_Size = Annotated[float, Bounds(positive=True, most=LARGEST, unit="m")]
_Time = Annotated[float, Bounds(positive=True, most=LARGEST, unit="s")]
_Length = Annotated[float, Bounds(most=LARGEST, unit="m")]


@checked()
@dataclass(frozen=True, kw_only=True)
class Gait:
    """The timing and the shape of every step.

    Attributes:
        step_time: from one lift-off to the next [s].
        double_support: how long of it both feet stand [s].
        swing_height: how far a foot is lifted above the higher of its two ends [m].
        width: distance of the feet side by side [m]; as they stand when None.
        crouch: how far the centre of mass is lowered before the first step [m].
        shift_time: from the beginning to the first lift-off [s].
        settle_time: from the last touchdown to the end [s].
    """

    step_time: _Time = 0.7
    double_support: _Time = 0.15
    swing_height: _Size = 0.05
    width: _Size | None = None
    crouch: Annotated[float, Bounds(least=0.0, most=LARGEST, unit="m")] = 0.0
    shift_time: _Time = 1.0
    settle_time: _Time = 1.5

    def __post_init__(self) -> None:
        if self.step_time - self.double_support < _SHORTEST_SWING:
            raise ConfigurationError(
                "the gait leaves a foot no time to swing",
                got=f"step_time {self.step_time:g} s, double_support {self.double_support:g} s",
                wanted=f"{_SHORTEST_SWING:g} s or more between the two",
            )

    @property
    def swing_time(self) -> float:
        """From lift-off to touchdown [s]."""
        return self.step_time - self.double_support


@checked()
@dataclass(frozen=True, kw_only=True)
class Stride:
    """A number of steps of one kind.

    The body goes `length` ahead with every step. What it goes sideways and turns in two steps it
    does with the step of the foot on that side, so that the feet open first and close then, and
    are never nearer to each other than side by side.

    Attributes:
        steps: how many.
        length: ahead with each step [m]; backwards where negative.
        sideways: to the left, a step on average [m].
        turn: to the left, a step on average [rad].
    """

    steps: Annotated[int, Bounds(least=1.0, most=_MOST_STEPS, whole=True)]
    length: _Length = 0.0
    sideways: _Length = 0.0
    turn: Annotated[float, Bounds(most=LARGEST, unit="rad")] = 0.0


_ALONG, _ACROSS = 9, (-0.5, 0.0, 0.5)
"""Points along and across a sole at which the ground under it is looked at."""


@dataclass(frozen=True, kw_only=True)
class Placement:
    """Where a sole lies flat.

    Attributes:
        position: of its centre in the world [m].
        yaw: its heading [rad].
    """

    position: tuple[float, float, float]
    yaw: float

    def grid(self, length: float, width: float) -> Float64[np.ndarray, "n 2"]:
        """Points all over a sole of that size, edges included [m]."""
        x, y = np.meshgrid(np.linspace(-0.5, 0.5, _ALONG) * length, np.array(_ACROSS) * width)
        local = np.stack((x.ravel(), y.ravel()), axis=1)
        return np.array(self.position[:2]) + local @ yaw_rotation(self.yaw).T


@dataclass(frozen=True, kw_only=True)
class Footstep:
    """One step.

    Attributes:
        foot: which foot swings, 0 for the left, 1 for the right.
        goal: where it comes down.
        shape: of the swing that brings it there.
    """

    foot: int
    goal: Placement
    shape: SwingShape


@dataclass(frozen=True, kw_only=True, eq=False)
class FootstepPlan:
    """A walk from one stand to the next: the feet end side by side.

    Made by `plan_footsteps`. Times count from the beginning of the walk.

    Attributes:
        soles: names of the left and of the right sole.
        sizes: length and width of each [m].
        start: where the soles are at the beginning.
        q: configuration at the beginning.
        com: centre of mass there [m].
        steps: in order; left and right take turns.
        gait: timing and shape.
        ground: what the robot walks on.
        clearance: least distance between the feet's edges, side by side [m].

    Raises:
        ConfigurationError: no step, two steps with one foot, or feet that would cross.
    """

    soles: tuple[str, str]
    sizes: tuple[tuple[float, float], tuple[float, float]]
    start: tuple[Placement, Placement]
    q: Float64[np.ndarray, " nq"] = field(repr=False)
    com: tuple[float, float, float]
    steps: tuple[Footstep, ...]
    gait: Gait = field(default_factory=Gait)
    ground: Ground = field(default_factory=Ground)
    clearance: float = 0.01

    def __post_init__(self) -> None:
        if not self.steps:
            raise ConfigurationError("a plan without steps", got=0, wanted="one or more")
        for i, (before, after) in enumerate(pairwise(self.steps)):
            if before.foot == after.foot:
                raise ConfigurationError(
                    f"step {i + 2} of the plan is made with the foot of the step before",
                    got=self.soles[after.foot],
                    wanted="left and right in turns",
                )
        for i in range(len(self.steps) + 1):
            self._check_apart(i)

    def _check_apart(self, done: int) -> None:
        left, right = self.placements(done)
        if not _finite(left) or not _finite(right):
            raise ConfigurationError(
                f"step {done} of the plan is not finite", got=(left, right), wanted="numbers"
            )
        yaw = 0.5 * (left.yaw + right.yaw)
        dx = left.position[0] - right.position[0]
        dy = left.position[1] - right.position[1]
        apart = -math.sin(yaw) * dx + math.cos(yaw) * dy
        # A turned sole takes more room to its side.
        skew = 0.5 * abs(left.yaw - right.yaw)
        needed = self.clearance + sum(
            0.5 * (w * math.cos(skew) + length * math.sin(skew)) for length, w in self.sizes
        )
        if apart < needed:
            raise ConfigurationError(
                f"step {done} of the plan brings the feet together or across each other",
                got=f"{apart:.3f} m from the right sole's centre to the left one's",
                wanted=f"{needed:.3f} m or more",
            )

    @property
    def middle(self) -> tuple[float, float, float]:
        """The middle of the feet at the beginning [m]."""
        left, right = (p.position for p in self.start)
        x, y, z = (0.5 * (a + b) for a, b in zip(left, right, strict=True))
        return x, y, z

    @property
    def count(self) -> int:
        """How many steps there are."""
        return len(self.steps)

    def placements(self, done: int) -> tuple[Placement, Placement]:
        """Where the left and the right sole lie after so many steps."""
        feet = list(self.start)
        for step in self.steps[max(0, done - 2) : done]:
            feet[step.foot] = step.goal
        return feet[0], feet[1]

    def lift_off(self, step: int) -> float:
        """When a step begins, counted from zero [s]."""
        return self.gait.shift_time + step * self.gait.step_time

    def touchdown(self, step: int) -> float:
        """When a step should end [s]."""
        return self.lift_off(step) + self.gait.swing_time

    @property
    def duration(self) -> float:
        """How long the whole walk takes [s]."""
        return self.touchdown(self.count - 1) + self.gait.settle_time


def _finite(placement: Placement) -> bool:
    return all(math.isfinite(value) for value in (*placement.position, placement.yaw))
