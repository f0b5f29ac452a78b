"""The paper's scenarios 1 to 4 at torque level, robot by robot."""

from dataclasses import replace

import numpy as np

from poise.apps.teleoperation import SCRIPTS, TORQUE_TELEOP_PLANT, TeleopRun, run_teleop
from poise.locomotion import Mode
from poise.robots import Robot, load_robot
from studies.finding import Finding, Section, Table
from studies.plan import Progress, StudyOptions

ROBOTS = ("biped20", "humanoid33", "g1", "talos")

TRUNK = 0.35
"""How far the trunk may lean [rad]."""


def scenarios_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    robots = ROBOTS[:2] if options.quick else ROBOTS
    findings: list[Finding] = []
    rows: list[tuple[str | float, ...]] = []
    jobs = [(robot, script) for robot in robots for script in SCRIPTS]
    for k, (name, script) in enumerate(jobs):
        run = _run(load_robot(name), script)
        tilt = float(run.log.tilt.max())
        ok = not run.fell and tilt <= TRUNK
        findings.append(
            Finding(
                name=f"{script} on {name}: largest lean of the trunk",
                paper=TRUNK,
                ours=tilt,
                unit="rad",
                ok=ok,
                note="the robot fell" if run.fell else "no fall",
            )
        )
        rows.append((name, script, "yes" if run.fell else "no", tilt, *_zmp(run)))
        progress(k + 1.0, float(len(jobs)))
    return Section(
        prose=(
            "The bound is on the lean of the trunk, and a fall fails it. The error of the ZMP is "
            "that of the measured one while one foot stands, half a second after its mode began.",
        ),
        findings=tuple(findings),
        tables=(
            Table(
                title="Scenarios",
                header="robot | scenario | fell | lean [rad] | ZMP off, median [m] | most [m]",
                rows=tuple(rows),
            ),
        ),
    )


def _run(robot: Robot, script: str) -> TeleopRun:
    made = SCRIPTS[script](robot)
    return run_teleop(
        robot,
        made.device,
        replace(TORQUE_TELEOP_PLANT.with_noise(), blocks=made.blocks),
        duration=made.duration,
        q_start=made.posture(robot),
    )


def _zmp(run: TeleopRun) -> tuple[float, float]:
    """Median and largest distance of the ZMP from its reference on one settled foot [m]."""
    log = run.log
    single = log.when(Mode.SL) | log.when(Mode.SR)
    settled = single.copy()
    for mode in (Mode.SL, Mode.SR):
        for entry in log.entries(mode):
            settled &= ~((log.time >= entry) & (log.time < entry + 0.5))
    if not settled.any():
        return np.nan, np.nan
    error = np.linalg.norm(log.zmp - log.zmp_reference, axis=1)[settled]
    return float(np.median(error)), float(error.max())
