"""Departures from the paper's rules taken back one by one, and the paper's rules word for word."""

from collections.abc import Mapping
from typing import Any, NamedTuple

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
from studies.step_teleoperation.runs import (
    SOFT,
    STIFF,
    Servos,
    changed,
    constants,
    fall_note,
    left_undone,
    run_script,
    script_parameters,
)
from studies.step_teleoperation.swing_section import swings

_SECONDS, _SEED = 20.0, 4_000_000
"""Of the bad operator; a seed that neither tuning nor the study of the bad operator uses."""

_OURS, _PAPER = "all departures", "none: the paper's rules"

_LEADERS: dict[str, tuple[type[StepTeleoperator], Mapping[str, float]]] = {
    _OURS: (StepTeleoperator, {}),
    _PAPER: (LiteralTeleoperator, AS_MEASURED),
    "the paper's, and the ZMP smoothed": (LiteralTeleoperator, {}),
    "the paper's, and (37) fed the commanded velocity": (CommandedLiteral, AS_MEASURED),
    "likewise, and integrals that restart with each mode": (RestartingLiteral, AS_MEASURED),
}
"""Whoever leads by rules of its own, and its changes, by the name of its row."""

_RUNS = (
    "scenario 1",
    "scenario 2",
    "scenario 3, first timing",
    "scenario 4, forward",
    "bad operator, 20 s",
)


_STOOD = "stood"
"""Table entry of a run in which every command was carried out."""


class _Variant(NamedTuple):
    """A row: rules by their name, who leads by them, changes, and the servos."""

    rules: str
    leader: type[StepTeleoperator]
    changes: Mapping[str, float]
    servos: Servos


def _variants(*, quick: bool) -> list[_Variant]:
    led = [
        _Variant(name, *leader, servos)
        for servos in (SOFT, STIFF)
        for name, leader in _LEADERS.items()
    ]
    back = [
        led[0]._replace(rules=f"without: {d.rule}", changes=d.taken_back)
        for d in DEPARTURES
        if d.taken_back and not quick
    ]
    return [led[0], *back, *led[1:]]


def rules_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    robot = load_robot("biped20")
    variants = _variants(quick=options.quick)
    steps = Steps(progress, len(variants))
    rows: list[tuple[str, ...]] = []
    failed: dict[tuple[str, Servos], int] = {}
    for variant in variants:
        steps.next()
        with constants(variant.changes):
            cells = _runs(robot, variant)
        failed[variant.rules, variant.servos] = sum(cell != _STOOD for cell in cells)
        rows.append((variant.rules, str(variant.servos), *cells))
    steps.finish()
    return Section(
        prose=(
            "Which departures, taken back, let the robot fall. Each row takes one back by its "
            "numbers. Then there are leaders of their own: one with the paper's rules and no "
            "others, and the same with what one may take for theirs: the ZMP smoothed over 10 ms; "
            "in (37) the COM's velocity as commanded, not as measured; and integrals that begin "
            "anew with each mode, for which the paper has “simple time integration”. The second "
            "table lists all departures; without numbers that take them back they go with the "
            "paper's rules only.",
            "The paper takes servos for granted that make the commanded velocities, and gives no "
            "gains. Servos are named by stiffness [1/rad] and damping [s/rad], over the joint's "
            "torque limit: Poise's plant of commanded velocities has the first, the second are "
            "stiff. A foot that gets less than half as high as it is led counts as not lifted.",
        ),
        findings=tuple(
            Finding(name=f"of {len(_RUNS)} runs falls or undone, {rules}, servos {servos}",
                    paper=0, ours=(ours := failed[name, servos]), ok=ours == 0, note=note)
            for name, rules, note in (
                (_OURS, "with all departures", "asked: none"),
                (_PAPER, "the paper's rules taken literally",
                 "the paper's robot does all that it is led through; the table has what is not "
                 "done here"),
            )
            for servos in (SOFT, STIFF)
        ),
        tables=(
            Table(title="What becomes of the robot", rows=tuple(rows),
                  header=" | ".join(("rules", "servos", *_RUNS))),
            Table(title="Departures from the paper", header="rule | in place of | why",
                  rows=tuple((d.rule, d.paper, d.reason) for d in DEPARTURES)),
        ),
    )  # fmt: skip


def _runs(robot: Robot, variant: _Variant) -> list[str]:
    """Outcomes of four scenarios and of the bad operator, as `_RUNS`."""

    def settings(parameters: TeleopParameters) -> dict[str, Any]:
        return changed(parameters, variant.changes, variant.leader)

    cells: list[str] = []
    for script in (
        SCRIPTS["over_an_obstacle"](robot),
        SCRIPTS["lift_one_foot"](robot),
        SCRIPTS["switch_feet"](robot, 0.1),
        (swing := SCRIPTS["swing_fast"](robot, "forward", 2)),
    ):
        parameters = script_parameters(robot, script)
        run = run_script(robot, script, variant.servos, **settings(parameters))
        undone = [] if run.fell else left_undone(robot, run, script)
        if script is swing and not swings(run):
            undone.append("no swing")
        cells.append(", ".join([fall_note(run), *undone]))
    run = run_teleop(
        robot,
        lambda c: BadOperator(c, _SEED),
        variant.servos.at(VELOCITY_TELEOP_PLANT.with_noise()),
        duration=_SECONDS,
        **settings(StepTeleoperator(robot, actuation="velocity").parameters),
    )
    return [*cells, fall_note(run)]
