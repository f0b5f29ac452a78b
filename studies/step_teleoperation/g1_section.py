"""Scenarios 1 to 3 on G1, with parameters scaled by the stated rules."""

from dataclasses import fields

from poise.apps.teleoperation import SCRIPTS, Script, TeleopRun
from poise.locomotion import Mode, TeleopParameters
from poise.robots import catalog, load_robot
from studies.finding import Finding, Section, Table
from studies.plan import Progress, Steps, StudyOptions
from studies.step_teleoperation.runs import (
    fall_note,
    first,
    least_margin,
    left_undone,
    run_script,
    script_parameters,
)
from studies.step_teleoperation.switch_section import AFTER, lifted_finding


def g1_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    if not any(entry.name == "g1" and entry.installed for entry in catalog()):
        return Section(prose=("G1 is not installed (extra `robots`): nothing was run.",))
    robot = load_robot("g1")
    scripts = [SCRIPTS[name](robot) for name in ("over_an_obstacle", "lift_one_foot")]
    timings = AFTER[: 1 if options.quick else None]
    switches = [SCRIPTS["switch_feet"](robot, after) for after in timings]
    steps = Steps(progress, len(scripts) + len(switches))
    findings: list[Finding] = []
    rows: list[tuple[str | float, ...]] = []
    for script in (*scripts, *switches):
        steps.next()
        run = run_script(robot, script)
        undone = ", ".join(left_undone(robot, run, script))
        if script in switches:
            after = timings[switches.index(script)]
            findings.append(lifted_finding("G1, scenario 3", after, run))
            findings.append(_landing(after, script, run))
        else:
            findings.append(
                Finding(
                    name=f"G1, {script.name}: largest angle of the torso",
                    ours=float(run.log.tilt.max()),
                    unit="rad",
                    ok=not undone,
                    note=undone or "all was done that was led",
                )
            )
        rows.append(
            (script.name, fall_note(run), undone or "nothing", least_margin(run),
             float(run.log.tilt.max()))
        )  # fmt: skip
    steps.finish()
    paper, ours = TeleopParameters(), script_parameters(robot, scripts[1])
    changed = [f.name for f in fields(paper) if getattr(paper, f.name) != getattr(ours, f.name)]
    return Section(
        prose=("Soles of G1 are 0.17 by 0.06 m, a quarter of the paper's in width.",),
        findings=tuple(findings),
        tables=(
            Table(
                title="G1",
                header="scenario | robot | left undone | ZMP to edge, least [mm] | "
                "torso, most [rad]",
                rows=tuple(rows),
            ),
            Table(
                title="Parameters that differ, as scaled for scenario 2",
                header="parameter | biped20 | G1",
                rows=tuple((n, getattr(paper, n), getattr(ours, n)) for n in changed),
            ),
        ),
    )


def _landing(after: float, script: Script, run: TeleopRun) -> Finding:
    """Return the delay of the right foot's touchdown in scenario 3, due before the left lift."""
    down = min(point.at for point in script.points if point.right and point.right[2] < 0.0)
    landed = first(run.log, Mode.D, down)
    late = None if landed is None else landed - down
    return Finding(
        name=f"G1, scenario 3, lift {after:.1f} s after landing: the right foot lands after its "
        "device",
        paper=after,
        ours=late,
        unit="s",
        ok=late is not None and late <= after,
        note="asked: before the left device is lifted. Near the ground a foot is led at "
        "`lower_speed` or less, and a lift that comes before the other foot carries is "
        "not taken: the device has to be lowered and lifted again",
    )
