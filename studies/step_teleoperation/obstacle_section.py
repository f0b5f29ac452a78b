"""Scenario 1: two steps over two blocks, straight ahead, and to the right as in the paper."""

from typing import Any

from poise.apps.teleoperation import SCRIPTS, Script, TeleopRun
from poise.robots import Robot, load_robot
from studies.finding import Finding, Section, Table, draw, one_legend
from studies.plan import Progress, StudyOptions
from studies.step_teleoperation.pictures import films, paint_zmp, snapshots
from studies.step_teleoperation.runs import (
    beyond,
    fall_note,
    least_margin,
    left_undone,
    run_script,
)

_ASIDE = 0.06
"""How far the right foot goes to the right in the second run [m]; the paper gives no number."""


def obstacle_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    robot = load_robot("biped20")
    script = SCRIPTS["over_an_obstacle"](robot)
    run = run_script(robot, script)
    progress(1.0, 3.0)
    right_forward = SCRIPTS["over_an_obstacle"](robot, _ASIDE)
    as_paper = run_script(robot, right_forward)
    progress(2.0, 3.0)
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
    progress(3.0, 3.0)
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
                    ours=1e3 * ahead, unit="mm", ok=not left_undone(robot, run, script),
                    note="distance of the nearer heel behind the second block at the end"),
            Finding(name="scenario 1: nearest that the robot came to a block",
                    ours=None if run.clearance is None else 1e3 * run.clearance, unit="mm",
                    ok=not run.fell and (run.clearance or 0.0) > 0.0, note="no touch"),
            Finding(name="scenario 1 to the right and forward: both feet beyond both blocks",
                    ours=1e3 * beyond(robot, as_paper.log, right_forward), unit="mm",
                    ok=not left_undone(robot, as_paper, right_forward),
                    note=f"the right foot is sent {1e3 * _ASIDE:.0f} mm to the right; no touch"),
        ),
        tables=(
            Table(
                title="Two ways over the blocks",
                header="the right foot goes | robot | touched a block | right foot to the right "
                "[mm] | highest, right and left foot [mm] | ahead of the blocks [mm] | "
                "torso, most [rad] | ZMP to edge, least [mm]",
                rows=(
                    _row("straight ahead", robot, run, script),
                    _row("to the right and forward, as in the paper", robot, as_paper,
                         right_forward),
                ),
                caption="The paper's torso varies “significantly”. The ZMP passes the polygon's "
                "edge where a foot lifts or lands.",
            ),
        ),
        figures=(*pictures, figure),
        films=films(options, [("scenario-1", "Scenario 1", run)]),
    )  # fmt: skip


def _row(way: str, robot: Robot, run: TeleopRun, script: Script) -> tuple[str | int | float, ...]:
    soles = 1e3 * (run.log.soles - run.log.soles[0])
    heights = " and ".join(f"{soles[:, foot, 2].max():.0f}" for foot in (1, 0))
    return (
        way,
        fall_note(run),
        "yes" if run.log.touched.any() else "no",
        -float(soles[-1, 1, 1]),
        heights,
        1e3 * beyond(robot, run.log, script),
        float(run.log.tilt.max()),
        least_margin(run),
    )
