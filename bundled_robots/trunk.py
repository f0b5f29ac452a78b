"""The trunk of the parametric humanoid: waist and neck, and the looks of pelvis, torso and head."""

from typing import Literal

from bundled_robots.proportions import Proportions
from bundled_robots.solids import Shape, box, capsule, drum, slab, sphere
from bundled_robots.tree import Hinge, Tree

HEAD_HEIGHT = 0.22
"""From the last joint of the neck to the crown of a robot of 1.8 m [m]."""

_TORSO_LAYERS = (
    (0.150, 0.190),
    (0.160, 0.215),
    (0.175, 0.245),
    (0.190, 0.275),
    (0.205, 0.305),
    (0.215, 0.325),
    (0.210, 0.325),
    (0.185, 0.290),
)
"""Depth and width of the torso of a robot of 1.8 m, in layers of one thickness, from below [m]."""

_HINGES = {
    "waist": (
        Hinge("yaw", "z", (-60.0, 60.0), 200.0),
        Hinge("pitch", "y", (-25.0, 50.0), 300.0),
        Hinge("roll", "x", (-25.0, 25.0), 300.0),
    ),
    "neck": (
        Hinge("yaw", "z", (-80.0, 80.0), 20.0),
        Hinge("pitch", "y", (-35.0, 45.0), 20.0),
        Hinge("roll", "x", (-25.0, 25.0), 20.0),
    ),
}
"""Hinges of a column, repeated from below as often as there are joints."""


def add_column(
    tree: Tree,
    *,
    part: Literal["waist", "neck"],
    start: tuple[str, float],
    end: str,
    count: int,
    length: float,
    radius: float,
    mass: float,
    strength: float,
) -> float:
    """Chain `count` hinges up to the link `end`; return the mass that found no link [kg]."""
    parent, height = start
    if count == 0:
        tree.weld(parent, end, at=(0.0, 0.0, height + length))
        return mass
    step = length / max(count - 1, 1)
    for i in range(count):
        hinge = _HINGES[part][i % 3]
        name = f"{part}_{hinge.name}" + (str(i // 3 + 1) if i >= 3 else "")
        child = end if i == count - 1 else f"{name}_link"
        # A single hinge stands at the upper end.
        rise = step if i > 0 else height if count > 1 else height + length
        tree.connect(
            hinge._replace(name=name),
            parent,
            child,
            at=(0.0, 0.0, rise),
            velocity=8.0,
            strength=strength,
        )
        if child != end:
            tree.add(child, mass / (count - 1), _vertebra(hinge.axis, radius, step))
        parent = child
    return 0.0 if count > 1 else mass


def _vertebra(axis: str, radius: float, step: float) -> tuple[Shape, ...]:
    core = capsule((0.0, 0.0, 0.0), (0.0, 0.0, step), 0.8 * radius, colour="dark")
    if axis == "z":
        return (drum("z", radius, 0.8 * step, (0.0, 0.0, 0.2 * step)), *core)
    return (drum("x" if axis == "x" else "y", 0.55 * radius, 2.2 * radius), *core)


def pelvis_shapes(p: Proportions) -> tuple[Shape, ...]:
    """Solids of the pelvis; the origin lies midway between the hips."""
    s, half = p.scale, p.hip_offset
    return (
        *slab((0.20 * s, 2.0 * half + 0.04 * s, 0.10 * s), (-0.01 * s, 0.0, 0.085 * s), 0.05 * s),
        *slab((0.15 * s, 0.20 * s, 0.07 * s), (-0.01 * s, 0.0, 0.0), 0.03 * s, colour="dark"),
        drum("z", 0.085 * s, 0.03 * s, (0.0, 0.0, 0.135 * s)),
        box((0.012 * s, 0.10 * s, 0.03 * s), (0.092 * s, 0.0, 0.09 * s), colour=p.accent),
    )


def torso_shapes(p: Proportions, height: float) -> tuple[Shape, ...]:
    """Solids of a torso of the given height [m]; the origin lies at its lower end."""
    s = p.scale
    shapes: list[Shape] = [sphere(0.078 * s, (0.0, 0.0, 0.0), colour="dark")]
    thick = height / len(_TORSO_LAYERS)
    for i, (depth, width) in enumerate(_TORSO_LAYERS):
        middle = (0.0, 0.0, (i + 0.5) * thick)
        shapes += slab((depth * s, width * s, thick), middle, 0.055 * s)
    chest = 0.64 * height
    shoulder = height - 0.07 * s
    shapes += [
        box((0.012 * s, 0.22 * s, 0.10 * s), (0.108 * s, 0.0, chest), colour=p.accent),
        box((0.014 * s, 0.07 * s, 0.018 * s), (0.112 * s, 0.0, chest), colour="light"),
        box((0.06 * s, 0.24 * s, 0.26 * s), (-0.115 * s, 0.0, 0.62 * height), colour="dark"),
        drum("y", 0.055 * s, 0.34 * s, (0.0, 0.0, shoulder), colour="joint"),
        drum("z", 0.055 * s, 0.03 * s, (0.0, 0.0, height), colour="dark"),
    ]
    return tuple(shapes)


def head_shapes(p: Proportions) -> tuple[Shape, ...]:
    """Solids of the head; the origin lies in the last joint of the neck."""
    s = p.scale
    crown = 0.075 * s
    return (
        drum("y", 0.032 * s, 0.10 * s, colour="joint"),
        *slab((0.17 * s, 0.15 * s, 0.10 * s), (0.005 * s, 0.0, 0.09 * s), 0.055 * s),
        sphere(crown, (0.0, 0.0, HEAD_HEIGHT * s - crown)),
        *slab(
            (0.03 * s, 0.13 * s, 0.075 * s), (0.083 * s, 0.0, 0.105 * s), 0.012 * s, colour="visor"
        ),
        box((0.006 * s, 0.07 * s, 0.008 * s), (0.099 * s, 0.0, 0.11 * s), colour="light"),
        drum("y", 0.03 * s, 0.17 * s, (0.0, 0.0, 0.10 * s), colour=p.accent),
    )
