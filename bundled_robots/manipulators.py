"""The two robots of (Park, Jin, Kang 2022): an arm of 6 joints and an upper body of 17."""

from typing import Literal

from bundled_robots.limbs import add_arm
from bundled_robots.proportions import Proportions
from bundled_robots.solids import Shape, box, capsule, drum, slab
from bundled_robots.tree import Hinge, Tree
from bundled_robots.trunk import head_shapes, torso_shapes

_UPPER_BODY = Proportions(
    height=1.7, mass=60.0, sole_length=0.28, sole_width=0.14, hip_offset=0.1, accent="blue"
)
_ARM_SPAN = (-170.0, 170.0)


def arm6() -> Tree:
    """A table-top arm like an Indy RP: six joints, a reach of 0.9 m from its shoulder.

    Torque limits are the motors' rated torques of 1.3, 0.64 and 0.32 N m behind gears of 100:1.
    """
    tree = Tree("arm6")
    tree.add("base_link", 5.0, _arm_base())
    steps: tuple[tuple[float, Literal["x", "y", "z"], float, float, tuple[Shape, ...]], ...] = (
        (0.12, "z", 130.0, 6.0, _bend(0.18, 0.075)),
        (0.18, "y", 130.0, 7.5, _limb(0.42, 0.068)),
        (0.42, "y", 64.0, 3.8, _bend(0.12, 0.058)),
        (0.12, "z", 64.0, 3.0, _limb(0.24, 0.05, "z")),
        (0.24, "y", 32.0, 1.8, _bend(0.07, 0.045)),
        (0.07, "z", 32.0, 0.9, _flange()),
    )
    parent = "base_link"
    for i, (height, axis, torque, mass, shapes) in enumerate(steps, start=1):
        hinge = Hinge(f"joint{i}", axis, _ARM_SPAN, torque)
        velocity = 2.6 if i <= 3 else 3.1
        tree.connect(hinge, parent, f"link{i}", at=(0.0, 0.0, height), velocity=velocity)
        tree.add(f"link{i}", mass, shapes)
        parent = f"link{i}"
    return tree


def upper17() -> Tree:
    """The upper body of a humanoid on a column: a torso of five joints, two arms of six."""
    p = _UPPER_BODY
    s = p.scale
    tree = Tree("upper17")
    tree.add("base_link", 20.0, _column(s))
    steps = (
        (0.86, Hinge("torso_yaw", "z", (-80.0, 80.0), 200.0)),
        (0.04, Hinge("torso_pitch", "y", (-25.0, 60.0), 300.0)),
        (0.05, Hinge("torso_roll", "x", (-30.0, 30.0), 300.0)),
        (0.06, Hinge("chest_pitch", "y", (-20.0, 45.0), 250.0)),
        (0.05, Hinge("chest_yaw", "z", (-50.0, 50.0), 150.0)),
    )
    parent = "base_link"
    for height, hinge in steps:
        child = "torso_link" if hinge.name == "chest_yaw" else f"{hinge.name}_link"
        tree.connect(hinge, parent, child, at=(0.0, 0.0, height * s), velocity=6.0)
        if child != "torso_link":
            tree.add(child, 2.5, _vertebra(hinge.axis, s))
        parent = child
    height = 0.34 * s
    tree.add("torso_link", 16.0, torso_shapes(p, height))
    tree.weld("torso_link", "head_link", at=(0.0, 0.0, height + 0.06 * s))
    tree.add("head_link", 4.0, head_shapes(p))
    for side in ("left", "right"):
        add_arm(
            tree,
            side,
            joints=6,
            parent="torso_link",
            shoulder=(0.0, 0.225 * s, height - 0.07 * s),
            length=0.55 * s,
            mass=7.0,
            strength=1.0,
            accent=p.accent,
        )
    return tree


def _arm_base() -> tuple[Shape, ...]:
    return (
        drum("z", 0.11, 0.02, (0.0, 0.0, 0.01), colour="dark"),
        drum("z", 0.085, 0.09, (0.0, 0.0, 0.065), colour="shell"),
        drum("z", 0.087, 0.012, (0.0, 0.0, 0.114), colour="blue"),
    )


def _bend(length: float, radius: float) -> tuple[Shape, ...]:
    """A short housing along z that ends in a drum across it, where the next joint turns."""
    return (
        drum("z", radius, length, (0.0, 0.0, 0.5 * length), colour="shell"),
        drum("y", 1.05 * radius, 2.1 * radius, (0.0, 0.0, length), colour="joint"),
        drum("y", 0.8 * radius, 2.5 * radius, (0.0, 0.0, length), colour="shell"),
    )


def _limb(length: float, radius: float, axis: Literal["y", "z"] = "y") -> tuple[Shape, ...]:
    """A long housing along z between two joints."""
    ring = drum("z", 1.04 * radius, 0.014, (0.0, 0.0, 0.5 * length), colour="blue")
    body = capsule((0.0, 0.0, 0.12 * length), (0.0, 0.0, length), 0.85 * radius)
    if axis == "z":
        return (ring, *body, drum("y", radius, 2.2 * radius, (0.0, 0.0, length)))
    return (
        ring,
        *body,
        drum("y", 1.1 * radius, 1.5 * radius, colour="shell"),
        drum("y", 0.95 * radius, 2.1 * radius, (0.0, 0.0, length)),
    )


def _flange() -> tuple[Shape, ...]:
    return (
        drum("z", 0.038, 0.045, (0.0, 0.0, 0.0225), colour="shell"),
        drum("z", 0.032, 0.012, (0.0, 0.0, 0.051), colour="joint"),
        box((0.012, 0.06, 0.03), (0.0, 0.0, 0.07), colour="blue"),
    )


def _column(s: float) -> tuple[Shape, ...]:
    return (
        *slab((0.46 * s, 0.42 * s, 0.05 * s), (0.0, 0.0, 0.025 * s), 0.08 * s, colour="dark"),
        drum("z", 0.08 * s, 0.72 * s, (0.0, 0.0, 0.41 * s), colour="joint"),
        *slab((0.20 * s, 0.26 * s, 0.09 * s), (0.0, 0.0, 0.79 * s), 0.06 * s),
    )


def _vertebra(axis: Literal["x", "y", "z"], s: float) -> tuple[Shape, ...]:
    core = drum("z", 0.055 * s, 0.05 * s, (0.0, 0.0, 0.025 * s), colour="dark")
    if axis == "z":
        return (drum("z", 0.08 * s, 0.04 * s), core)
    return (drum(axis, 0.042 * s, 0.17 * s), core)
