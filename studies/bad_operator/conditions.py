"""`CONDITIONS`: what is not as the controller takes it to be, under the bad operator.

`OTHER_PLANTS`: robots and simulators that nothing was tuned on. `pushes`: when somebody pushes.
"""

import math
from collections.abc import Callable
from dataclasses import replace

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


def _as_described(plant: PlantConfig, robot: Robot, seed: int) -> PlantConfig:
    del robot, seed
    return plant


def _zeroed_badly(plant: PlantConfig, robot: Robot, seed: int) -> PlantConfig:
    del robot, seed
    return replace(plant, sensors=replace(plant.sensors, joint_position_bias=_JOINT_ERROR))


def _weighed_badly(plant: PlantConfig, robot: Robot, seed: int) -> PlantConfig:
    del seed
    force = _CELL_ERROR * robot.weight
    biases = replace(plant.sensors, force_bias=force, moment_bias=_CELL_LEVER * force)
    return replace(plant, sensors=biases)


def _wrongly_measured(plant: PlantConfig, robot: Robot, seed: int) -> PlantConfig:
    for change in (_zeroed_badly, _weighed_badly):
        plant = change(plant, robot, seed)
    biases = replace(plant.sensors, gyro_bias=_GYRO_BIAS, accelerometer_bias=_ACCELEROMETER_BIAS)
    return with_attitude(replace(plant, sensors=biases), _WORSE_ATTITUDE, seed)


def _sloping(plant: PlantConfig, robot: Robot, seed: int) -> PlantConfig:
    del robot
    x, y = _direction(seed + 1)
    return replace(plant, floor_slope=(_SLOPE * x, _SLOPE * y))


def _bumpy(plant: PlantConfig, robot: Robot, seed: int) -> PlantConfig:
    return replace(plant, blocks=terrain_blocks("bumps", robot, seed=seed))


def _slippery(plant: PlantConfig, robot: Robot, seed: int) -> PlantConfig:
    del robot, seed
    return replace(plant, friction=_FRICTION)


def _heavier_or_lighter(plant: PlantConfig, robot: Robot, seed: int) -> PlantConfig:
    del robot
    return replace(plant, mass_scale=1.0 + (_MASS if seed % 2 else -_MASS))


def _late(plant: PlantConfig, robot: Robot, seed: int) -> PlantConfig:
    del robot, seed
    return replace(plant, sensors=replace(plant.sensors, delay=_DELAY))


def _solid(plant: PlantConfig, robot: Robot, seed: int) -> PlantConfig:
    del robot, seed
    return replace(plant, self_contact=True)


def _mixed(plant: PlantConfig, robot: Robot, seed: int) -> PlantConfig:
    for change in (_sloping, _bumpy, _slippery, _heavier_or_lighter, _late, _solid):
        plant = change(plant, robot, seed)
    return plant


def _with_friction(plant: PlantConfig, robot: Robot, seed: int) -> PlantConfig:
    del robot, seed
    return replace(plant, joint_friction=_JOINT_FRICTION, joint_damping=_JOINT_DAMPING)


def _with_slow_motors(plant: PlantConfig, robot: Robot, seed: int) -> PlantConfig:
    del robot, seed
    return replace(plant, torque_bandwidth=_BANDWIDTH)


def _on_soft_ground(plant: PlantConfig, robot: Robot, seed: int) -> PlantConfig:
    del robot, seed
    return replace(plant, contact_time_constant=_SOFT)


def _with_half_the_step(plant: PlantConfig, robot: Robot, seed: int) -> PlantConfig:
    del robot, seed
    return replace(plant, physics_dt=0.5 * plant.physics_dt)


def _with_inertia(plant: PlantConfig, robot: Robot, seed: int) -> PlantConfig:
    del robot, seed
    return replace(plant, inertia_scale=_INERTIA)


def _all_of_another_plant(plant: PlantConfig, robot: Robot, seed: int) -> PlantConfig:
    for change in (
        _with_friction,
        _with_slow_motors,
        _on_soft_ground,
        _with_half_the_step,
        _with_inertia,
        _zeroed_badly,
        _weighed_badly,
    ):
        plant = change(plant, robot, seed)
    return plant


DESCRIBED, PUSHED, SOLID, MIXED = (
    "as described",
    "pushes of 0.2 m/s",
    "links that touch",
    "all of them",
)

CONDITIONS: dict[str, Change] = {
    DESCRIBED: _as_described,
    "sensors off by a constant": _wrongly_measured,
    "slope of 3 degrees": _sloping,
    "bumps of 2 cm": _bumpy,
    "friction 0.5": _slippery,
    "mass 10% off": _heavier_or_lighter,
    "10 ms of delay": _late,
    PUSHED: _as_described,
    SOLID: _solid,
    MIXED: _mixed,
}
"""What is changed, by name; as described the sensors have noise and an attitude off by 0.5 degrees.

Off by a constant are the attitude, by 1 degree, and gyroscope, accelerometer, joints and load
cells, by a bias each."""

OTHER_PLANTS: dict[str, Change] = {
    "joints with friction": _with_friction,
    "motors of 40 Hz": _with_slow_motors,
    "soft contacts": _on_soft_ground,
    "half the physics step": _with_half_the_step,
    "1.3 times the inertia": _with_inertia,
    "joints zeroed badly": _zeroed_badly,
    "load cells off": _weighed_badly,
    "all of another plant": _all_of_another_plant,
}
"""Another robot, or another setting of the simulator, than anything was tuned on: joints have dry
friction of 0.5 N m and damping of 0.3 N m s/rad, motors follow with 40 Hz, contacts give way for
0.02 s, and joints and load cells have the errors that `CONDITIONS` has of them."""


def changed_plant(robot: Robot, level: str, condition: str, seed: int) -> PlantConfig:
    """A plant with noise, an attitude that is off, and a condition.

    Args:
        robot: on it.
        level: what is commanded, see `PLANTS`.
        condition: see `CONDITIONS` and `OTHER_PLANTS`.
        seed: of all that is drawn by chance.
    """
    plant = with_attitude(PLANTS[level].with_noise(), _ATTITUDE, seed)
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
