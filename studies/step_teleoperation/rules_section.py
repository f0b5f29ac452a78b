"""Departures from the paper's rules taken back one by one, and the paper's rules word for word."""

from dataclasses import replace
from typing import Any

from poise.apps.teleoperation import SCRIPTS, VELOCITY_TELEOP_PLANT, BadOperator, run_teleop
from poise.locomotion import StepTeleoperator, TeleopParameters
from poise.robots import Robot, load_robot
from studies.finding import Finding, Section, Table
from studies.plan import Progress, Steps, StudyOptions
from studies.step_teleoperation.departures import DEPARTURES
from studies.step_teleoperation.literal import (
    AS_MEASURED,
    CommandedLiteral,
    LiteralTeleoperator,
    RestartingLiteral,
)
from studies.step_teleoperation.runs import fall_note, run_script, script_parameters

_SECONDS, _SEED = 20.0, 4_000_000
"""Of the bad operator; a seed that neither tuning nor the study of the bad operator uses."""

_OURS, _PAPER = "all departures", "none: the paper's rules"

_LEADERS: dict[str, type[StepTeleoperator]] = {
    _PAPER: LiteralTeleoperator,
    "the paper's, and (37) fed the commanded velocity": CommandedLiteral,
    "likewise, and integrals that restart with each mode": RestartingLiteral,
}
"""Whoever leads by rules of its own, by the name of its row."""

_RUNS = ("scenario 1", "scenario 2", "scenario 3, first timing", "bad operator, 20 s")


def rules_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    robot = load_robot("biped20")
    variants: dict[str, dict[str, float]] = {_OURS: {}}
    if not options.quick:
        taken_back = [d for d in DEPARTURES if d.taken_back]
        variants |= {f"without: {d.rule}": d.taken_back for d in taken_back}
    variants |= dict.fromkeys(_LEADERS, AS_MEASURED)
    steps = Steps(progress, len(variants))
    rows: list[tuple[str, ...]] = []
    falls: dict[str, int] = {}
    for name, changes in variants.items():
        steps.next()
        cells = _runs(robot, changes, _LEADERS.get(name, StepTeleoperator))
        falls[name] = sum(cell.startswith("fell") for cell in cells)
        rows.append((name, *cells))
    steps.finish()
    ours, paper = falls[_OURS], falls[_PAPER]
    return Section(
        prose=(
            "Which departures, taken back, let the robot fall. Each row takes one back by its "
            "parameters. The last rows are leaders of their own: one with the paper's rules and no "
            "others, and the same with what one may take for theirs: in (37) the COM's velocity as "
            "commanded, not as measured, and integrals that begin anew with each mode, for which "
            "the paper has “simple time integration”. The second table lists all departures; "
            "without parameters that take them back they go with the paper's rules only.",
        ),
        findings=(
            Finding(name=f"falls in {len(_RUNS)} runs with all departures", paper=0, ours=ours,
                    ok=ours == 0, note="asked: none"),
            Finding(name=f"falls in {len(_RUNS)} runs under the paper's rules taken literally",
                    paper=0, ours=paper, ok=paper == 0,
                    note="the paper's robot falls in none; which fall here the table says"),
        ),
        tables=(
            Table(title="What becomes of the robot", rows=tuple(rows),
                  header=" | ".join(("rules", *_RUNS))),
            Table(title="Departures from the paper", header="rule | in place of | why",
                  rows=tuple((d.rule, d.paper, d.reason) for d in DEPARTURES)),
        ),
    )  # fmt: skip


def _runs(robot: Robot, changes: dict[str, float], leader: type[StepTeleoperator]) -> list[str]:
    """What became of the robot in three scenarios and under the bad operator, as `_RUNS`."""

    def settings(parameters: TeleopParameters) -> dict[str, Any]:
        return {"parameters": replace(parameters, **changes), "leader": leader}

    cells: list[str] = []
    for script in (
        SCRIPTS["over_an_obstacle"](robot),
        SCRIPTS["lift_one_foot"](robot),
        SCRIPTS["switch_feet"](robot, 0.1),
    ):
        run = run_script(robot, script, **settings(script_parameters(robot, script)))
        touched = ", touched a block" if run.log.touched.any() else ""
        cells.append(fall_note(run) + touched)
    run = run_teleop(
        robot,
        lambda c: BadOperator(c, _SEED),
        VELOCITY_TELEOP_PLANT.with_noise(),
        duration=_SECONDS,
        **settings(StepTeleoperator(robot, actuation="velocity").parameters),
    )
    return [*cells, fall_note(run)]
