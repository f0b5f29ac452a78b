"""The motion of a run as the 3D replay needs it: bodies, their shapes, forces and markers."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from jaxtyping import Float64, Int

from poise.errors import ConfigurationError

SHAPE_SIZES = {"box": 3, "sphere": 1, "ellipsoid": 3, "cylinder": 2, "capsule": 2, "mesh": 0}
"""How many sizes each shape takes."""


def _identity_quaternion() -> Float64[np.ndarray, "4"]:
    return np.array([0.0, 0.0, 0.0, 1.0])


def _no_positions() -> Float64[np.ndarray, "3"]:
    return np.zeros(3)


@dataclass(frozen=True, kw_only=True, eq=False)
class Geometry:
    """A shape fixed to a body.

    Attributes:
        body: index of the body in `Replay.body_names`.
        shape: which shape.
        size: half lengths along x, y, z for a box; radius for a sphere; radii along x, y, z for an
            ellipsoid; radius and half length along z for a cylinder; radius and half length of the
            straight part along z for a capsule; nothing for a mesh [m].
        position: origin of the shape in its body [m].
        quaternion: orientation of the shape in its body (x, y, z, w).
        rgba: colour and opacity, 0 to 1.
        vertices: corners of a mesh in the shape's frame [m], None for the other shapes.
        faces: triangles of a mesh as rows of `vertices`, None for the other shapes.
    """

    body: int
    shape: Literal["box", "sphere", "ellipsoid", "cylinder", "capsule", "mesh"]
    size: tuple[float | int, ...] = ()
    position: Float64[np.ndarray, "3"] = field(default_factory=_no_positions)
    quaternion: Float64[np.ndarray, "4"] = field(default_factory=_identity_quaternion)
    rgba: tuple[float | int, float | int, float | int, float | int] = (0.7, 0.7, 0.72, 1.0)
    vertices: Float64[np.ndarray, "nvert 3"] | None = field(default=None, repr=False)
    faces: Int[np.ndarray, "nface 3"] | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        if self.shape not in SHAPE_SIZES:
            raise ConfigurationError("unknown shape", got=self.shape, choices=SHAPE_SIZES)
        if len(self.size) != SHAPE_SIZES[self.shape] or any(s <= 0.0 for s in self.size):
            raise ConfigurationError(
                f"wrong size of a {self.shape}",
                got=self.size,
                wanted=f"{SHAPE_SIZES[self.shape]} lengths above zero [m]",
            )
        if self.shape == "mesh":
            self._check_mesh()

    def _check_mesh(self) -> None:
        if self.vertices is None or self.faces is None:
            raise ConfigurationError("a mesh without vertices or faces", wanted="both arrays")
        if self.faces.size and not 0 <= self.faces.min() <= self.faces.max() < len(self.vertices):
            raise ConfigurationError(
                "a face of a mesh names a vertex that does not exist",
                got=(int(self.faces.min()), int(self.faces.max())),
                wanted=f"indices from 0 to {len(self.vertices) - 1}",
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class ForceTrack:
    """A force on the robot, drawn as an arrow that starts (contact) or ends (push) at its point.

    Attributes:
        name: what pushes, such as "left_sole".
        kind: "contact" for the ground's forces, "push" for disturbances.
        point: where the force acts, in the world [m].
        force: the force in the world [N]; zero or NaN where there is none.
    """

    name: str
    kind: Literal["contact", "push"] = "contact"
    point: Float64[np.ndarray, "F 3"]
    force: Float64[np.ndarray, "F 3"]


@dataclass(frozen=True, kw_only=True, eq=False)
class MarkerTrack:
    """A point to show as a small ball, such as a hand's target.

    Attributes:
        name: what it marks.
        position: where, in the world [m]; NaN where there is nothing to show.
    """

    name: str
    position: Float64[np.ndarray, "F 3"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Replay:
    """Body poses over time, about 30 frames a second, and what the bodies look like.

    Attributes:
        time: time of each frame [s].
        body_names: the bodies; the world itself may be one of them.
        position: origin of each body in the world [m].
        quaternion: orientation of each body in the world (x, y, z, w).
        geometries: the shapes on the bodies.
        forces: forces to draw as arrows.
        markers: points to draw as balls.
    """

    time: Float64[np.ndarray, " F"]
    body_names: tuple[str, ...]
    position: Float64[np.ndarray, "F B 3"]
    quaternion: Float64[np.ndarray, "F B 4"]
    geometries: tuple[Geometry, ...]
    forces: tuple[ForceTrack, ...] = ()
    markers: tuple[MarkerTrack, ...] = ()

    def __post_init__(self) -> None:
        frames, bodies = len(self.time), len(self.body_names)
        shapes: dict[str, tuple[tuple[int, ...], tuple[int, ...]]] = {
            "position": (self.position.shape, (frames, bodies, 3)),
            "quaternion": (self.quaternion.shape, (frames, bodies, 4)),
        }
        for force in self.forces:
            shapes[f"point of force {force.name!r}"] = (force.point.shape, (frames, 3))
            shapes[f"force {force.name!r}"] = (force.force.shape, (frames, 3))
        for marker in self.markers:
            shapes[f"marker {marker.name!r}"] = (marker.position.shape, (frames, 3))
        for name, (got, shape) in shapes.items():
            if got != shape:
                raise ConfigurationError(
                    f"wrong shape of the replay's {name}", got=got, wanted=str(shape)
                )
        for geometry in self.geometries:
            if not 0 <= geometry.body < bodies:
                raise ConfigurationError(
                    f"a {geometry.shape} on a body that does not exist",
                    got=geometry.body,
                    wanted=f"an index from 0 to {bodies - 1}",
                )
