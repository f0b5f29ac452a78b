"""Scenarios 1 to 3 on G1, with parameters scaled by the stated rules."""

from dataclasses import fields

from poise.apps.teleoperation import SCRIPTS
from poise.locomotion import TeleopParameters
from poise.robots import catalog, load_robot
from studies.finding import Finding, Section, Table
from studies.plan import Progress, Steps, StudyOptions
from studies.step_teleoperation.runs import (
    fall_note,
    least_margin,
    left_undone,
    run_script,
    script_parameters,
)
from studies.step_teleoperation.switch_section import AFTER


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
        undone = left_undone(robot, run, script)
        findings.append(
            Finding(
                name=f"G1, {script.name}: largest angle of the torso",
                ours=float(run.log.tilt.max()),
                unit="rad",
                ok=not undone,
                note=", ".join(undone) or "all was done that was led",
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
