"""`CONDITIONS`: what is not as the controller takes it to be, under the bad operator.

`run_trial`: one seed of it, at either level.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import mujoco
import numpy as np

from poise.apps.teleoperation import (
    TORQUE_TELEOP_PLANT,
    VELOCITY_TELEOP_PLANT,
    BadOperator,
    TeleopRun,
    run_teleop,
    terrain_blocks,
)
from poise.locomotion import Mode
from poise.robots import Robot, load_robot
from poise.sim import PlantConfig
from studies.bad_operator.habits import HabitualOperator

PLANTS = {"velocity": VELOCITY_TELEOP_PLANT, "torque": TORQUE_TELEOP_PLANT}
"""What the robot is simulated on, by what it is commanded."""

_ATTITUDE = math.radians(0.5)
"""Constant error of the attitude, in a direction drawn by the seed [rad]."""

_SLOPE, _FRICTION, _MASS, _DELAY = math.radians(3.0), 0.5, 0.1, 0.010
_WORSE_ATTITUDE, _GYRO_BIAS, _ACCELEROMETER_BIAS = math.radians(1.0), 0.01, 0.1
_JOINT_ERROR, _CELL_ERROR, _CELL_LEVER = math.radians(0.3), 0.01, 0.1
"""Of the joints [rad], of the soles' forces, over the weight, and of their moments, over those
forces [m]."""
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


def _wrongly_measured(plant: PlantConfig, robot: Robot, seed: int) -> PlantConfig:
    force = _CELL_ERROR * robot.weight
    biases = replace(
        plant.sensors,
        gyro_bias=_GYRO_BIAS,
        accelerometer_bias=_ACCELEROMETER_BIAS,
        joint_position_bias=_JOINT_ERROR,
        force_bias=force,
        moment_bias=_CELL_LEVER * force,
    )
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


PUSHED, SOLID, MIXED = "pushes of 0.2 m/s", "links that touch", "all of them"

CONDITIONS: dict[str, Change] = {
    "as described": _as_described,
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


def changed_plant(robot: Robot, level: str, condition: str, seed: int) -> PlantConfig:
    """A plant with noise, an attitude that is off, and a condition.

    Args:
        robot: on it.
        level: what is commanded, see `PLANTS`.
        condition: see `CONDITIONS`.
        seed: of all that is drawn by chance.
    """
    plant = with_attitude(PLANTS[level].with_noise(), _ATTITUDE, seed)
    return CONDITIONS[condition](plant, robot, seed)


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


@dataclass(frozen=True, kw_only=True)
class Trial:
    """What a worker is asked for: a robot, a level, a condition, a seed, and a time [s].

    The operator has one of the `HABITS`, or "" for the bad one, who has none. `solved_by` names
    the controller; None for the usual one.
    """

    robot: str
    level: str
    condition: str
    seed: int
    seconds: float
    habit: str = ""
    solved_by: str | None = None


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What became of a trial.

    Attributes:
        trial: which.
        fell: whether the robot fell.
        seconds: how long it stood [s].
        steps: how often a foot was lifted.
        tilt: largest angle of the torso [rad].
        apart: least distance of one leg from the other, negative where they go through each other,
            which nothing prevents but where links touch [m].
    """

    trial: Trial
    fell: bool
    seconds: float
    steps: int
    tilt: float
    apart: float


@cache
def _robot(name: str) -> Robot:
    return load_robot(name)


def run_trial(trial: Trial) -> Outcome:
    """Runs a trial."""
    robot, seed = _robot(trial.robot), trial.seed
    plant = changed_plant(robot, trial.level, trial.condition, seed)
    pushed = trial.condition in (PUSHED, MIXED)
    run = run_teleop(
        robot,
        lambda teleoperator: (
            HabitualOperator(teleoperator, trial.habit, seed)
            if trial.habit
            else BadOperator(teleoperator, seed)
        ),
        plant,
        duration=trial.seconds,
        seed=seed,
        pushes=pushes(robot, seed, trial.seconds, plant.control_dt) if pushed else (),
        solved_by=trial.solved_by,
    )
    log = run.log
    return Outcome(
        trial=trial,
        fell=run.fell,
        seconds=run.plant.time,
        steps=len(log.entries(Mode.SL)) + len(log.entries(Mode.SR)),
        tilt=float(log.tilt.max()),
        apart=legs_apart(run),
    )


_LOOK_EVERY = 0.2
"""Time from one look at the legs to the next [s]."""

_FAR = 0.3
"""Legs that are further apart are not measured [m]."""


def legs_apart(run: TeleopRun) -> float:
    """The least distance of one leg's shapes from the other's while the robot stood, at most 0.3 m.

    Args:
        run: finished; its plant is not changed.
    """
    plant, teleoperator = run.plant, run.teleoperator
    model, data = plant.model, mujoco.MjData(plant.model)
    left, right = (_leg_shapes(run, sole) for sole in teleoperator.soles)
    log, nearest = run.log, _FAR
    every = round(_LOOK_EVERY / plant.control_dt)
    # What a robot that falls does with its legs is no matter.
    upright = np.flatnonzero(log.time < log.time[-1] - (1.0 if run.fell else 0.0))
    for row in upright[::every]:
        data.qpos[:] = plant.map.qpos(log.q[row])
        mujoco.mj_kinematics(model, data)
        for one in left:
            for other in right:
                distance = mujoco.mj_geomDistance(model, data, one, other, nearest, None)
                nearest = min(nearest, distance)
    return float(nearest)


def _leg_shapes(run: TeleopRun, sole: str) -> list[int]:
    """What of a leg may touch something, from the knee down: thighs are near each other as made."""
    model, robot = run.plant.model, run.plant.robot
    # Pinocchio counts the world and the floating base before the joints.
    joints = [run.plant.map.joints[j - 2] for j in robot.leg_joints(sole)[3:]]
    bodies = [int(model.jnt_bodyid[joint]) for joint in joints]
    solid = np.flatnonzero(model.geom_contype | model.geom_conaffinity)
    return [int(g) for g in solid if int(model.geom_bodyid[g]) in bodies]
