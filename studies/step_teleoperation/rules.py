"""`rules_section`: the paper's rules word for word, and Poise's, in its scenarios."""

from contextlib import nullcontext

from poise.apps.teleoperation import SCRIPTS, VELOCITY_TELEOP_PLANT, BadOperator, run_teleop
from poise.locomotion import StepTeleoperator
from poise.robots import Robot, load_robot
from studies.finding import Finding, Section, Table
from studies.plan import Progress, Steps, StudyOptions
from studies.step_teleoperation.literal import LiteralTeleoperator, zmp_as_measured
from studies.step_teleoperation.runs import (
    SOFT,
    STIFF,
    Servos,
    fall_note,
    left_undone,
    run_script,
)
from studies.step_teleoperation.scenarios import swings

_SECONDS, _SEED = 20.0, 4_000_000
"""Of the bad operator; a seed that neither tuning nor the study of bad operators uses."""

_OURS, _PAPER = "all departures", "none: the paper's rules"
_LEADERS = {
    _OURS: (StepTeleoperator, nullcontext),
    _PAPER: (LiteralTeleoperator, zmp_as_measured),
    "the paper's, and the ZMP smoothed": (LiteralTeleoperator, nullcontext),
}
"""Leader and setting, by the name of a row."""

_RUNS = (
    "scenario 1",
    "scenario 2",
    "scenario 3, first timing",
    "scenario 4, forward",
    "bad operator, 20 s",
)

_STOOD = "stood"
"""Table entry of a run in which every command was carried out."""


def rules_section(_options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    robot = load_robot("biped20")
    steps = Steps(progress, 2 * len(_LEADERS))
    rows: list[tuple[str, ...]] = []
    failed: dict[tuple[str, Servos], int] = {}
    for servos in (SOFT, STIFF):
        for name, (leader, setting) in _LEADERS.items():
            steps.next()
            with setting():
                cells = _runs(robot, servos, leader)
            failed[name, servos] = sum(cell != _STOOD for cell in cells)
            rows.append((name, str(servos), *cells))
    steps.finish()
    return Section(
        prose=(
            "Poise's rules, and a leader with the paper's rules and no others, which has the ZMP "
            "as measured, and once smoothed over 10 ms. The paper takes servos for granted that "
            "make the commanded velocities, and gives no gains. Servos are named by stiffness "
            "[1/rad] and damping [s/rad], over the joint's torque limit: the first are Poise's, "
            "the second are stiff. A foot that gets less than half as high as it is led counts as "
            "not lifted.",
        ),
        findings=tuple(
            Finding(
                name=f"of {len(_RUNS)} runs falls or undone, {rules}, servos {servos}",
                paper=0,
                ours=failed[name, servos],
                ok=failed[name, servos] == 0,
                note=note,
            )
            for name, rules, note in (
                (_OURS, "with all departures", "asked: none"),
                (
                    _PAPER,
                    "the paper's rules taken literally",
                    "the paper's robot does all that it is led through",
                ),
            )
            for servos in (SOFT, STIFF)
        ),
        tables=(
            Table(
                title="What becomes of the robot",
                rows=tuple(rows),
                header=" | ".join(("rules", "servos", *_RUNS)),
            ),
        ),
    )


def _runs(robot: Robot, servos: Servos, leader: type[StepTeleoperator]) -> list[str]:
    """Outcomes of four scenarios and of the bad operator, as `_RUNS`."""
    cells: list[str] = []
    for script in (
        SCRIPTS["over_an_obstacle"](robot),
        SCRIPTS["lift_one_foot"](robot),
        SCRIPTS["switch_feet"](robot, 0.1),
        (swing := SCRIPTS["swing_fast"](robot, "forward", 2)),
    ):
        run = run_script(robot, script, servos, leader=leader)
        undone = [] if run.fell else left_undone(robot, run, script)
        if script is swing and not swings(run):
            undone.append("no swing")
        cells.append(", ".join([fall_note(run), *undone]))
    run = run_teleop(
        robot,
        lambda teleoperator: BadOperator(teleoperator, _SEED),
        servos.at(VELOCITY_TELEOP_PLANT.with_noise()),
        duration=_SECONDS,
        leader=leader,
    )
    return [*cells, fall_note(run)]
