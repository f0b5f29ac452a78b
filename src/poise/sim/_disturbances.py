"""What a scenario does to the plant: pushes, payloads, and links that are not as described."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
import pinocchio as pin

from poise._schema import Bounds, Duration, Number, Seconds, Text, Truth, Vector, checked
from poise.errors import ConfigurationError

FARTHEST = 1e2
"""No place or angle in a plant is farther than this [m, rad]: MuJoCo loses its accuracy there."""

Offset = Annotated[tuple[float, float, float], Vector(3, Bounds(most=FARTHEST, unit="m"))]
STEEPEST = 0.7
"""Steeper than this [rad] nothing stands with the friction of a floor."""

Factor = Annotated[float, Bounds(positive=True, most=1e6)]

_NO_OVERLAP = 1e-6
"""Part of a physics step that is a rounding of its ends, not a time in which a push acts."""


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
        that its impulse is force x duration whatever the step. It does not act in a step that
        touches it by rounding alone: a push that was scheduled moves the robot as one that is given
        when its time has come, to the last bit.
        """
        overlap = min(end, self.start + self.duration) - max(begin, self.start)
        fraction = overlap / (end - begin)
        return fraction if fraction > _NO_OVERLAP else 0.0


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
    """A box on the floor, for uneven ground; a tilted one is a ramp.

    Attributes:
        center: centre of its top, seen from above, in the world [m].
        size: its length along x, width along y and height [m].
        yaw: its rotation about z [rad].
        tilt: its rotation about its own x and y axes, before yaw, about the centre of its top
            [rad].
        top: height of the centre of its top over the floor [m]; its own height when None.
        told: whether a planner of footsteps is told of it; never of one that is tilted or sunk in,
            since platforms are boxes that lie on the floor.
    """

    center: Annotated[tuple[float, float], Vector(2, Bounds(most=FARTHEST, unit="m"))]
    size: Annotated[
        tuple[float, float, float], Vector(3, Bounds(positive=True, most=FARTHEST, unit="m"))
    ]
    yaw: Number = 0.0
    tilt: Annotated[tuple[float, float], Vector(2, Bounds(most=STEEPEST, unit="rad"))] = (0.0, 0.0)
    top: Annotated[float, Bounds(most=FARTHEST, unit="m")] | None = None
    told: Truth = True

    def __post_init__(self) -> None:
        if self.told and (any(self.tilt) or self.top is not None):
            raise ConfigurationError(
                "no footsteps are planned on a block that is tilted or sunk in",
                got="told: true",
                wanted="told: false",
            )

    @property
    def pose(self) -> pin.SE3:
        """Of its centre, in the world."""
        about_x, about_y = self.tilt
        tilted = pin.exp3(np.array([about_x, about_y, 0.0]))
        rotation = pin.utils.rotate("z", self.yaw) @ tilted
        height = self.size[2] if self.top is None else self.top
        return pin.SE3(
            rotation, np.array([*self.center, height]) - 0.5 * self.size[2] * rotation[:, 2]
        )
