"""The operator's connection is cut in the middle of a step, in ten phases of it."""

import math
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from poise.apps.teleoperation import TORQUE_TELEOP_PLANT, PoorLink, run_teleop
from poise.locomotion import Mode, ScriptedDevice, StepTeleoperator, WayPoint
from poise.robots import Robot, load_robot
from studies.plan import StudyOptions
from studies.trial_section import Case, TrialSection, worst

ROBOTS = ("biped20", "humanoid33", "g1")
PHASES = 10

_ATTITUDE = math.radians(0.5)
"""Constant error of the attitude, about both axes [rad]."""

_LIFT, _LOWER, _END = 0.5, 1.8, 2.4
"""When the hand begins to lift, begins to lower, and is down [s]."""

_DURATION = 5.0
_STEP, _HEIGHT = 0.12, 0.08
"""Of the hand, for a COM height of 0.765 m [m]."""
_REST = 0.05
"""Speed of the COM below which a robot has come to rest [m/s]."""


@dataclass(frozen=True, kw_only=True)
class Trial:
    """A robot, and the time at which its operator is cut off [s]."""

    robot: str
    cut: float


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Outcome of a trial.

    Attributes:
        trial: the trial.
        mode: of the robot when the connection was cut.
        fell: whether the robot fell.
        down_after: time from the cut until both feet carry for good [s].
        rests: whether it stands still on both feet in the end.
        tilt: largest angle of the torso [rad].
    """

    trial: Trial
    mode: str
    fell: bool
    down_after: float
    rests: bool
    tilt: float


@cache
def _robot(name: str) -> Robot:
    return load_robot(name)


def _hands(teleoperator: StepTeleoperator) -> ScriptedDevice:
    """A step of the left foot, in the size of the robot."""
    left, right = teleoperator.estimator.anchors
    com = float(teleoperator.estimator.dynamics.com[2] - left[2])
    ahead, height = _STEP * com / 0.765, _HEIGHT * com / 0.765
    places = ((_LIFT, 0.0, 0.0), (1.2, ahead, height), (_LOWER, ahead, height), (_END, ahead, 0.0))
    points = [WayPoint(at=at, left=(x, 0.0, z)) for at, x, z in places]
    return ScriptedDevice(points, left, right)


def run_trial(trial: Trial) -> Outcome:
    """Runs a trial."""
    plant = TORQUE_TELEOP_PLANT.with_noise()
    error = (_ATTITUDE, _ATTITUDE)
    plant = replace(plant, sensors=replace(plant.sensors, base_orientation_error=error))
    run = run_teleop(
        _robot(trial.robot),
        lambda t: PoorLink(_hands(t), latency=0.0, loss=0.0, seed=0, cut=trial.cut),
        plant,
        duration=_DURATION,
    )
    log = run.log
    double = log.when(Mode.D)
    lifted = log.time[~double]
    speed = np.linalg.norm(log.com[-1] - log.com[-50]) / (log.time[-1] - log.time[-50])
    return Outcome(
        trial=trial,
        mode=tuple(Mode)[int(log.mode[np.searchsorted(log.time, trial.cut)])].name,
        fell=run.fell,
        down_after=max(0.0, float(lifted[-1]) - trial.cut) if len(lifted) else 0.0,
        rests=bool(double[-1]) and float(speed) < _REST,
        tilt=float(log.tilt.max()),
    )


def _cases(options: StudyOptions) -> list[Case]:
    cuts = np.linspace(_LIFT + 0.05, _END, PHASES).tolist()
    return [
        Case(
            name=robot,
            trials=[Trial(robot=robot, cut=cut) for cut in cuts],
            failed=lambda outcome: outcome.fell or not outcome.rests,
            what="falls, or no rest,",
        )
        for robot in (ROBOTS[:1] if options.quick else ROBOTS)
    ]


cuts_section = TrialSection(
    title="Connections cut in mid-step",
    prose=(
        "A hand lifts the left device, carries it ahead and puts it down; from a moment on "
        "nothing more arrives. The foot holds for half a second, then comes straight down, "
        "and the robot comes to rest on both feet.",
    ),
    run=run_trial,
    kind=Outcome,
    cases=_cases,
    columns={
        "modes when cut": lambda group: ", ".join(o.mode for o in group),
        "down after, most [s]": worst("down_after"),
        "lean, most [rad]": worst("tilt"),
    },
)
"""The section."""
