"""Grounds to walk on: blocks on the floor, by name, in the size of the robot."""

import numpy as np

from poise._checks import checked_count
from poise.apps.teleoperation._scripts import HomePose, over_an_obstacle
from poise.errors import UnknownNameError
from poise.robots import Robot
from poise.sim import Block

TERRAINS = ("flat", "obstacle", "steps", "bumps")

# Heights of the stairs [m]: down by less than up, for a foot is sent no deeper than 5 cm below
# the other one, and has to press
_STAIRS = (0.05, 0.08, 0.04)

# Room before the first stair [m], and depth of a stair over a sole's length
_GAP, _TREAD = 0.05, 1.3

_WIDTH = 6.0  # Width of the stairs over the distance of the feet

_BUMPS = 60
# Least and largest height and side of a bump [m]
_BUMP_HEIGHT, _BUMP_SIDE = (0.01, 0.02), (0.05, 0.15)
_FIELD = ((-0.6, 2.4), (-0.8, 0.8))  # Where bumps lie, forward and sideways [m]
_CLEAR = 0.02  # Room between a sole at the start and the nearest bump [m]


def terrain_blocks(name: str, robot: Robot, *, seed: int = 0) -> tuple[Block, ...]:
    """Make the blocks of a ground, for a robot that stands at the origin as at home.

    - flat: none.
    - obstacle: the two blocks of the paper's scenario 1, across the way.
    - steps: three stairs, up by 5 cm and 3 cm, down by 4 cm twice, each 1.3 soles deep.
    - bumps: boxes 1 to 2 cm high at random places, none under the feet at the start.

    Lengths are for a robot whose COM is at 0.765 m, and go with its height.

    Args:
        name: flat, obstacle, steps or bumps.
        robot: a biped.
        seed: of the bumps.

    Raises:
        UnknownNameError: no such ground.
        ConfigurationError: a robot that is no biped.
    """
    if name not in TERRAINS:
        raise UnknownNameError("no such terrain", got=name, choices=TERRAINS)
    home = HomePose(robot)
    if name == "bumps":
        return _bumps(robot, home, np.random.default_rng(checked_count(seed, "seed of the bumps")))
    if name != "steps":
        return over_an_obstacle(robot).blocks if name == "obstacle" else ()
    size, depth = home.size, _TREAD * home.length
    front = float(home.soles[:, 0].max()) + 0.5 * home.length + _GAP * size
    width = _WIDTH * float(np.ptp(home.soles[:, 1]))
    return tuple(
        Block(center=(front + (i + 0.5) * depth, 0.0), size=(depth, width, height * size))
        for i, height in enumerate(_STAIRS)
    )


def _bumps(robot: Robot, home: HomePose, rng: np.random.Generator) -> tuple[Block, ...]:
    size = home.size
    half = 0.5 * np.array([(sole.length, sole.width) for sole in list(robot.soles.values())[:2]])
    blocks: list[Block] = []
    while len(blocks) < _BUMPS:
        x, y = (size * float(rng.uniform(*side)) for side in _FIELD)
        length, width = (size * rng.uniform(*_BUMP_SIDE, 2)).tolist()
        height, yaw = size * float(rng.uniform(*_BUMP_HEIGHT)), float(rng.uniform(0.0, np.pi))
        # However it is turned, a bump is within this of its middle.
        apart = 0.5 * float(np.hypot(length, width)) + _CLEAR * size
        outside = np.maximum(np.abs(np.array([x, y]) - home.soles) - half, 0.0)
        if float(np.linalg.norm(outside, axis=1).min()) > apart:
            blocks.append(Block(center=(x, y), size=(length, width, height), yaw=yaw))
    return tuple(blocks)
