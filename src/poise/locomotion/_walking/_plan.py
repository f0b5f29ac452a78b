"""`plan_footsteps`: strides turned into the steps of one robot on its ground."""

import math
from collections.abc import Sequence

import numpy as np

from poise._checks import Numbers, checked_kind
from poise.errors import ConfigurationError
from poise.locomotion._walking._footsteps import (
    FootstepPlan,
    Gait,
    Stride,
    level_floor,
    stand_of,
)
from poise.locomotion._walking._ground import LEVEL, Ground, Placement
from poise.robots import Robot

_EDGE = 0.015
"""How far a sole stays away from the edge of a platform [m]."""

_SEARCH, _FARTHEST = 0.005, 0.25
"""Resolution of the search for a place with nothing but one height under it, and its end [m]."""


def plan_footsteps(
    robot: Robot,
    strides: Sequence[Stride],
    gait: Gait | None = None,
    *,
    q: Numbers | None = None,
    ground: Ground | None = None,
) -> FootstepPlan:
    """The steps of a walk from where the robot stands.

    A foothold that would lie across the edge of a platform moves ahead or back to the nearest
    place that carries the whole sole. After the last stride the feet close.

    Args:
        robot: on two soles.
        strides: one after the other.
        gait: timing and shape of the steps.
        q: how the robot stands, in its home posture when None.
        ground: what it walks on; a floor as high as its soles when None.

    Returns:
        The plan, with one step more than the strides have where the feet have to close.

    Raises:
        ConfigurationError: a robot that does not stand on two soles, no stride, feet that cross,
            or no place for a foot.
    """
    gait = gait or Gait()
    for stride in strides:
        checked_kind(stride, Stride, "a stride of the walk")
    if not strides:
        raise ConfigurationError("a walk without strides", got=0, wanted="one or more")
    stand = stand_of(robot, q)
    soles, sizes, start = stand.soles, stand.sizes, stand.start
    ground = ground or level_floor(start)
    width = gait.width if gait.width is not None else stand.width
    footholds: list[tuple[str, Numbers]] = []
    for i, (foot, body) in enumerate(_body_path(start, strides), 1):
        footholds.append((soles[foot], _foothold(foot, body, width, sizes[foot], ground, i)))
    return FootstepPlan.from_footholds(robot, footholds, gait, q=stand.q, ground=ground)


def _body_path(
    start: tuple[Placement, Placement], strides: Sequence[Stride]
) -> list[tuple[int, tuple[float, float, float]]]:
    """For each step its foot, and where the body's middle goes with it: x, y, heading."""
    left, right = start
    x, y = (0.5 * (left.position[k] + right.position[k]) for k in (0, 1))
    yaw = 0.5 * (left.yaw + right.yaw)
    first = next((s.sideways or s.turn for s in strides if s.sideways or s.turn), 0.0)
    foot = 1 if first < 0.0 else 0
    bodies: list[tuple[int, tuple[float, float, float]]] = []
    for stride in strides:
        for _ in range(stride.steps):
            side = stride.sideways if (stride.sideways > 0.0) == (foot == 0) else 0.0
            turn = stride.turn if (stride.turn > 0.0) == (foot == 0) else 0.0
            middle = yaw + turn
            x += stride.length * math.cos(middle) - 2.0 * side * math.sin(middle)
            y += stride.length * math.sin(middle) + 2.0 * side * math.cos(middle)
            yaw += 2.0 * turn
            bodies.append((foot, (x, y, yaw)))
            foot = 1 - foot
    bodies.append((foot, (x, y, yaw)))
    return bodies


def _foothold(
    foot: int,
    body: tuple[float, float, float],
    width: float,
    size: tuple[float, float],
    ground: Ground,
    number: int,
) -> tuple[float, float, float]:
    """The place of a foot beside the body, or the nearest ahead or behind that carries it all."""
    x, y, yaw = body
    side = 0.5 * width if foot == 0 else -0.5 * width
    x, y = x - side * math.sin(yaw), y + side * math.cos(yaw)
    found = level_place((x, y, yaw), size, ground)
    if found is None:
        raise ConfigurationError(
            f"step {number} of the walk finds no place that carries the whole sole",
            got=f"x = {x:.3f} m, y = {y:.3f} m",
            wanted=f"one height under the sole within {_FARTHEST:g} m ahead or behind",
        )
    return (*found.position[:2], yaw)


def level_place(
    place: tuple[float, float, float], size: tuple[float, float], ground: Ground
) -> Placement | None:
    """A sole on the ground where it should lie, or at the nearest place ahead or behind."""
    x, y, yaw = place
    grown = (size[0] + 2.0 * _EDGE, size[1] + 2.0 * _EDGE)
    for i in range(2 * int(_FARTHEST / _SEARCH) + 1):
        # 0, 1, -1, 2, -2, ... times the resolution
        shift = _SEARCH * ((i + 1) // 2) * (1 if i % 2 else -1)
        tried = (x + shift * math.cos(yaw), y + shift * math.sin(yaw))
        heights = ground.heights(Placement(position=(*tried, 0.0), yaw=yaw).grid(*grown))
        if float(np.ptp(heights)) < LEVEL:
            return Placement(position=(*tried, float(heights[0])), yaw=yaw)
    return None
