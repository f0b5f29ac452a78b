"""Falls under operators who do one thing over and over, by robot and by habit."""

from studies.bad_operator.conditions import CONDITIONS, MIXED
from studies.bad_operator.falls_asked import FALL_EVERY, falls_allowed, falls_finding
from studies.bad_operator.habits import HABITS
from studies.bad_operator.led_trial import Outcome, Trial, run_trial
from studies.finding import Finding, Section, Table
from studies.plan import Progress, StudyOptions
from studies.trials import run_each

_ROBOTS = ("biped20", "humanoid33", "g1")
_CONDITIONS = (next(iter(CONDITIONS)), MIXED)


def habits_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    first, seconds = options.first_seed, 15.0 if options.quick else 60.0
    trials = [
        Trial(
            robot=robot,
            level="torque",
            condition=condition,
            seed=first + k,
            seconds=seconds,
            habit=habit,
        )
        for robot in _ROBOTS
        for condition in _CONDITIONS
        for habit in HABITS
        for k in range(options.count(2, 1))
    ]
    outcomes = list(run_each(run_trial, Outcome, trials, progress, options).values())
    groups = {
        (robot, condition): [
            o for o in outcomes if (o.trial.robot, o.trial.condition) == (robot, condition)
        ]
        for robot in _ROBOTS
        for condition in _CONDITIONS
    }
    return Section(
        prose=(
            f"{seconds:.0f} s each, from seed {first}. Nothing of the controller was tuned on "
            "these: they are what people do, done well or badly. Asked: as described no fall, "
            f"under all conditions at once at most one in {FALL_EVERY:.0f} minutes.",
        ),
        findings=tuple(_finding(*which, group) for which, group in groups.items()),
        tables=(
            Table(
                title="Operators with habits",
                header="habit | " + " | ".join(f"{robot}, {c}" for robot, c in groups),
                rows=tuple(_row(habit, list(groups.values())) for habit in HABITS),
                caption="Falls, and in brackets how many feet were lifted.",
            ),
        ),
    )


def _finding(robot: str, condition: str, group: list[Outcome]) -> Finding:
    name = f"{robot}, {condition}, operators with habits"
    return falls_finding(name, group, falls_allowed(condition, group))


def _row(habit: str, groups: list[list[Outcome]]) -> tuple[str, ...]:
    cells: list[str] = []
    for group in groups:
        own = [o for o in group if o.trial.habit == habit]
        cells.append(f"{sum(o.fell for o in own)} ({sum(o.steps for o in own)})")
    return (habit, *cells)
