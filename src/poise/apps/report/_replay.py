"""The motion of a run as the 3D replay needs it: bodies, their shapes, forces and markers."""

from dataclasses import dataclass, field
from typing import Literal, get_args, get_type_hints

import numpy as np
from jaxtyping import Float64, Int

from poise.errors import ConfigurationError

SHAPE_SIZES = {"box": 3, "sphere": 1, "ellipsoid": 3, "cylinder": 2, "capsule": 2, "mesh": 0}
"""How many sizes each shape takes."""


def check_shapes(tracks: object, name: str, sizes: dict[str, int]) -> None:
    """Refuse arrays of a dataclass whose shapes are not those of their annotations.

    Args:
        tracks: the dataclass.
        name: of it, for messages.
        sizes: lengths by the letters of the annotations; new letters are added.
    """
    for key, hint in get_type_hints(type(tracks)).items():
        value = getattr(tracks, key)
        letters = [h.dim_str.split() for h in (hint, *get_args(hint)) if hasattr(h, "dim_str")]
        if not letters or not isinstance(value, np.ndarray):
            continue
        if len(letters[0]) == value.ndim:
            for letter, length in zip(letters[0], value.shape, strict=True):
                sizes.setdefault(letter, int(letter) if letter.isdecimal() else length)
        wanted = tuple(sizes.get(letter, letter) for letter in letters[0])
        if value.shape != wanted:
            raise ConfigurationError(
                f"wrong shape of the {name}'s {key}", got=value.shape, wanted=str(wanted)
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class Geometry:
    """A shape fixed to a body."""

    body: int  # index of the body in `Replay.body_names`
    shape: Literal["box", "sphere", "ellipsoid", "cylinder", "capsule", "mesh"]
    # half lengths along x, y, z for a box; radius for a sphere; radii along x, y, z for an
    # ellipsoid; radius and half length (of the straight part) along z for cylinder and capsule [m]
    size: tuple[float | int, ...] = ()
    position: Float64[np.ndarray, "3"] = field(default_factory=lambda: np.zeros(3))  # [m]
    # orientation of the shape in its body (x, y, z, w)
    quaternion: Float64[np.ndarray, "4"] = field(default_factory=lambda: np.eye(4)[3])
    rgba: tuple[float | int, float | int, float | int, float | int] = (0.7, 0.7, 0.72, 1.0)
    vertices: Float64[np.ndarray, "nvert 3"] | None = field(default=None, repr=False)  # [m]
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
        if self.shape != "mesh":
            return
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
    """A force on the robot, drawn as an arrow that starts (contact) or ends (push) at its point."""

    name: str
    kind: Literal["contact", "push"] = "contact"
    point: Float64[np.ndarray, "F 3"]  # in the world [m]
    force: Float64[np.ndarray, "F 3"]  # in the world [N]; zero or NaN where there is none


@dataclass(frozen=True, kw_only=True, eq=False)
class MarkerTrack:
    """A point to show as a small ball, such as a hand's target."""

    name: str
    position: Float64[np.ndarray, "F 3"]  # in the world [m]; NaN where there is nothing to show


@dataclass(frozen=True, kw_only=True, eq=False)
class Replay:
    """Body poses over time, about 30 frames a second, and what the bodies look like."""

    time: Float64[np.ndarray, " F"]  # [s]
    body_names: tuple[str, ...]  # the world itself may be one of them
    position: Float64[np.ndarray, "F B 3"]  # of each body's origin in the world [m]
    quaternion: Float64[np.ndarray, "F B 4"]  # of each body in the world (x, y, z, w)
    geometries: tuple[Geometry, ...]
    forces: tuple[ForceTrack, ...] = ()
    markers: tuple[MarkerTrack, ...] = ()

    def __post_init__(self) -> None:
        sizes = {"F": len(self.time), "B": len(self.body_names)}
        check_shapes(self, "replay", sizes)
        for track in (*self.forces, *self.markers):
            check_shapes(track, repr(track.name), sizes)
        for geometry in self.geometries:
            if not 0 <= geometry.body < sizes["B"]:
                raise ConfigurationError(
                    f"a {geometry.shape} on a body that does not exist",
                    got=geometry.body,
                    wanted=f"an index from 0 to {sizes['B'] - 1}",
                )
