"""`Course`: what a robot that is led walks on, and what else it has not been told of.

`make_course`: one of `COURSES`.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from poise.sim import Block
from studies.locomotion.late_estimate import DELAY

Velocity = tuple[float, float, float]
"""Ahead [m/s], to the left [m/s], turning to the left [rad/s]."""

SLOPE = math.radians(8.0)
"""Of ramps [rad]."""

_STEP_DOWN, _BUMPS = 0.05, 0.02
"""How deep a step is that no map has, and how high bumps are at most [m]."""

_EDGE = 0.35
"""Where the ground begins to be another, ahead of where the robot begins [m]."""

_RAMP, _THICK = 1.2, 0.3
"""Length of a ramp seen from above, and thickness of all blocks that are not bumps [m]."""

_TILE = 0.15
"""Side of a bump [m]."""

_PACE, _ASIDE = (0.25, 0.0, 0.0), (0.0, 0.15, 0.0)


@dataclass(frozen=True, kw_only=True)
class Course:
    """A course.

    Attributes:
        seconds: how long it is walked [s].
        commands: velocities, each with the time from which on it is asked for [s]; at random,
            another every few seconds, when empty.
        blocks: on the floor, which the robot is told nothing of.
        height: of the ground under the robot at the beginning [m].
        friction: of the ground.
        model_friction: that the contacts of the stack are given; their own when None.
        mass: of the robot over its description.
        delay: of all sensors [s].
    """

    seconds: float = 10.0
    commands: tuple[tuple[float, Velocity], ...] = ((1.0, _PACE),)
    blocks: tuple[Block, ...] = ()
    height: float = 0.0
    friction: float = 1.0
    model_friction: float | None = None
    mass: float = 1.0
    delay: float = DELAY


def _up(random: np.random.Generator) -> Course:
    """A ramp up, and level ground at its top."""
    edge = _edge(random)
    top = math.tan(SLOPE) * _RAMP
    plateau = _level(edge + _RAMP + 1.0, 2.0, top)
    return Course(blocks=(_ramp(edge, SLOPE), plateau))


def _down(random: np.random.Generator) -> Course:
    """The same the other way."""
    edge = _edge(random)
    top = math.tan(SLOPE) * _RAMP
    return Course(height=top, blocks=(_level(edge - 1.0, 2.0, top), _ramp(edge, -SLOPE, top)))


def _across(random: np.random.Generator) -> Course:
    """Sideways up a slope, ahead across it, and sideways down again."""
    edge = 0.25 + float(random.uniform(-0.05, 0.05))
    ramp = Block(
        center=(0.0, edge + 0.5 * _RAMP),
        size=(8.0, _RAMP / math.cos(SLOPE), _THICK),
        tilt=(SLOPE, 0.0),
        top=0.5 * math.tan(SLOPE) * _RAMP,
        told=False,
    )
    commands = ((1.0, _ASIDE), (6.0, _PACE), (9.0, (0.0, -_ASIDE[1], 0.0)))
    return Course(seconds=14.0, commands=commands, blocks=(ramp,))


def _bumps(random: np.random.Generator) -> Course:
    """Tiles of random height, everywhere but under the feet at the start."""
    return Course(blocks=_tiles(random, (0.3, 3.0), (-0.6, 0.6)))


def _step_down(random: np.random.Generator) -> Course:
    """Off a platform."""
    edge = _edge(random)
    return Course(seconds=8.0, height=_STEP_DOWN, blocks=(_level(edge - 1.0, 2.0, _STEP_DOWN),))


def _wander(random: np.random.Generator) -> Course:
    """Random velocities where a third of the floor is tiles of random height."""
    return Course(
        seconds=60.0, commands=(), blocks=_tiles(random, (-3.0, 3.0), (-3.0, 3.0), ratio=0.3)
    )


def _slippery(_random: np.random.Generator) -> Course:
    return Course(friction=0.3, model_friction=0.6)


COURSES: Mapping[str, Callable[[np.random.Generator], Course]] = {
    "slope up": _up,
    "slope down": _down,
    "slope across": _across,
    "bumps": _bumps,
    "step down": _step_down,
    "friction": _slippery,
    "light": lambda _: Course(mass=0.8),
    "heavy": lambda _: Course(mass=1.2),
    "delay": lambda _: Course(delay=0.02),
    "wandering": _wander,
}
"""Courses by name, each from what is random in it."""


def make_course(name: str, seed: int) -> Course:
    """A course."""
    return COURSES[name](np.random.default_rng((seed, len(name))))


def _edge(random: np.random.Generator) -> float:
    """Where the ground changes: at any place of a foothold [m]."""
    return _EDGE + float(random.uniform(-0.1, 0.1))


def _ramp(edge: float, slope: float, begin: float = 0.0) -> Block:
    """Ahead and up from an edge, or down, from a height on."""
    return Block(
        center=(edge + 0.5 * _RAMP, 0.0),
        size=(_RAMP / math.cos(slope), 3.0, _THICK),
        tilt=(0.0, -slope),
        top=begin + 0.5 * math.tan(slope) * _RAMP,
        told=False,
    )


def _level(center: float, length: float, height: float) -> Block:
    """Level ground at a height, around a place ahead."""
    return Block(center=(center, 0.0), size=(length, 3.0, _THICK), top=height, told=False)


def _tiles(
    random: np.random.Generator,
    along: tuple[float, float],
    across: tuple[float, float],
    ratio: float = 1.0,
) -> tuple[Block, ...]:
    """Square tiles of random height, on a part of the floor between two x and two y [m]."""
    tiles: list[Block] = []
    for x in np.arange(*along, _TILE).tolist():
        for y in np.arange(*across, _TILE).tolist():
            height = float(random.uniform(1e-3, _BUMPS))
            under_feet = math.hypot(x, y) < _EDGE
            if random.uniform() < ratio and not under_feet:
                size = (_TILE, _TILE, height)
                tiles.append(Block(center=(x, y), size=size, told=False))
    return tuple(tiles)
