"""`TRIALS`: the table of trials, each of which makes one thing harder in one scene.

The easy end is survived by any robot that works, the hard end by hardly any. Each field of the
scene that an amount goes into has a small function from the amount to the field's value.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from poise.apps.teleoperation import terrain_blocks
from poise.errors import ConfigurationError
from poise.robots import Robot

VERSION = 2
"""Of the table and the scenes: cards of different ones cannot be compared. Goes up with any change
of either."""

# A scenario in the folder `scenes`
Scene = Literal["stand", "walk", "lead", "bad_operator"]

# What a trial is repeated for: four directions, those of the card, or those at all phases of a step
Spread = Literal["once", "quarters", "directions", "phases"]

STEP_BEGIN, STEP_TIME = 1.8, 0.8
"""Lift-off of the second step of the scene `walk`, and from there to the next lift-off [s]."""


@dataclass(frozen=True, kw_only=True)
class Place:
    """The circumstances in which an amount becomes values of fields."""

    robot: Robot
    links: tuple[str, ...]  # that have a mass
    control_dt: float  # of the scene [s]
    angle: float = 0.0  # direction, anticlockwise from ahead [rad]
    phase: float = 0.0  # of the step, from one lift-off (0) to the next (1)
    seed: int = 0  # of the episode

    @property
    def direction(self) -> tuple[float, float]:
        """Unit vector along the angle, ahead and to the left; zeros are zero."""
        return round(math.cos(self.angle), 12), round(math.sin(self.angle), 12)


# From an amount to the value of a field
Formula = Callable[[float, Place], Any]


def _itself(amount: float, _: Place) -> float:
    return amount


def _push(amount: float, place: Place) -> list[float]:
    x, y = place.direction
    return [amount * x, amount * y, 0.0]


def _push_in_step(amount: float, place: Place) -> list[dict[str, Any]]:
    at = STEP_BEGIN + place.phase * STEP_TIME
    change = _push(amount, place)
    return [{"body": "torso", "at": at, "duration": 0.1, "velocity_change": change}]


def _slope(amount: float, place: Place) -> list[float]:
    """The rotation that has the floor go down in the direction: about its left."""
    x, y = place.direction
    return [-amount * y, amount * x]


def _bumps(amount: float, place: Place) -> list[dict[str, Any]]:
    """Boxes at random places, unknown to the planner; the highest has this height."""
    blocks = terrain_blocks("bumps", place.robot, seed=place.seed)
    highest = max(block.size[2] for block in blocks)
    sizes = ([*block.size[:2], block.size[2] * amount / highest] for block in blocks)
    return [
        {"center": [*block.center], "size": size, "yaw": block.yaw, "told": False}
        for block, size in zip(blocks, sizes, strict=True)
    ]


def _in_one_hand(amount: float, place: Place) -> list[dict[str, Any]]:
    if not place.robot.hands:
        raise ConfigurationError("the robot has no hand", got=place.robot.name)
    return _payload(place.robot.hands[0], amount, place.robot)


def _on_the_torso(amount: float, place: Place) -> list[dict[str, Any]]:
    return _payload(place.robot.torso, amount, place.robot)


def _payload(frame: str, share: float, robot: Robot) -> list[dict[str, Any]]:
    return [{"frame": frame, "mass": share * robot.mass}] if share > 0.0 else []


def _error_of_links(field: str, scaled: Callable[[float, Any], Any], size: int = 0) -> Formula:
    """Each link has an error of its own, of up to an amount: by numbers drawn in [-1, 1]."""

    def errors(amount: float, place: Place) -> list[dict[str, Any]]:
        shape = (size,) if size else ()
        rng = np.random.default_rng([place.seed, *shape])
        return [
            {
                "link": link,
                field: np.asarray(scaled(amount, rng.uniform(-1.0, 1.0, shape))).tolist(),
            }
            for link in place.links
        ]

    return errors


def _ticks(amount: float, place: Place) -> float:
    """A time, as whole control periods."""
    return round(amount / place.control_dt) * place.control_dt


def _times(typical: float) -> Formula:
    return lambda amount, _: amount * typical


@dataclass(frozen=True)
class Trial:
    """A row of the table."""

    name: str
    title: str
    unit: str  # of the amount
    scene: Scene
    easy: float  # amount at the easy end
    hard: float
    fields: Mapping[str, Formula]  # that the amount goes into, by path
    spread: Spread = "once"
    log: bool = False  # amounts between the ends are halved by their ratio
    share: bool = False  # nothing is bisected: every seed is one episode, and counts

    def amount(self, level: float) -> float:
        """The amount at a level, 0 at the easy end and 1 at the hard one."""
        if self.log:
            return float(self.easy * (self.hard / self.easy) ** level)
        return self.easy + level * (self.hard - self.easy)

    def level(self, amount: float) -> float:
        """The level of an amount."""
        ends = (amount, self.easy, self.hard)
        amount, easy, hard = (math.log(end) for end in ends) if self.log else ends
        return min(1.0, max(0.0, (amount - easy) / (hard - easy)))

    def values(self, level: float, place: Place) -> dict[str, Any]:
        """Values of the scene's fields, by path."""
        amount = self.amount(level)
        return {path: formula(amount, place) for path, formula in self.fields.items()}


_ENCODERS: dict[str, Formula] = {
    "plant.sensors.encoder_resolution": _times(4.8e-5),
    "plant.sensors.joint_velocity_noise": _times(0.01),
}
_IMU: dict[str, Formula] = {
    "plant.sensors.base_orientation_noise": _times(1e-3),
    "plant.sensors.gyro_noise": _times(5e-3),
}
_PUSH = {"pushes[0].velocity_change": _push}
_WALK_PUSH = {"pushes": _push_in_step}
_SLOPE = {"plant.floor_slope": _slope}
_BUMPS = {"plant.blocks": _bumps}
_FRICTION = {"plant.friction": _itself}
_HAND, _TORSO = {"plant.payloads": _in_one_hand}, {"plant.payloads": _on_the_torso}
_ERRORS = "plant.link_errors"
_MASSES = {_ERRORS: _error_of_links("mass_scale", lambda most, drawn: 1.0 + most * drawn)}
_TENSORS = {_ERRORS: _error_of_links("inertia_scale", lambda most, drawn: most ** float(drawn))}
_COMS = {_ERRORS: _error_of_links("com_offset", lambda most, drawn: most * drawn, size=3)}
_MOTORS = {"plant.torque_bandwidth": _itself}
_DELAY = {"plant.sensors.delay": _ticks}
_STRIDE = {"walk.strides[0].length": _times(STEP_TIME)}
_LOSS, _LATENCY = {"devices.loss": _itself}, {"devices.latency": _itself}

TRIALS: tuple[Trial, ...] = (
    Trial("push", "push, standing", "m/s", "stand", 0.0, 1.6, _PUSH, "directions"),
    Trial("push_walk", "push, walking", "m/s", "walk", 0.0, 1.6, _WALK_PUSH, "phases"),
    Trial("slope", "slope, standing", "rad", "stand", 0.0, 0.32, _SLOPE, "quarters"),
    Trial("slope_walk", "slope, walking", "rad", "walk", 0.0, 0.16, _SLOPE, "quarters"),
    Trial("bumps_walk", "bumps, walking", "m", "walk", 0.001, 0.05, _BUMPS),
    Trial("friction", "friction, standing", "", "stand", 1.0, 0.01, _FRICTION, log=True),
    Trial("friction_walk", "friction, walking", "", "walk", 1.0, 0.02, _FRICTION, log=True),
    Trial("payload_hand", "payload in one hand", "of its mass", "stand", 0.0, 0.64, _HAND),
    Trial("payload_torso", "payload on the torso", "of its mass", "stand", 0.0, 1.0, _TORSO),
    Trial("mass_error", "mass error of links", "share", "stand", 0.0, 0.95, _MASSES),
    Trial("mass_error_walk", "mass error of links, walking", "share", "walk", 0.0, 0.95, _MASSES),
    Trial("com_error", "CoM error of links", "m", "stand", 0.0, 0.16, _COMS),
    Trial("inertia_error", "inertia error of links", "", "stand", 1.0, 100.0, _TENSORS, log=True),
    Trial("bandwidth", "torque bandwidth", "Hz", "stand", 200.0, 1.0, _MOTORS, log=True),
    Trial("bandwidth_walk", "bandwidth, walking", "Hz", "walk", 200.0, 1.0, _MOTORS, log=True),
    Trial("delay", "delay of sensors", "s", "stand", 0.0, 0.128, _DELAY),
    Trial("delay_walk", "delay of sensors, walking", "s", "walk", 0.0, 0.064, _DELAY),
    Trial("encoder_noise", "encoder noise", "times", "stand", 1.0, 1000.0, _ENCODERS, log=True),
    Trial("imu_noise", "IMU noise", "times", "stand", 1.0, 1000.0, _IMU, log=True),
    Trial("speed", "speed of walking", "m/s", "walk", 0.05, 0.85, _STRIDE),
    Trial("packet_loss", "lost packets of the operator", "share", "lead", 0.0, 1.0, _LOSS),
    Trial("latency", "latency of the operator", "s", "lead", 0.0, 3.2, _LATENCY),
    Trial("bad_operator", "bad operators", "of seeds", "bad_operator", 0.0, 1.0, {}, share=True),
)  # fmt: skip
"""The trials by name, title, unit, scene, easy end, hard end, fields and what they are spread over.

Standing trials are made under the gentle push of their scene, so that balance is asked for."""
