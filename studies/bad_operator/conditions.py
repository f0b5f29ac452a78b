"""`CONDITIONS` and `OTHER_PLANTS`: deviations of a plant from the model, and `pushes` on it."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from poise.apps.teleoperation import (
    TORQUE_TELEOP_PLANT,
    VELOCITY_TELEOP_PLANT,
    terrain_blocks,
)
from poise.robots import Robot
from poise.sim import PlantConfig

PLANTS = {"velocity": VELOCITY_TELEOP_PLANT, "torque": TORQUE_TELEOP_PLANT}
"""What the robot is simulated on, by what it is commanded."""

_ATTITUDE = math.radians(0.5)
"""Constant error of the attitude, in a direction drawn by the seed [rad]."""

_SLOPE, _FRICTION, _MASS, _DELAY = math.radians(3.0), 0.5, 0.1, 0.010
_WORSE_ATTITUDE, _GYRO_BIAS, _ACCELEROMETER_BIAS = math.radians(1.0), 0.01, 0.1
_JOINT_ERROR, _CELL_ERROR, _CELL_LEVER = math.radians(0.3), 0.01, 0.1
"""Of the joints [rad], of the soles' forces, over the weight, and of their moments, over those
forces [m]."""
_JOINT_FRICTION, _JOINT_DAMPING, _BANDWIDTH, _SOFT, _INERTIA = 0.5, 0.3, 40.0, 0.02, 1.3
_PUSH, _PUSH_TIME, _PUSH_EVERY = 0.2, 0.1, (3.0, 7.0)
"""A push changes the robot's velocity by this [m/s] within this time [s], and how often [s]."""

Change = Callable[[PlantConfig, Robot, int], PlantConfig]


def _direction(seed: int) -> tuple[float, float]:
    angle = float(np.random.default_rng((seed, 7)).uniform(0.0, 2.0 * math.pi))
    return math.cos(angle), math.sin(angle)


def with_attitude(plant: PlantConfig, error: float, seed: int) -> PlantConfig:
    """A plant whose inertial unit is mounted askew, in a direction drawn from a seed.

    Args:
        plant: as it is otherwise.
        error: of the attitude [rad].
        seed: of the direction.
    """
    x, y = _direction(seed)
    sensors = replace(plant.sensors, base_orientation_error=(error * x, error * y))
    return replace(plant, sensors=sensors)


def _plant(**changes: Any) -> Change:
    return lambda plant, _robot, _seed: replace(plant, **changes)


def _sensors(**changes: Any) -> Change:
    return lambda plant, _robot, _seed: replace(plant, sensors=replace(plant.sensors, **changes))


def _all_of(*changes: Change) -> Change:
    def change(plant: PlantConfig, robot: Robot, seed: int) -> PlantConfig:
        for one in changes:
            plant = one(plant, robot, seed)
        return plant

    return change


def _weighed_badly(plant: PlantConfig, robot: Robot, seed: int) -> PlantConfig:
    force = _CELL_ERROR * robot.weight
    return _sensors(force_bias=force, moment_bias=_CELL_LEVER * force)(plant, robot, seed)


def _askew(plant: PlantConfig, _robot: Robot, seed: int) -> PlantConfig:
    return with_attitude(plant, _WORSE_ATTITUDE, seed)


def _sloping(plant: PlantConfig, _robot: Robot, seed: int) -> PlantConfig:
    x, y = _direction(seed + 1)
    return replace(plant, floor_slope=(_SLOPE * x, _SLOPE * y))


def _bumpy(plant: PlantConfig, robot: Robot, seed: int) -> PlantConfig:
    return replace(plant, blocks=terrain_blocks("bumps", robot, seed=seed))


def _heavier_or_lighter(plant: PlantConfig, _robot: Robot, seed: int) -> PlantConfig:
    return replace(plant, mass_scale=1.0 + (_MASS if seed % 2 else -_MASS))


_UNCHANGED = _plant()
_ZEROED_BADLY = _sensors(joint_position_bias=_JOINT_ERROR)
_SLIPPERY, _LATE = _plant(friction=_FRICTION), _sensors(delay=_DELAY)
_TOUCHING = _plant(self_contact=True)

NOISE = "noise of the sensors alone"
"""A condition of `changed_plant` without an error of the attitude."""

DESCRIBED, PUSHED, SOLID, MIXED = (
    "as described",
    "pushes of 0.2 m/s",
    "links that touch",
    "all of them",
)

CONDITIONS: dict[str, Change] = {
    DESCRIBED: _UNCHANGED,
    "sensors off by a constant": _all_of(
        _ZEROED_BADLY,
        _weighed_badly,
        _sensors(gyro_bias=_GYRO_BIAS, accelerometer_bias=_ACCELEROMETER_BIAS),
        _askew,
    ),
    "slope of 3 degrees": _sloping,
    "bumps of 2 cm": _bumpy,
    "friction 0.5": _SLIPPERY,
    "mass 10% off": _heavier_or_lighter,
    "10 ms of delay": _LATE,
    PUSHED: _UNCHANGED,
    SOLID: _TOUCHING,
    MIXED: _all_of(_sloping, _bumpy, _SLIPPERY, _heavier_or_lighter, _LATE, _TOUCHING),
}
"""What is changed, by name; as described the sensors have noise and an attitude off by 0.5 degrees.

Off by a constant are the attitude, by 1 degree, and gyroscope, accelerometer, joints and load
cells, by a bias each."""

_OTHERS: dict[str, Change] = {
    "joints with friction": _plant(joint_friction=_JOINT_FRICTION, joint_damping=_JOINT_DAMPING),
    "motors of 40 Hz": _plant(torque_bandwidth=_BANDWIDTH),
    "soft contacts": _plant(contact_time_constant=_SOFT),
    "half the physics step": lambda plant, _robot, _seed: replace(
        plant, physics_dt=0.5 * plant.physics_dt
    ),
    "1.3 times the inertia": _plant(inertia_scale=_INERTIA),
    "joints zeroed badly": _ZEROED_BADLY,
    "load cells off": _weighed_badly,
}

OTHER_PLANTS: dict[str, Change] = {
    **_OTHERS,
    "all of another plant": _all_of(*_OTHERS.values()),
}
"""Another robot, or another setting of the simulator, than anything was tuned on: joints have dry
friction of 0.5 N m and damping of 0.3 N m s/rad, motors follow with 40 Hz, contacts give way for
0.02 s, and joints and load cells have the errors that `CONDITIONS` has of them."""


def changed_plant(robot: Robot, level: str, condition: str, seed: int) -> PlantConfig:
    """A plant with noise, an attitude that is off, and a condition.

    Args:
        robot: on it.
        level: what is commanded, see `PLANTS`.
        condition: `NOISE`, or one of `CONDITIONS` and `OTHER_PLANTS`.
        seed: of all that is drawn by chance.
    """
    plant = PLANTS[level].with_noise()
    if condition == NOISE:
        return plant
    plant = with_attitude(plant, _ATTITUDE, seed)
    return (CONDITIONS | OTHER_PLANTS)[condition](plant, robot, seed)


Push = tuple[int, tuple[float, float, float], float]
"""Tick, force [N] and duration [s], as `run_teleop` takes it."""


def push(robot: Robot, speed: float, angle: float, time: float, dt: float) -> Push:
    """A push on the torso along the ground, 0.1 s long.

    Args:
        robot: that is pushed.
        speed: by which it changes the robot's velocity [m/s].
        angle: of its direction, from the world's x [rad].
        time: when it begins [s].
        dt: tick [s].
    """
    force = robot.mass * speed / _PUSH_TIME
    x, y = force * math.cos(angle), force * math.sin(angle)
    return round(time / dt), (x, y, 0.0), _PUSH_TIME


def pushes(robot: Robot, seed: int, seconds: float, dt: float) -> list[Push]:
    """Pushes on the torso along the ground, in directions and at times drawn by chance.

    Args:
        robot: that is pushed.
        seed: of both.
        seconds: length of the run [s].
        dt: tick [s].
    """
    rng, found = np.random.default_rng((seed, 11)), list[Push]()
    time = float(rng.uniform(*_PUSH_EVERY))
    while time < seconds:
        found.append(push(robot, _PUSH, float(rng.uniform(0.0, 2.0 * math.pi)), time, dt))
        time += float(rng.uniform(*_PUSH_EVERY))
    return found
