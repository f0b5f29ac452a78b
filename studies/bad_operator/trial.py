"""One trial of the bad operator, in a process of its own."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

from poise.apps.teleoperation import TELEOP_PLANT, run_teleop
from poise.locomotion import Mode, TeleopParameters
from poise.robots import Robot, load_robot
from studies.bad_operator.operator import BadOperator


@dataclass(frozen=True, kw_only=True)
class Trial:
    """What a worker is asked for.

    Attributes:
        seed: of the operator and of the sensors.
        seconds: length of the run [s].
        folder: where the input goes if the robot falls; None for nowhere.
        robot: its name.
        parameters: of the teleoperator; scaled to the robot when None.
    """

    seed: int
    seconds: float
    folder: Path | None = None
    robot: str = "biped20"
    parameters: TeleopParameters | None = None


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What became of a trial.

    Attributes:
        seed: of the trial.
        fell: whether the robot fell.
        seconds: how long it stood [s].
        steps: how often a foot was lifted.
        mode: in which mode the run ended.
        tilt: largest angle of the torso [rad].
        recording: file with the input, which `replay_teleop` runs again; None if it stood.
    """

    seed: int
    fell: bool
    seconds: float
    steps: int
    mode: str
    tilt: float
    recording: Path | None


def run_trial(trial: Trial) -> Outcome:
    """Runs a trial; the input is kept only if the robot falls."""
    path = None if trial.folder is None else trial.folder / f"seed-{trial.seed}.teleop"
    run = run_teleop(
        _robot(trial.robot),
        lambda controller: BadOperator(controller, trial.seed),
        TELEOP_PLANT.with_noise(),
        duration=trial.seconds,
        seed=trial.seed,
        parameters=trial.parameters,
        recording=path,
    )
    if path is not None and not run.fell:
        path.unlink()
        path = None
    log = run.log
    return Outcome(
        seed=trial.seed,
        fell=run.fell,
        seconds=run.plant.time,
        steps=len(log.entries(Mode.SL)) + len(log.entries(Mode.SR)),
        mode=run.teleoperator.mode.name,
        tilt=float(log.tilt.max()),
        recording=path,
    )


@cache
def _robot(name: str) -> Robot:
    return load_robot(name)
