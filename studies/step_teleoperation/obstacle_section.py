"""Scenario 1: two steps over an obstacle of two blocks."""

from typing import Any

from poise.apps.teleoperation import SCRIPTS
from poise.robots import load_robot
from studies.finding import Finding, Section, draw, one_legend
from studies.plan import Progress, StudyOptions
from studies.step_teleoperation.pictures import films, paint_zmp, snapshots
from studies.step_teleoperation.runs import beyond, least_margin, run_script


def obstacle_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    robot = load_robot("biped20")
    script = SCRIPTS["over_an_obstacle"](robot)
    run = run_script(robot, script)
    progress(1.0, 2.0)
    log = run.log
    ahead = beyond(robot, log, script)

    def paint(canvas: Any) -> None:
        panels = canvas.subplots(2, 1, sharex=True)
        for axis, panel in enumerate(panels):
            paint_zmp(panel, robot, log, axis)
        panels[1].set_xlabel("time [s]")
        one_legend(canvas, panels[0])

    figure = draw(
        name="figure-8",
        title="Figure 8: ZMP and COM over the obstacle",
        caption="The ZMP first moves the other way when its reference jumps, then converges. "
        "Letters are modes.",
        height=5.0,
        paint=paint,
    )
    pictures, notes = snapshots(
        options,
        "figure-7",
        "Figure 7: two steps over two blocks",
        "Red balls are the devices.",
        [("", run, (0.5, 2.5, 4.0, 6.5, 9.0, 10.5, 13.5))],
    )
    progress(2.0, 2.0)
    stood = not run.fell
    return Section(
        prose=(
            "Right foot, then left foot over two blocks, 5 and 8 cm high, right across the way. "
            "The paper does not give the blocks; a foot of 0.30 m has to land beyond both, which "
            "makes a step of 0.43 m. The feet begin 0.27 m apart, where legs reach farthest; the "
            "COM comes down where they have to (rule `stooping`).",
            *notes,
        ),
        findings=(
            Finding(name="scenario 1: both feet beyond both blocks",
                    ours=1e3 * ahead, unit="mm", ok=stood and ahead > 0.0,
                    note="distance of the nearer heel behind the second block at the end"),
            Finding(name="scenario 1: nearest that the robot came to a block",
                    ours=None if run.clearance is None else 1e3 * run.clearance, unit="mm",
                    ok=not log.touched.any() and stood and (run.clearance or 0.0) > 0.0,
                    note="no touch"),
            Finding(name="scenario 1: largest angle of the torso",
                    ours=float(log.tilt.max()), unit="rad", ok=stood,
                    note="the paper's torso varies “significantly”; ours by this much"),
            Finding(name="scenario 1: smallest distance of the ZMP from the polygon's edge",
                    ours=least_margin(run), unit="mm", ok=stood,
                    note="zero is on the edge: a foot that lifts or lands passes it"),
        ),
        figures=(*pictures, figure),
        films=films(options, [("scenario-1", "Scenario 1", run)]),
    )  # fmt: skip
