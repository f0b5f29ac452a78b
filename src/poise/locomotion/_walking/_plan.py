"""`plan_footsteps`: strides turned into the steps of one robot on its ground."""

import math
from collections.abc import Sequence

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._checks import checked_kind
from poise.errors import ConfigurationError
from poise.locomotion._support import two_soles
from poise.locomotion._walking._footsteps import (
    RISE,
    Footstep,
    FootstepPlan,
    Gait,
    Ground,
    Placement,
    Stride,
    SwingShape,
)
from poise.robots import Robot

_EDGE = 0.015
"""How far a sole stays away from the edge of a platform [m]."""

_SEARCH, _FARTHEST = 0.005, 0.25
"""Resolution of the search for a place with nothing but one height under it, and its end [m]."""

_LEVEL = 1e-3
"""Heights nearer to each other than this are one [m]."""

_SWINGS = ((0.0, 0.93), (0.1, 0.9), (0.15, 0.85), (0.2, 0.8), (0.25, 0.75), (0.3, 0.7))
"""Departure and arrival of a swing, from the smoothest to the one that clears most."""

_SAMPLES, _CLEAR, _BESIDE = 41, 0.01, 0.01
"""Moments at which a swing is looked at, and its distance from platforms below and beside [m]."""

_FLAT = 0.05
"""Soles tilted more than this do not stand on the ground [rad]."""


def plan_footsteps(
    robot: Robot,
    strides: Sequence[Stride],
    gait: Gait | None = None,
    *,
    q: Float64[np.ndarray, " nq"] | None = None,
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
    soles = two_soles(robot)
    for stride in strides:
        checked_kind(stride, Stride, "a stride of the walk")
    if not strides:
        raise ConfigurationError("a walk without strides", got=0, wanted="one or more")
    q = robot.q_home if q is None else q
    start, com = _standing(robot, soles, q)
    ground = ground or Ground(height=0.5 * sum(p.position[2] for p in start))
    sizes = tuple((robot.soles[s].length, robot.soles[s].width) for s in soles)
    bodies = _body_path(start, strides)
    width = gait.width if gait.width is not None else _distance(start)
    steps: list[Footstep] = []
    feet = list(start)
    for i, (foot, body) in enumerate(bodies, 1):
        goal = _foothold(foot, body, width, sizes[foot], ground, i)
        steps.append(_footstep(foot, feet[foot], goal, sizes[foot], gait, ground, i))
        feet[foot] = goal
    return FootstepPlan(
        soles=soles,
        sizes=(sizes[0], sizes[1]),
        start=start,
        q=q.copy(),
        com=com,
        steps=tuple(steps),
        gait=gait,
        ground=ground,
    )


def _standing(
    robot: Robot, soles: tuple[str, str], q: Float64[np.ndarray, " nq"]
) -> tuple[tuple[Placement, Placement], tuple[float, float, float]]:
    """Where the soles and the centre of mass are in a posture."""
    model, data = robot.model, robot.model.createData()
    pin.framesForwardKinematics(model, data, q)
    found: list[Placement] = []
    for name in soles:
        pose = data.oMf[robot.frame_id(name)]
        if math.acos(min(1.0, float(pose.rotation[2, 2]))) > _FLAT:
            raise ConfigurationError(
                f"{name} does not lie flat at the beginning of the walk",
                got=pose.rotation.round(3).tolist(),
                wanted="a robot that stands on its soles",
            )
        x, y, z = pose.translation.tolist()
        yaw = math.atan2(pose.rotation[1, 0], pose.rotation[0, 0])
        found.append(Placement(position=(x, y, z), yaw=yaw))
    x, y, z = pin.centerOfMass(model, data, q).tolist()
    # Headings are counted on from the left foot's, so that no difference is a whole turn.
    turn = math.remainder(found[1].yaw - found[0].yaw, 2.0 * math.pi)
    right = Placement(position=found[1].position, yaw=found[0].yaw + turn)
    return (found[0], right), (x, y, z)


def _distance(start: tuple[Placement, Placement]) -> float:
    left, right = (np.array(p.position[:2]) for p in start)
    return float(np.linalg.norm(left - right))


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
) -> Placement:
    """The place of a foot beside the body, or the nearest ahead or behind that carries it all."""
    x, y, yaw = body
    side = 0.5 * width if foot == 0 else -0.5 * width
    x, y = x - side * math.sin(yaw), y + side * math.cos(yaw)
    grown = (size[0] + 2.0 * _EDGE, size[1] + 2.0 * _EDGE)
    for i in range(2 * int(_FARTHEST / _SEARCH) + 1):
        # 0, 1, -1, 2, -2, ... times the resolution
        shift = _SEARCH * ((i + 1) // 2) * (1 if i % 2 else -1)
        place = Placement(
            position=(x + shift * math.cos(yaw), y + shift * math.sin(yaw), 0.0), yaw=yaw
        )
        heights = ground.heights(place.grid(*grown))
        if float(np.ptp(heights)) < _LEVEL:
            px, py, _ = place.position
            return Placement(position=(px, py, float(heights[0])), yaw=yaw)
    raise ConfigurationError(
        f"step {number} of the walk finds no place that carries the whole sole",
        got=f"x = {x:.3f} m, y = {y:.3f} m",
        wanted=f"one height under the sole within {_FARTHEST:g} m ahead or behind",
    )


def _footstep(
    foot: int,
    begin: Placement,
    goal: Placement,
    size: tuple[float, float],
    gait: Gait,
    ground: Ground,
    number: int,
) -> Footstep:
    """The step with a swing above everything that lies under it."""
    high = max(begin.position[2], goal.position[2]) + gait.swing_height
    if not ground.platforms:
        return Footstep(foot=foot, goal=goal, shape=SwingShape(apex=high))
    phases = np.linspace(0.0, 1.0, _SAMPLES).tolist()
    for depart, arrive in _SWINGS:
        shape = SwingShape(apex=high, depart=depart, arrive=arrive)
        under = [_highest(begin, goal, shape.progress(p), size, ground) for p in phases]
        # What lies between may be higher than both ends.
        apex = max(high, max(under) + gait.swing_height)
        shape = SwingShape(apex=apex, depart=depart, arrive=arrive)
        if _is_clear(shape, begin.position[2], goal.position[2], phases, under):
            return Footstep(foot=foot, goal=goal, shape=shape)
    raise ConfigurationError(
        f"step {number} of the walk would knock against a platform",
        got=f"swing_height {gait.swing_height:g} m",
        wanted="a higher swing, or other steps",
    )


def _highest(
    begin: Placement, goal: Placement, ratio: float, size: tuple[float, float], ground: Ground
) -> float:
    """The highest ground under a sole between two places, with a margin around it [m]."""
    x, y = (a + ratio * (b - a) for a, b in zip(begin.position[:2], goal.position[:2], strict=True))
    place = Placement(position=(x, y, 0.0), yaw=begin.yaw + ratio * (goal.yaw - begin.yaw))
    grown = (size[0] + 2.0 * _BESIDE, size[1] + 2.0 * _BESIDE)
    return float(ground.heights(place.grid(*grown)).max())


def _is_clear(
    shape: SwingShape, begin: float, end: float, phases: list[float], under: list[float]
) -> bool:
    """Whether a sole is well above all that is higher than the ground it left or comes to."""
    for phase, ground in zip(phases, under, strict=True):
        own = begin if phase < RISE else end
        if ground > own + _LEVEL and shape.height(phase, begin, end)[0] < ground + _CLEAR:
            return False
    return True
