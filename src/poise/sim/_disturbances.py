"""What a scenario does to the plant: pushes, payloads, and links that are not as described."""

import math
from dataclasses import dataclass

from poise.sim._checks import require_not_negative, require_positive, require_vector


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
    force: tuple[float, float, float]
    start: float
    duration: float

    def __post_init__(self) -> None:
        require_vector("the force of a push", self.force, 3)
        require_not_negative("the start of a push", self.start)
        require_positive("the duration of a push", self.duration)

    def share(self, begin: float, end: float) -> float:
        """How much of the interval [begin, end] the push is active, in [0, 1].

        A push that starts or ends inside a physics step acts with this share of its force, so that
        its impulse is force x duration whatever the step.
        """
        overlap = min(end, self.start + self.duration) - max(begin, self.start)
        return max(0.0, overlap) / (end - begin)


@dataclass(frozen=True, kw_only=True)
class Payload:
    """A ball rigidly attached to a frame, which the controller does not know of.

    Attributes:
        frame: a frame with a part to play, or a link of the document.
        mass: its mass [kg].
        offset: centre of the ball in the frame [m].
        radius: its radius, for its inertia and its picture [m].
    """

    frame: str
    mass: float
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    radius: float = 0.06

    def __post_init__(self) -> None:
        require_positive("the mass of a payload", self.mass)
        require_positive("the radius of a payload", self.radius)
        require_vector("the offset of a payload", self.offset, 3)

    @property
    def inertia(self) -> float:
        """Moment of inertia of a solid ball about its centre, 2/5 m r^2 [kg m^2]."""
        return 0.4 * self.mass * self.radius**2


@dataclass(frozen=True, kw_only=True)
class LinkError:
    """How one link of the plant differs from the description that the controller uses.

    Attributes:
        link: the link's name in the document.
        mass_scale: factor on its mass; its inertia scales alike, as with another density.
        inertia_scale: a further factor on its inertia.
        com_offset: shift of its centre of mass, in the link's frame [m].
    """

    link: str
    mass_scale: float = 1.0
    inertia_scale: float = 1.0
    com_offset: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        require_positive("mass_scale", self.mass_scale)
        require_positive("inertia_scale", self.inertia_scale)
        require_vector("com_offset", self.com_offset, 3)


@dataclass(frozen=True, kw_only=True)
class Block:
    """A box that lies on the floor, for uneven ground.

    Attributes:
        center: centre of its footprint in the world [m].
        size: its length along x, width along y and height [m].
        yaw: its rotation about z [rad].
    """

    center: tuple[float, float]
    size: tuple[float, float, float]
    yaw: float = 0.0

    def __post_init__(self) -> None:
        require_vector("the center of a block", self.center, 2)
        require_vector("the size of a block", self.size, 3)
        for extent in self.size:
            require_positive("the size of a block", extent)
        require_vector("the yaw of a block", (self.yaw,), 1)

    @property
    def quaternion(self) -> tuple[float, float, float, float]:
        """Its orientation, (w, x, y, z) as MuJoCo orders it."""
        return (math.cos(self.yaw / 2), 0.0, 0.0, math.sin(self.yaw / 2))
