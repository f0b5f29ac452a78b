"""The bad operator at both levels, on a robot with large soles and one with small ones."""

from studies.bad_operator.conditions import CONDITIONS, DESCRIBED, MIXED, PLANTS, SOLID
from studies.bad_operator.falls_asked import FALL_EVERY, minutes
from studies.bad_operator.led_trial import Outcome, Trial, run_trial
from studies.finding import Finding, Section, Table
from studies.plan import Progress, StudyOptions
from studies.trials import run_each

ROBOTS = ("biped20", "g1")

_SEEDS, _SECONDS = 20, 60.0
_QUICK_SEEDS, _QUICK_SECONDS = 3, 20.0


def conditions_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    count = options.count(_SEEDS, _QUICK_SEEDS)
    seconds = _QUICK_SECONDS if options.quick else _SECONDS
    first = options.first_seed
    groups = [
        [
            Trial(robot=robot, level=level, condition=condition, seed=first + k, seconds=seconds)
            for k in range(count)
        ]
        for robot in ROBOTS
        for level in PLANTS
        for condition in CONDITIONS
    ]
    trials = [t for group in groups for t in group]
    found = run_each(run_trial, Outcome, trials, progress, options)
    outcomes = [[found[trial] for trial in group] for group in groups]
    return Section(
        prose=(
            f"{count} seeds of {seconds:.0f} s each, from seed {first}. As described the sensors "
            "have noise, and the attitude is off by half a degree; “sensors off by a constant” is "
            "1 degree, and a bias of gyroscope, accelerometer, joints (0.3 degrees) and load cells "
            "(1% of the weight). Asked: at torque level at "
            f"most one fall in {FALL_EVERY:.0f} minutes, at velocity level of biped20 as described "
            "none. Of the rest of velocity level nothing is asked: it stands in the table alone.",
            f"But under “{SOLID}” and “{MIXED}” the simulation lets limbs go through each other: "
            "only the ground is felt. The last column says how near shanks and feet came; a "
            "negative number is a fall that a real robot might have had.",
        ),
        findings=tuple(_findings(outcomes)),
        tables=(
            Table(
                title="Bad operators, level by level",
                header="robot | level | condition | falls | minutes | feet lifted | "
                "lean, most [rad] | legs apart, least [mm]",
                rows=tuple(_row(group) for group in outcomes),
            ),
        ),
    )


def _is_asked(trial: Trial) -> bool:
    """Whether there is a bound."""
    if trial.level == "torque":
        return True
    return (trial.robot, trial.condition) == ("biped20", DESCRIBED)


def _findings(groups: list[list[Outcome]]) -> list[Finding]:
    return [_finding(group) for group in groups if _is_asked(group[0].trial)]


def _finding(group: list[Outcome]) -> Finding:
    trial, falls = group[0].trial, sum(o.fell for o in group)
    allowed = minutes(group) / FALL_EVERY if trial.level == "torque" else 0.0
    return Finding(
        name=f"{trial.robot}, {trial.level}, {trial.condition}: falls in {len(group)} seeds",
        paper=round(allowed, 2),
        ours=falls,
        ok=falls <= allowed,
        note=f"asked: at most {allowed:.2g}",
    )


def _row(group: list[Outcome]) -> tuple[str | int | float, ...]:
    trial = group[0].trial
    return (
        trial.robot,
        trial.level,
        trial.condition,
        sum(o.fell for o in group),
        minutes(group),
        sum(o.steps for o in group),
        max(o.tilt for o in group),
        1e3 * min(o.apart for o in group),
    )
