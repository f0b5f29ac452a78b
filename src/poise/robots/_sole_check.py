"""`soles_off_their_feet`: soles of a description that are not where the foot's shape ends below."""

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.errors import RobotError
from poise.robots._geometry import link_shapes, union
from poise.robots._robot import Robot

_OFF = 0.005
"""A sole may be this far above or below the lowest of its foot [m]."""

_BESIDE = 0.01
"""And reach this far over the foot's edge [m]."""


def soles_off_their_feet(robot: Robot) -> list[str]:
    """Compare each sole with the shapes of the links that its joint moves.

    The foot ends below at the lowest point of its collision shapes or, where it has none, of what
    is seen of it, along the sole's own z. Shapes that cannot be read say nothing.

    Args:
        robot: as described.

    Returns:
        What is off by more than 5 mm, as sentences with the sole's name.
    """
    said: list[str] = []
    for name, sole in robot.soles.items():
        try:
            offset, beside = _offsets(robot, name, 0.5 * np.array([sole.length, sole.width]))
        except RobotError:
            continue
        if abs(offset) > _OFF:
            where = "above" if offset > 0.0 else "below"
            said.append(
                f"sole {name!r} lies {1e3 * abs(offset):.0f} mm {where} the lowest point of its "
                f"foot (`poise describe` shows both)"
            )
        elif beside > _BESIDE:
            said.append(
                f"sole {name!r} reaches {1e3 * beside:.0f} mm over the edge of its foot "
                f"(`poise describe` shows both)"
            )
    return said


def _offsets(robot: Robot, name: str, half: Float64[np.ndarray, "2"]) -> tuple[float, float]:
    """How far a sole is above its foot's lowest point, and how far over its edge [m]."""
    model = robot.model
    frame = model.frames[robot.frame_id(name)]
    kind = pin.FrameType.BODY
    links = [f for f in model.frames if f.type == kind and f.parentJoint == frame.parentJoint]
    # A link that has the name of a role goes by another one in the model.
    names = [f.name.removesuffix("_link") for f in links]
    names = [n if n in robot.roles else f.name for n, f in zip(names, links, strict=True)]
    shapes = link_shapes(robot.source, names, robot.name)
    for attribute in ("collision", "visual"):
        foot = union(
            [
                balls.moved(frame.placement.actInv(link.placement))
                for link, key in zip(links, names, strict=True)
                for balls in getattr(shapes[key], attribute)
            ]
        )
        if foot is not None:
            low = (foot.centres - foot.radii[:, None]).min(axis=0)
            high = (foot.centres + foot.radii[:, None]).max(axis=0)
            over = max(float((half - high[:2]).max()), float((half + low[:2]).max()))
            return -float(low[2]), over
    raise RobotError(f"the foot of {name!r} has no shape", got=names, wanted="a shape")
