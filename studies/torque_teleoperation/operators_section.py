"""Falls under the bad operator at torque level, by robot and by what is not as described."""

from studies.bad_operator.conditions import CONDITIONS, DESCRIBED, MIXED, OTHER_PLANTS
from studies.bad_operator.falls_asked import (
    FALL_EVERY,
    FALLS_HEADER,
    falls_finding,
    falls_row,
    minutes,
)
from studies.bad_operator.led_trial import Outcome, Trial, run_trial
from studies.finding import Section, Table
from studies.plan import Progress, StudyOptions
from studies.trials import run_each

_ROBOTS = ("biped20", "humanoid33", "g1")


def operators_section(options: StudyOptions, progress: Progress) -> Section:
    """The section, of all robots under all conditions."""
    return _section(_ROBOTS, tuple(CONDITIONS), options, progress)


def described_section(options: StudyOptions, progress: Progress) -> Section:
    """G1 as described, of it by itself: five hours of a core in place of two days."""
    return _section(("g1",), (DESCRIBED,), options, progress)


def mixed_section(options: StudyOptions, progress: Progress) -> Section:
    """What is hardest in it, by itself, half an hour in place of a night.

    Both keep the same trials: who runs one after the other runs none of them again.
    """
    return _section(("g1",), (MIXED,), options, progress)


def plants_section(options: StudyOptions, progress: Progress) -> Section:
    """The section of plants that nothing was tuned on."""
    return _section(("g1", "humanoid33"), tuple(OTHER_PLANTS), options, progress)


def _section(
    robots: tuple[str, ...],
    conditions: tuple[str, ...],
    options: StudyOptions,
    progress: Progress,
) -> Section:
    first, seconds = options.first_seed, 20.0 if options.quick else 60.0
    trials = [
        Trial(robot=robot, level="torque", condition=condition, seed=first + k, seconds=seconds)
        for robot in robots
        for condition in conditions
        for k in range(_seeds(condition, options))
    ]
    outcomes = list(run_each(run_trial, Outcome, trials, progress, options).values())
    groups = {
        (robot, condition): [
            o for o in outcomes if (o.trial.robot, o.trial.condition) == (robot, condition)
        ]
        for robot in robots
        for condition in conditions
    }
    return Section(
        prose=(
            f"{seconds:.0f} s a seed, from seed {first}. The operator's whims are those of the "
            "study bad-operator. Asked as described: at most one fall in a hundred seeds on G1, "
            "none on the others; otherwise at most one in ten minutes.",
        ),
        findings=tuple(
            falls_finding(f"{robot}, {condition}", group, _allowed(robot, condition, group))
            for (robot, condition), group in groups.items()
        ),
        tables=(
            Table(
                title="Bad operators",
                header=FALLS_HEADER,
                rows=tuple(falls_row(*which, group) for which, group in groups.items()),
            ),
        ),
    )


def _seeds(condition: str, options: StudyOptions) -> int:
    if condition in OTHER_PLANTS:
        return options.count(5, 1)
    return options.count(200 if condition == DESCRIBED else 50, 3)


def _allowed(robot: str, condition: str, group: list[Outcome]) -> float:
    """Falls that are asked for at most."""
    if condition == DESCRIBED:
        return 0.01 * len(group) if robot == "g1" else 0.0
    return minutes(group) / FALL_EVERY
