"""Scripts, way-points of a careful operator, and grounds to walk on."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice, product
from typing import Any, Literal

import numpy as np
from jaxtyping import Float64

from poise._checks import checked_count
from poise.dynamics import Dynamics, RobotState
from poise.errors import UnknownNameError
from poise.locomotion import ScriptedDevice, StepTeleoperator, WayPoint, two_soles
from poise.robots import Robot, standing_posture
from poise.sim import Block

# When the right device is lifted in scenarios 2 and 3, as the paper has it, and when the first
# swing of scenario 4 begins [s]
LIFT_EVENT, SWING_START = 0.565, 3.0


class HomePose:
    """Sizes of a robot at home [m]; `size` is over the paper's robot."""

    def __init__(self, robot: Robot) -> None:
        dynamics, names = Dynamics(robot), two_soles(robot)
        dynamics.update(RobotState(robot.q_home, np.zeros(robot.nv)))
        self.height = float(dynamics.com[2])
        self.size = self.height / 0.765
        self.soles = np.array([dynamics.frame(robot.frame_id(n)).position[:2] for n in names])
        self.length = max(sole.length for sole in robot.soles.values())
        self.apart = float(self.soles[0, 1] - self.soles[1, 1])
        # The paper's distance of the feet; of other robots, whose ankles roll less, as at home.
        self.stance = 0.42 if robot.name == "biped20" else self.apart


@dataclass(frozen=True, kw_only=True)
class Script:
    """A scenario without a person: its devices, its posture at the start and its blocks."""

    name: str
    points: tuple[WayPoint, ...]  # of the devices
    duration: float  # [s]
    feet_apart: float  # at the start [m]
    com_height: float  # at the start [m]
    blocks: tuple[Block, ...] = ()  # on the floor

    def device(self, teleoperator: StepTeleoperator) -> ScriptedDevice:
        """Make the foot devices, at the current poses of the feet."""
        return ScriptedDevice(self.points, *teleoperator.estimator.anchors)

    def posture(self, robot: Robot) -> Float64[np.ndarray, " nq"]:
        """Return the configuration at the start."""
        return standing_posture(robot, feet_apart=self.feet_apart, com_height=self.com_height)


def over_an_obstacle(robot: Robot, aside: float = 0.0) -> Script:
    """Scenario 1: right foot, then left foot over two blocks that lie across its path."""
    home = HomePose(robot)
    size, sole = home.size, home.length
    depth, gap, low, high = 0.02 * size, 0.045 * size, 0.05 * size, 0.08 * size
    step, up = sole + 2.0 * depth + 2.0 * gap, high + 0.09 * size
    blocks = tuple(
        Block(
            center=(0.5 * sole + gap + (i + 0.5) * depth, 0.0),
            size=(depth, 4.0 * home.stance, height),
        )
        for i, height in enumerate((low, high))
    )
    right = _careful_step("right", 0.5, (step, -aside * size), up)
    left = _careful_step("left", 7.0, (step, 0.0), up)
    return _script("scenario 1", home, (*right, *left), 14.0, blocks=blocks)


def lift_one_foot(robot: Robot) -> Script:
    """Scenario 2: the right device is lifted at 0.565 s; the foot stays up."""
    home, quick = HomePose(robot), 0.02
    heights = (LIFT_EVENT - quick, 0.0), (LIFT_EVENT, 0.021), (LIFT_EVENT + 0.7, 0.1 * home.size)
    points = [WayPoint(at=at, right=(0.0, 0.0, z)) for at, z in heights]
    return _script("scenario 2", home, points, 4.5, feet_apart=home.stance)


def switch_feet(robot: Robot, after: float = 0.6) -> Script:
    """Scenario 3: down with the right foot, up with the left one."""
    home = HomePose(robot)
    up, ground = 0.06 * home.size, 3.2
    lift = ground + after
    heights = (
        (0.5, None, 0.0), (0.8, None, 0.03), (1.8, None, up), (2.6, 0.0, up),
        (ground, None, -0.02), (lift, 0.0, -0.02), (lift + 0.05, 0.025, None),
        (lift + 1.0, up, None),
    )  # fmt: skip
    points = [WayPoint(at=at, left=_up(left), right=_up(right)) for at, left, right in heights]
    return _script(f"scenario 3, {after:.2f} s", home, points, lift + 3.0, feet_apart=home.stance)


def swing_fast(
    robot: Robot, direction: Literal["forward", "sideways"] = "forward", times: int = 3
) -> Script:
    """Scenario 4: the swing foot goes out in 0.3 s, and back in 0.3 s, so many times."""
    home = HomePose(robot)
    up = (0.0, 0.0, 0.1 * home.size)
    x, y = (0.3, 0.0) if direction == "forward" else (0.0, -0.15)
    out = (x * home.size, y * home.size, up[2])
    places = [(0.5, (0.0, 0.0, 0.0)), (1.3, up)]
    for start in SWING_START + 2.0 * np.arange(times):
        places += [(start, up), (start + 0.3, out), (start + 1.0, out), (start + 1.3, up)]
    points = [WayPoint(at=at, right=place) for at, place in places]
    return _script(f"scenario 4, {direction}", home, points, SWING_START + 2.0 * times)


SCRIPTS: Mapping[str, Callable[..., Script]] = {
    "over_an_obstacle": over_an_obstacle,
    "lift_one_foot": lift_one_foot,
    "switch_feet": switch_feet,
    "swing_fast": swing_fast,
}
"""The paper's scenarios 1 to 4 by name: each makes a script in the size of the robot it is given.

`switch_feet` also takes the time between the feet, `swing_fast` the direction and how often."""


def _script(
    name: str, home: HomePose, points: Sequence[WayPoint], duration: float, **more: Any
) -> Script:
    start: dict[str, Any] = {"feet_apart": home.apart, "com_height": home.height} | more
    return Script(name=name, points=tuple(points), duration=duration, **start)


def _up(height: float | None) -> tuple[float, float, float] | None:
    return None if height is None else (0.0, 0.0, height)


def _careful_step(
    foot: Literal["left", "right"], begin: float, step: tuple[float, float], up: float
) -> list[WayPoint]:
    """Lift, wait for the weight to shift, up, along the ground, down."""
    there = ((3.6, up), (4.2, up), (5.2, -0.03), (5.6, -0.03), (6.0, 0.0))
    places = [(t, (0.0, 0.0, z)) for t, z in ((0.0, 0.0), (0.3, 0.03), (1.0, 0.03), (2.0, up))]
    places += [(t, (*step, z)) for t, z in there]
    return [WayPoint(at=begin + t, **{foot: place}) for t, place in places]


TERRAINS = ("flat", "obstacle", "steps", "bumps", "tiles")


def terrain_blocks(name: str, robot: Robot, *, seed: int = 0) -> tuple[Block, ...]:
    """Make the blocks of a ground, for a robot that stands at the origin as at home.

    - flat: none.
    - obstacle: the two blocks of the paper's scenario 1, across the way.
    - steps: three stairs, up by 5 cm and 3 cm, down by 4 cm twice, each 1.3 soles deep.
    - bumps: boxes 1 to 2 cm high at random places, none under the feet at the start.
    - tiles: squares of 15 cm, up to 2 cm high, on a third of the floor, none under the feet.

    Lengths are for a robot whose CoM is at 0.765 m, and go with its height.

    Args:
        name: flat, obstacle, steps, bumps or tiles.
        robot: a biped.
        seed: of the bumps and tiles.

    Raises:
        UnknownNameError: no such ground.
        ConfigurationError: a robot that is no biped.
    """
    if name not in TERRAINS:
        raise UnknownNameError("no such terrain", got=name, choices=TERRAINS)
    home = HomePose(robot)
    rng = np.random.default_rng(checked_count(seed, f"seed of the {name}"))
    match name:
        case "obstacle":
            return over_an_obstacle(robot).blocks
        case "steps":
            return tuple(_stairs(home))
        case "bumps":
            return tuple(islice(_bumps(robot, home, rng), 60))
        case "tiles":
            return tuple(_tiles(home.size, rng))
        case _:
            return ()


def _stairs(home: HomePose, gap: float = 0.05) -> Iterator[Block]:
    """Stairs; down by less than up, for a foot is sent no deeper than 5 cm below the other one."""
    size, depth = home.size, 1.3 * home.length
    front = float(home.soles[:, 0].max()) + 0.5 * home.length + gap * size
    width = 6.0 * float(np.ptp(home.soles[:, 1]))
    for i, height in enumerate((0.05, 0.08, 0.04)):
        center = front + (i + 0.5) * depth, 0.0
        yield Block(center=center, size=(depth, width, height * size))


def _bumps(
    robot: Robot, home: HomePose, rng: np.random.Generator, clear: float = 0.02
) -> Iterator[Block]:
    """Bumps without end around the start and ahead of it, that far from the soles [m]."""
    size = home.size
    half = 0.5 * np.array([(sole.length, sole.width) for sole in list(robot.soles.values())[:2]])
    while True:
        x, y = (size * float(rng.uniform(*side)) for side in ((-0.6, 2.4), (-0.8, 0.8)))
        length, width = (size * rng.uniform(0.05, 0.15, 2)).tolist()
        height, yaw = size * float(rng.uniform(0.01, 0.02)), float(rng.uniform(0.0, np.pi))
        # However it is turned, a bump is within this of its middle.
        apart = 0.5 * float(np.hypot(length, width)) + clear * size
        outside = np.maximum(np.abs(np.array([x, y]) - home.soles) - half, 0.0)
        if float(np.linalg.norm(outside, axis=1).min()) > apart:
            yield Block(center=(x, y), size=(length, width, height), yaw=yaw)


def _tiles(
    size: float, rng: np.random.Generator, side: float = 0.15, clear: float = 0.35
) -> Iterator[Block]:
    """Tiles of a side on part of six metres of floor, their middles that far from the origin."""
    for x, y in product(np.arange(-3.0, 3.0, side).tolist(), repeat=2):
        height = float(rng.uniform(1e-3, 0.02))
        if rng.random() < 0.3 and math.hypot(x, y) >= clear:
            sides = (size * side, size * side, size * height)
            yield Block(center=(size * x, size * y), size=sides)
