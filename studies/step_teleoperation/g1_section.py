"""Scenarios 1 to 3 on G1, with parameters scaled by the stated rules."""

from dataclasses import fields

from poise.apps.teleoperation import SCRIPTS
from poise.locomotion import Mode, TeleopParameters
from poise.robots import catalog, load_robot
from studies.finding import Finding, Section, Table
from studies.plan import Progress, Steps, StudyOptions
from studies.step_teleoperation.runs import (
    beyond,
    fall_note,
    first,
    least_margin,
    run_script,
    script_parameters,
)
from studies.step_teleoperation.switch_section import AFTER

_LIFTED = {"right": Mode.SL, "left": Mode.SR}
"""A foot, and the mode in which it is in the air."""


def g1_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    if not any(entry.name == "g1" and entry.installed for entry in catalog()):
        return Section(prose=("G1 is not installed (extra `robots`): nothing was run.",))
    robot = load_robot("g1")
    scripts = [SCRIPTS[name](robot) for name in ("over_an_obstacle", "lift_one_foot")]
    scripts += [
        SCRIPTS["switch_feet"](robot, after) for after in AFTER[: 1 if options.quick else None]
    ]
    steps = Steps(progress, len(scripts))
    findings, rows = [], []
    for script in scripts:
        steps.next()
        run = run_script(robot, script)
        touched = bool(run.log.touched.any())
        lifted = [name for name, mode in _LIFTED.items() if first(run.log, mode) is not None]
        wanted = list(_LIFTED)[: 1 if script.name == "scenario 2" else 2]
        done = not run.fell and not touched and lifted == wanted
        asked = ["no fall", *(f"{foot} foot in the air" for foot in wanted)]
        if script.blocks:
            ahead = 1e3 * beyond(robot, run.log, script)
            done = done and ahead > 0.0
            asked += ["no touch", f"both feet beyond the blocks, which they are by {ahead:.0f} mm"]
        findings.append(
            Finding(
                name=f"G1, {script.name}: largest angle of the torso",
                ours=float(run.log.tilt.max()),
                unit="rad",
                ok=done,
                note="asked: " + ", ".join(asked),
            )
        )
        rows.append((script.name, fall_note(run), "yes" if touched else "no", least_margin(run)))
    steps.finish()
    paper, ours = TeleopParameters(), script_parameters(robot, scripts[1])
    changed = [f.name for f in fields(paper) if getattr(paper, f.name) != getattr(ours, f.name)]
    return Section(
        prose=("Soles of G1 are 0.17 by 0.06 m, a quarter of the paper's in width.",),
        findings=tuple(findings),
        tables=(
            Table(
                title="G1",
                header="scenario | robot | touched a block | ZMP to edge, least [mm]",
                rows=tuple(rows),
            ),
            Table(
                title="Parameters that differ, as scaled for scenario 2",
                header="parameter | biped20 | G1",
                rows=tuple((n, getattr(paper, n), getattr(ours, n)) for n in changed),
            ),
        ),
    )
