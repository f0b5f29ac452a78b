"""Falls under the bad operator, by the controller that finds the torques."""

import numpy as np

from studies.bad_operator.conditions import CONDITIONS, MIXED
from studies.bad_operator.falls_asked import FALL_EVERY, falls_finding, minutes
from studies.bad_operator.led_trial import Outcome, Trial, run_trial
from studies.finding import Finding, Section, Table
from studies.plan import Progress, StudyOptions
from studies.trials import run_each

_ROBOTS = ("biped20", "g1")
_CONTROLLERS = ("whole_body", "reduced", "osf")
_CONDITIONS = (next(iter(CONDITIONS)), MIXED)

Group = tuple[str, str, str]
"""Robot, controller, condition."""


def controllers_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    first, seconds = options.first_seed, 15.0 if options.quick else 60.0
    trials = [
        Trial(
            robot=robot,
            level="torque",
            condition=condition,
            seed=first + k,
            seconds=seconds,
            solved_by=controller,
        )
        for robot in _ROBOTS
        for controller in _CONTROLLERS
        for condition in _CONDITIONS
        for k in range(options.count(4, 1))
    ]
    groups: dict[Group, list[Outcome]] = {}
    for trial, outcome in run_each(run_trial, Outcome, trials, progress, options).items():
        group = trial.robot, str(trial.solved_by), trial.condition
        groups.setdefault(group, []).append(outcome)
    return Section(
        prose=(
            f"{seconds:.0f} s a seed, from seed {first}: the same stack, led by the same operators "
            "over the same ground, solved by each controller of torques.",
        ),
        findings=tuple(_finding(which, group) for which, group in groups.items()),
        tables=(
            Table(
                title="Controllers",
                header="robot | controller | condition | seeds | falls | feet lifted | "
                "lean, median [rad] | greatest [rad]",
                rows=tuple(_row(which, group) for which, group in groups.items()),
            ),
        ),
    )


def _finding(which: Group, group: list[Outcome]) -> Finding:
    robot, controller, condition = which
    allowed = minutes(group) / FALL_EVERY if condition == MIXED else 0.0
    return falls_finding(f"{robot}, {controller}, {condition}", group, allowed)


def _row(which: Group, group: list[Outcome]) -> tuple[str | int | float, ...]:
    tilts = [o.tilt for o in group]
    return (
        *which,
        len(group),
        sum(o.fell for o in group),
        sum(o.steps for o in group),
        float(np.median(tilts)),
        max(tilts),
    )
