"""Falls under the bad operator, seed by seed, over all cores."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

from poise.apps.teleoperation import VELOCITY_TELEOP_PLANT, BadOperator, run_teleop
from poise.locomotion import Mode, TeleopParameters
from poise.robots import Robot, load_robot
from studies.finding import Finding, Section, Table
from studies.plan import Progress, StudyOptions
from studies.trials import run_each


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
    path = None if trial.folder is None else trial.folder / f"seed-{trial.seed}.mcap"
    run = run_teleop(
        _robot(trial.robot),
        lambda controller: BadOperator(controller, trial.seed),
        VELOCITY_TELEOP_PLANT.with_noise(),
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


_SEEDS, _SECONDS, _QUICK_SEEDS = 200, 60.0, 20

ALLOWED = {"biped20": 2, "g1": 10}
"""Falls in 200 seeds that are asked for at most, by robot."""

FOLDER = Path("runs/bad-operator-falls")
"""Where inputs that made a robot fall are kept, in a folder for each."""


def falls_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    count = options.count(_SEEDS, _QUICK_SEEDS)
    first = options.first_seed
    trials = [
        Trial(seed=first + k, seconds=_SECONDS, folder=FOLDER / robot, robot=robot)
        for robot in ALLOWED
        for k in range(count)
    ]
    found = run_each(run_trial, Outcome, trials, progress, options)
    groups = {robot: [found[t] for t in trials if t.robot == robot] for robot in ALLOWED}
    rows = [
        (robot, o.seed, o.seconds, o.mode, o.steps, str(o.recording or ""))
        for robot, group in groups.items()
        for o in group
        if o.fell
    ]
    return Section(
        prose=(
            f"Seeds {first} to {first + count - 1}, {_SECONDS:.0f} s each. Inputs that made a "
            f"robot fall are in `{FOLDER}`; `poise.apps.teleoperation.replay_teleop` "
            "runs them again.",
        ),
        findings=tuple(_finding(robot, group) for robot, group in groups.items()),
        tables=(
            Table(
                title="Falls",
                header="robot | seed | fell at [s] | mode | feet lifted before | recording",
                rows=tuple(rows),
                caption="" if rows else "None.",
            ),
        ),
    )


def _finding(robot: str, group: list[Outcome]) -> Finding:
    count, falls = len(group), sum(o.fell for o in group)
    return Finding(
        name=f"{robot}: falls in {count} seeds",
        ours=falls,
        ok=falls <= ALLOWED[robot] * count // _SEEDS,
        note=f"asked: at most {ALLOWED[robot]} in {_SEEDS}; "
        f"{sum(o.steps for o in group)} feet were lifted in all",
    )
