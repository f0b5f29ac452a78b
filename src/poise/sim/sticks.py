"""A stick figure for a robot whose document has no pictures."""

import mujoco
import numpy as np

_THICKNESS = 0.12
"""Radius of a stick, as a part of its length."""

_SHORTEST = 0.01
"""Shorter links [m] are not drawn."""


def add_sticks(spec: mujoco.MjSpec) -> None:
    """Draw each link as sticks from its own joint to those of its children; nothing can touch them.

    Args:
        spec: the specification, changed in place.
    """
    for body in spec.bodies[1:]:
        for child in body.bodies:
            length = float(np.linalg.norm(child.pos))
            if length < _SHORTEST:
                continue
            body.add_geom(
                type=mujoco.mjtGeom.mjGEOM_CAPSULE,
                fromto=(0.0, 0.0, 0.0, *child.pos),
                size=(_THICKNESS * length, 0.0, 0.0),
                contype=0,
                conaffinity=0,
                mass=0.0,
                group=1,
                rgba=(0.75, 0.77, 0.8, 1.0),
            )
