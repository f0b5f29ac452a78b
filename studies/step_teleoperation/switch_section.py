"""Scenario 3: from one foot to the other, with three timings."""

import numpy as np

from poise.apps.teleoperation import SCRIPTS, TeleopRun
from poise.locomotion import Mode
from poise.robots import load_robot
from studies.finding import Finding, Section, Table, draw
from studies.plan import Progress, Steps, StudyOptions
from studies.step_teleoperation.pictures import films, paint_sideways, snapshots
from studies.step_teleoperation.runs import fall_note, first, least_margin, run_script

AFTER = (0.1, 0.6, 1.1)
"""From the right device's touching the ground to the left one's lift [s]: with the paper's 1.2, 1.7
and 2.2 s, this is where its landing is at 1.1 s, as we read Figure 12."""


def switch_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    robot = load_robot("biped20")
    steps = Steps(progress, len(AFTER))
    runs: list[TeleopRun] = []
    for after in AFTER:
        steps.next()
        runs.append(run_script(robot, SCRIPTS["switch_feet"](robot, after)))
    steps.finish()

    by_title = {f"lift {after:.1f} s later": run for after, run in zip(AFTER, runs, strict=True)}
    figure = draw(
        name="figure-12",
        title="Figure 12: from SL over D and TR to SR",
        caption="The left device is lifted shortly after the right foot has landed, after the ZMP "
        "has reached the middle, and after COM and ZMP have settled there.",
        height=3.8,
        paint=lambda canvas: paint_sideways(canvas, by_title, (2.8, 6.3)),
    )
    pictures, notes = snapshots(
        options,
        "figure-11",
        "Figure 11: switching the support foot",
        "The second timing.",
        [("", runs[1], (2.5, 3.3, 3.9, 4.3, 6.0))],
        azimuth=180.0,
    )
    figures = [_measure(run) for run in runs]
    rows = tuple(
        (after, fall_note(run), first(run.log, Mode.SR, 3.0), *numbers,
         least_margin(run),
         float(run.log.tilt.max()))
        for after, run, numbers in zip(AFTER, runs, figures, strict=True)
    )  # fmt: skip
    findings = tuple(
        lifted_finding("scenario 3", after, run) for after, run in zip(AFTER, runs, strict=True)
    )
    return Section(
        prose=(
            "The right foot is put down, then the left one is lifted, with three times between. "
            "Feet 0.42 m apart, COM 0.765 m high.",
            *notes,
        ),
        findings=findings,
        figures=(*pictures, figure),
        films=films(options, [("scenario-3", "Scenario 3, second timing", runs[1])]),
        tables=(
            Table(
                title="Switching the support foot",
                header="lift after landing [s] | robot | SR at [s] | ZMP overshoot [mm] "
                       "| excursion [mm] | ZMP to edge, least [mm] | torso, most [rad]",
                rows=rows,
                caption="Overshoot: how far the ZMP goes beyond the right foot's centre. Excursion "
                "is how far it first goes the other way, from where it was when TR began.",
            ),
        ),
    )  # fmt: skip


def lifted_finding(name: str, after: float, run: TeleopRun) -> Finding:
    """The left foot's lift, the end of scenario 3.

    Args:
        name: of the scenario.
        after: from the right device's touching the ground to the left one's lift [s].
        run: of the script.
    """
    time = first(run.log, Mode.SR, 3.0)
    return Finding(
        name=f"{name}, lift {after:.1f} s after landing: the left foot is lifted",
        ours=time,
        unit="s",
        ok=not run.fell and time is not None,
        note="“appropriately realized” with all three timings: no fall, mode SR reached",
    )


def _measure(run: TeleopRun) -> tuple[float | None, float | None]:
    """Overshoot and excursion of the ZMP sideways [mm]."""
    log = run.log
    begin, lifted = first(log, Mode.TR, 2.5), first(log, Mode.SR, 2.5)
    if begin is None or lifted is None:
        return None, None
    shift = (log.time >= begin) & (log.time < lifted)
    start = float(log.zmp[shift][0, 1])
    excursion = max(0.0, float(log.zmp[shift][:, 1].max()) - start)
    after = log.time >= lifted
    overshoot = float(np.max(log.zmp_reference[after, 1] - log.zmp[after, 1]))
    return 1e3 * max(0.0, overshoot), 1e3 * excursion
