"""Points and arrows drawn into a picture: centre of mass, targets, contact forces."""

from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float64

from poise.sim.checks import require_positive, require_vector

Vector = tuple[float, float, float]
Colour = tuple[float, float, float, float]

COM_COLOUR: Colour = (0.95, 0.55, 0.05, 1.0)
ZMP_COLOUR: Colour = (0.80, 0.10, 0.55, 1.0)
TARGET_COLOUR: Colour = (0.10, 0.60, 0.25, 0.85)
FORCE_COLOUR: Colour = (0.05, 0.45, 0.85, 1.0)

_ARROW_WIDTH = 0.016
"""Radius of an arrow's shaft [m]."""


@dataclass(frozen=True, kw_only=True)
class Marker:
    """A ball at a point, or an arrow from it.

    Attributes:
        position: where it is in the world [m].
        arrow: from the point to the arrow's tip in the world [m]; None for a ball.
        radius: of the ball [m].
        colour: red, green, blue, opacity in [0, 1].
    """

    position: Vector
    arrow: Vector | None = None
    radius: float = 0.025
    colour: Colour = TARGET_COLOUR

    def __post_init__(self) -> None:
        require_vector("the position of a marker", self.position, 3)
        if self.arrow is not None:
            require_vector("the arrow of a marker", self.arrow, 3)
        require_positive("the radius of a marker", self.radius)
        require_vector("the colour of a marker", self.colour, 4)


def add_marker(scene: mujoco.MjvScene, marker: Marker) -> None:
    """Add a marker to a scene; one that has no room left in the scene is not drawn."""
    if scene.ngeom >= scene.maxgeom:
        return
    geom = scene.geoms[scene.ngeom]
    colour = np.array(marker.colour, dtype=np.float32)
    position = np.array(marker.position, dtype=np.float64)
    size = np.full(3, marker.radius)
    mujoco.mjv_initGeom(geom, int(mujoco.mjtGeom.mjGEOM_SPHERE), size, position, _IDENTITY, colour)
    if marker.arrow is not None:
        # MuJoCo draws half of what it is given (seen with 4.0, and held by a test).
        tip = position + 2.0 * np.array(marker.arrow)
        mujoco.mjv_connector(geom, int(mujoco.mjtGeom.mjGEOM_ARROW), _ARROW_WIDTH, position, tip)
    scene.ngeom += 1


def force_marker(
    position: Float64[np.ndarray, "3"], force: Float64[np.ndarray, "3"], scale: float
) -> Marker:
    """An arrow for a force in the world [N], `scale` metres a newton."""
    x, y, z = (float(f) * scale for f in force)
    px, py, pz = (float(p) for p in position)
    return Marker(position=(px, py, pz), arrow=(x, y, z), colour=FORCE_COLOUR)


_IDENTITY = np.eye(3).ravel()
