"""Walking on ground that nobody told of, and with sensors and a body other than described."""

from collections.abc import Sequence

from studies.finding import Finding, Section, Table
from studies.locomotion.courses import COURSES
from studies.locomotion.led_section import ROBOTS
from studies.locomotion.led_walk import LedOutcome, LedTrial, run_led
from studies.plan import Progress, StudyOptions
from studies.trials import run_each

WANDERING = "wandering"
"""The course on which falls are counted by the time; of all others, by the seed."""

_WANDERED = 60.0
"""How long one seed wanders [s]."""

_SEEDS, _QUICK_SEEDS = 20, 2
_WANDERS, _QUICK_WANDERS = 10, 1

_SURVIVED = 95.0
"""Part of the seeds that has to be survived [%]."""


def ground_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    first = options.seed * _SEEDS
    groups: dict[tuple[str, str], list[LedTrial]] = {}
    for robot in ROBOTS:
        for course in COURSES:
            count = options.count(_SEEDS, _QUICK_SEEDS)
            if course == WANDERING:
                count = options.count(_WANDERS, _QUICK_WANDERS)
            groups[robot, course] = [
                LedTrial(robot=robot, seed=first + i, seconds=_WANDERED, course=course)
                for i in range(count)
            ]
    trials = [t for group in groups.values() for t in group]
    outcomes = run_each(run_led, LedOutcome, trials, progress, options)
    found = {key: [outcomes[t] for t in group] for key, group in groups.items()}
    return Section(
        prose=(
            "Robots are led at 0.25 m/s, or 0.15 m/s sideways, onto ground that nobody told them "
            "of: ramps of 8 degrees with level ground before and behind, tiles of up to 20 mm, a "
            "step of 50 mm down. Or the ground is more slippery than the contacts of the stack "
            "say, 0.3 against 0.6, the robot is lighter or heavier than described by a fifth, "
            "or all sensors are 20 ms late. Edges and bumps lie elsewhere for each seed.",
        ),
        findings=tuple(_finding(*key, group) for key, group in found.items()),
        tables=(_table(found),),
    )


def _finding(robot: str, course: str, group: Sequence[LedOutcome]) -> Finding:
    falls, steps = sum(o.fell for o in group), sum(o.steps for o in group)
    if course == WANDERING:
        return Finding(
            name=f"{robot}: falls under random velocities on tiles",
            paper=1,
            ours=falls,
            ok=falls <= 1,
            note=f"at most; {_WANDERED * len(group):.0f} s, {steps} steps",
        )
    survived = 100.0 * (len(group) - falls) / len(group)
    return Finding(
        name=f"{robot}: {course}",
        paper=_SURVIVED,
        ours=survived,
        unit="%",
        ok=bool(survived >= _SURVIVED),
        note=f"without a fall, at least; {falls} of {len(group)} seeds fell, {steps} steps",
    )


def _table(found: dict[tuple[str, str], list[LedOutcome]]) -> Table:
    rows = tuple(
        (robot, course, o.trial.seed, "yes" if o.fell else "no", o.steps, *o.reached)
        for (robot, course), group in found.items()
        for o in group
    )
    return Table(
        title="Runs on ground that nobody told of",
        header="robot | course | seed | fell | steps | ahead [m/s] | left [m/s] | turn [rad/s]",
        rows=rows,
        caption="Velocities are means from 3 s on.",
    )
