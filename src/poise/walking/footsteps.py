"""`FootstepPlan`: which foot comes down where and when."""

import math
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from jaxtyping import Float64

from poise.errors import ConfigurationError
from poise.walking.gait import Gait
from poise.walking.ground import Ground
from poise.walking.swing_shape import SwingShape

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
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        local = np.stack((x.ravel(), y.ravel()), axis=1)
        return np.array(self.position[:2]) + local @ np.array([[c, s], [-s, c]])


@dataclass(frozen=True, kw_only=True)
class Footstep:
    """One step.

    Attributes:
        foot: which foot swings, 0 for the left, 1 for the right.
        goal: where it comes down.
        shape: of the way there.
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
