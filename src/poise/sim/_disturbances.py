"""What a scenario does to the plant: pushes, payloads, and links that are not as described."""

import math
from dataclasses import dataclass
from typing import Annotated

from poise._schema import Bounds, Duration, Number, Seconds, Text, Truth, Vector, checked

FARTHEST = 1e2
"""No place or angle in a plant is farther than this [m, rad]: MuJoCo loses its accuracy there."""

Offset = Annotated[tuple[float, float, float], Vector(3, Bounds(most=FARTHEST, unit="m"))]
Factor = Annotated[float, Bounds(positive=True, most=1e6)]


@checked()
@dataclass(frozen=True, kw_only=True)
class Push:
    """A constant force on a body for a while.

    Attributes:
        body: a frame with a part to play (the force acts at its origin) or a link of the document
            (the force acts at the link's centre of mass).
        force: force in the world [N].
        start: when the push begins [s].
        duration: how long it lasts [s].
    """

    body: str
    force: Annotated[tuple[float, float, float], Vector(3, Bounds(unit="N"))]
    start: Seconds
    duration: Duration

    def fraction(self, begin: float, end: float) -> float:
        """How much of the interval [begin, end] the push is active, in [0, 1].

        A push that starts or ends inside a physics step acts with this fraction of its force, so
        that its impulse is force x duration whatever the step.
        """
        overlap = min(end, self.start + self.duration) - max(begin, self.start)
        return max(0.0, overlap) / (end - begin)


@checked()
@dataclass(frozen=True, kw_only=True)
class Payload:
    """A ball rigidly attached to a frame, which the controller does not know of.

    Attributes:
        frame: a frame with a part to play, or a link of the document.
        mass: its mass [kg].
        offset: centre of the ball in the frame [m].
        radius: its radius, for its inertia and its picture [m].
    """

    frame: Text
    mass: Annotated[float, Bounds(positive=True, most=1e6, unit="kg")]
    offset: Offset = (0.0, 0.0, 0.0)
    radius: Annotated[float, Bounds(positive=True, most=1e6, unit="m")] = 0.06

    @property
    def inertia(self) -> float:
        """Moment of inertia of a solid ball about its centre, 2/5 m r^2 [kg m^2]."""
        return 0.4 * self.mass * self.radius**2


@checked()
@dataclass(frozen=True, kw_only=True)
class LinkError:
    """How one link of the plant differs from the description that the controller uses.

    Attributes:
        link: the link's name in the document.
        mass_scale: factor on its mass; its inertia scales alike, as with another density.
        inertia_scale: a further factor on its inertia.
        com_offset: shift of its centre of mass, in the link's frame [m].
    """

    link: Text
    mass_scale: Factor = 1.0
    inertia_scale: Factor = 1.0
    com_offset: Offset = (0.0, 0.0, 0.0)


@checked()
@dataclass(frozen=True, kw_only=True)
class Block:
    """A box that lies on the floor, for uneven ground.

    Attributes:
        center: centre of its footprint in the world [m].
        size: its length along x, width along y and height [m].
        yaw: its rotation about z [rad].
        told: whether a planner of footsteps is told of it.
    """

    center: Annotated[tuple[float, float], Vector(2, Bounds(most=FARTHEST, unit="m"))]
    size: Annotated[
        tuple[float, float, float], Vector(3, Bounds(positive=True, most=FARTHEST, unit="m"))
    ]
    yaw: Number = 0.0
    told: Truth = True

    @property
    def quaternion(self) -> tuple[float, float, float, float]:
        """Its orientation, (w, x, y, z) as MuJoCo orders it."""
        return (math.cos(self.yaw / 2), 0.0, 0.0, math.sin(self.yaw / 2))
