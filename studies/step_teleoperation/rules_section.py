"""Each departure from the paper's rules taken back by itself, and all of them."""

from dataclasses import fields, replace

from poise.apps.teleoperation import noisy, over_an_obstacle, run_teleop, switch_feet
from poise.locomotion import PAPER_RULES, Rules
from poise.robots import load_robot
from studies.bad_operator.operator import BadOperator
from studies.finding import Finding, Section, Table
from studies.plan import Progress, Steps, StudyOptions
from studies.step_teleoperation.runs import fall_note, run_script

_SECONDS, _SEED = 20.0, 4_000_000
"""Of the bad operator; a seed that neither tuning nor the study of the bad operator uses."""


def rules_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    robot = load_robot("biped20")
    names = [f.name for f in fields(Rules)]
    variants = {"all departures": Rules()}
    if not options.quick:
        variants |= {f"without `{name}`": replace(Rules(), **{name: False}) for name in names}
    variants["none: the paper's rules"] = PAPER_RULES
    scripts = (over_an_obstacle(robot), switch_feet(robot, 0.1))
    steps = Steps(progress, len(variants))
    rows: list[tuple[str, ...]] = []
    falls: dict[str, int] = {}
    for name, rules in variants.items():
        steps.next()
        cells: list[str] = []
        for script in scripts:
            run = run_script(robot, script, rules=rules)
            touched = ", touched a block" if run.log.touched.any() else ""
            cells.append(fall_note(run) + touched)
        run = run_teleop(
            robot, lambda c: BadOperator(c, _SEED), noisy(), duration=_SECONDS, rules=rules
        )
        cells.append(fall_note(run))
        falls[name] = sum(cell.startswith("fell") for cell in cells)
        rows.append((name, *cells))
    steps.finish()
    ours, paper = falls["all departures"], falls["none: the paper's rules"]
    return Section(
        prose=("Which departures, taken back, let the robot fall.",),
        findings=(
            Finding(name="falls in three runs with all departures", paper=None, ours=ours, unit="",
                    ok=ours == 0, note="asked: none"),
            Finding(name="falls in three runs under the paper's rules taken literally", paper=None,
                    ours=paper, unit="", ok=paper > 0,
                    note="asked: that the study shows where they fail"),
        ),
        tables=(
            Table(title="Departures", header=("rules", "scenario 1", "scenario 3, first timing",
                                              "bad operator, 20 s"),
                  rows=tuple(rows)),
        ),
    )  # fmt: skip
