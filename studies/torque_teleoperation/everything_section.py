"""Falls where feet, hands, head, body and stick are led at random, all at once."""

from studies.bad_operator.conditions import DESCRIBED, MIXED
from studies.bad_operator.falls_asked import (
    FALL_EVERY,
    FALLS_HEADER,
    falls_allowed,
    falls_finding,
    falls_row,
)
from studies.bad_operator.led_trial import Outcome, Trial, led_by
from studies.finding import Finding, Section, Table
from studies.plan import Progress, StudyOptions
from studies.torque_teleoperation.everything import EverythingOperator
from studies.trials import run_each

_ASKED = (
    ("g1", DESCRIBED), ("biped20", DESCRIBED), ("humanoid33", DESCRIBED), ("talos", DESCRIBED),
    ("g1", MIXED),
)  # fmt: skip
"""Robots and conditions."""

_SEEDS = 10
"""Of each."""


def run_trial(trial: Trial) -> Outcome:
    """Runs a trial."""
    return led_by(trial, lambda teleoperator: EverythingOperator(teleoperator, trial.seed))


def everything_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    first, seconds = options.first_seed, 15.0 if options.quick else 60.0
    trials = [
        Trial(robot=robot, level="torque", condition=condition, seed=first + k, seconds=seconds)
        for robot, condition in _ASKED
        for k in range(options.count(_SEEDS, 1))
    ]
    outcomes = list(run_each(run_trial, Outcome, trials, progress, options).values())
    groups = [
        [o for o in outcomes if (o.trial.robot, o.trial.condition) == asked] for asked in _ASKED
    ]
    return Section(
        prose=(
            f"{seconds:.0f} s each, from seed {first}. Feet are the bad operator's, both hands "
            "go to places at random at up to 1 m/s, the head turns, the body is bent, lowered and "
            "raised, feet are turned, and the stick is pushed now and then. Nothing was tuned on "
            "it. Asked: as described no fall, under all conditions at once at most one in "
            f"{FALL_EVERY:.0f} minutes.",
        ),
        findings=tuple(_finding(group) for group in groups),
        tables=(
            Table(
                title="Everything at once",
                header=FALLS_HEADER,
                rows=tuple(
                    falls_row(*asked, group) for asked, group in zip(_ASKED, groups, strict=True)
                ),
                caption="Of the lean up to 0.4 rad about each axis is asked for.",
            ),
        ),
    )


def _finding(group: list[Outcome]) -> Finding:
    trial = group[0].trial
    name = f"{trial.robot}, {trial.condition}, everything at once"
    return falls_finding(name, group, falls_allowed(trial.condition, group))
