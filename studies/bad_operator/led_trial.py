"""`run_trial`: a robot that is led under a condition, for a while. `led_by`: by anybody else."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import mujoco
import numpy as np

from poise.apps.teleoperation import BadOperator, TeleopRun, run_teleop
from poise.locomotion import Device, Mode, StepTeleoperator
from poise.robots import Robot, load_robot
from studies.bad_operator.conditions import MIXED, PUSHED, changed_plant, pushes


@dataclass(frozen=True, kw_only=True)
class Trial:
    """One run under a bad operator.

    Attributes:
        robot: its name.
        level: what is commanded, see `PLANTS`.
        condition: see `changed_plant`.
        seed: of everything random.
        seconds: length unless the robot falls [s].
        solved_by: name of the controller; the level's own when None.
        folder: keeps the input of a run that ends with a fall, for `replay_teleop`; None for none.
    """

    robot: str
    level: str
    condition: str
    seed: int
    seconds: float
    solved_by: str | None = None
    folder: Path | None = None


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
    return led_by(trial, lambda teleoperator: BadOperator(teleoperator, trial.seed))


def led_by(trial: Trial, operator: Callable[[StepTeleoperator], Device]) -> Outcome:
    """Run a trial with another operator."""
    robot, seed = _robot(trial.robot), trial.seed
    plant = changed_plant(robot, trial.level, trial.condition, seed)
    pushed = trial.condition in (PUSHED, MIXED)
    recording = None
    if trial.folder is not None:
        trial.folder.mkdir(parents=True, exist_ok=True)
        recording = trial.folder / f"seed-{seed}.mcap"
    run = run_teleop(
        robot,
        operator,
        plant,
        duration=trial.seconds,
        seed=seed,
        pushes=pushes(robot, seed, trial.seconds, plant.control_dt) if pushed else (),
        solved_by=trial.solved_by,
        recording=recording,
    )
    if recording is not None and not run.fell:
        recording.unlink()
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
