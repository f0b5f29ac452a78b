"""Departures from the paper's rules taken back one by one, and the paper's rules word for word."""

from dataclasses import replace
from typing import Any

from poise.apps.teleoperation import SCRIPTS, TELEOP_PLANT, BadOperator, run_teleop
from poise.locomotion import StepTeleoperator, TeleopParameters
from poise.robots import Robot, load_robot
from studies.finding import Finding, Section, Table
from studies.plan import Progress, Steps, StudyOptions
from studies.step_teleoperation.literal import LiteralTeleoperator
from studies.step_teleoperation.runs import fall_note, run_script, script_parameters

_SECONDS, _SEED = 20.0, 4_000_000
"""Of the bad operator; a seed that neither tuning nor the study of the bad operator uses."""

_OURS, _PAPER = "all departures", "none: the paper's rules"

_NONE, _ANY = 1e-9, 1e3
"""Parameters that take a rule's effect away: nothing of it, or as much as one likes."""

_TAKEN_BACK: dict[str, dict[str, float]] = {
    "other foot held firmly in double support": {"w_S2": 100.0},
    "swing foot firm and straight up near the ground": {"clear_height": _NONE},
    "angular momentum that leaks": {"momentum_leak": _NONE},
    "torso heavier the further it leans": {"tilt_soft": _ANY},
    "COM above the foot that shall carry": {
        "capture_max": _ANY, "ct_zmp_max": _ANY, "shift_time": _NONE,
    },
    "COM velocity that leaks into the measured one": {"velocity_leak": _NONE},
    "stance sole turned back to level": {"k_level": _NONE},
    "foot without load pressed down": {"press_speed": _NONE},
    "COM that comes down for the legs to reach": {"stoop_max": _NONE},
    "gentle height of COM and foot": {
        "lift_speed": 1.0, "lift_acceleration": _ANY, "lower_speed": 1.0, "touch_speed": 1.0,
    },
    "smoothed swing": {"swing_time": _NONE},
}  # fmt: skip
"""Departures that a parameter takes back by itself; the others go with the paper's rules only."""


def rules_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    robot = load_robot("biped20")
    variants: dict[str, dict[str, float]] = {_OURS: {}}
    if not options.quick:
        variants |= {f"without: {name}": changes for name, changes in _TAKEN_BACK.items()}
    variants[_PAPER] = {}
    steps = Steps(progress, len(variants))
    rows: list[tuple[str, ...]] = []
    falls: dict[str, int] = {}
    for name, changes in variants.items():
        steps.next()
        leader = LiteralTeleoperator if name == _PAPER else StepTeleoperator
        cells = _three_runs(robot, changes, leader)
        falls[name] = sum(cell.startswith("fell") for cell in cells)
        rows.append((name, *cells))
    steps.finish()
    ours, paper = falls[_OURS], falls[_PAPER]
    return Section(
        prose=(
            "Which departures, taken back, let the robot fall. Each row takes one back by its "
            "parameters; the last is a leader of its own with the paper's rules and no others.",
        ),
        findings=(
            Finding(name="falls in three runs with all departures", ours=ours,
                    ok=ours == 0, note="asked: none"),
            Finding(name="falls in three runs under the paper's rules taken literally",
                    ours=paper, ok=paper > 0,
                    note="asked: that the study shows where they fail"),
        ),
        tables=(
            Table(title="Departures", rows=tuple(rows),
                  header="rules | scenario 1 | scenario 3, first timing | bad operator, 20 s"),
        ),
    )  # fmt: skip


def _three_runs(
    robot: Robot, changes: dict[str, float], leader: type[StepTeleoperator]
) -> list[str]:
    """What became of the robot in two scenarios and under the bad operator."""

    def settings(parameters: TeleopParameters) -> dict[str, Any]:
        return {"parameters": replace(parameters, **changes), "leader": leader}

    cells: list[str] = []
    for script in (SCRIPTS["over_an_obstacle"](robot), SCRIPTS["switch_feet"](robot, 0.1)):
        run = run_script(robot, script, **settings(script_parameters(robot, script)))
        touched = ", touched a block" if run.log.touched.any() else ""
        cells.append(fall_note(run) + touched)
    run = run_teleop(
        robot,
        lambda c: BadOperator(c, _SEED),
        TELEOP_PLANT.with_noise(),
        duration=_SECONDS,
        **settings(StepTeleoperator(robot).parameters),
    )
    return [*cells, fall_note(run)]
