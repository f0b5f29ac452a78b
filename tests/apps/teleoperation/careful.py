"""A careful operator without a browser: whole steps, foot by foot, on any ground."""

from dataclasses import replace

import numpy as np

from poise.apps.teleoperation import MODES, VELOCITY_TELEOP_PLANT, run_teleop
from poise.dynamics import Dynamics, RobotState
from poise.locomotion import ScriptedDevice, WayPoint
from poise.robots import standing_posture

CLEAR = 0.08
"""A foot is carried this far above the higher of where it leaves and where it lands [m]."""


def careful_steps(*steps, press=0.03):
    """Way-points for steps `(foot, x, z)` one after the other, and when they are done.

    A foot is lifted a little, the weight goes over, then up, along, down with a press, release.
    """
    at, points, begin = {"left": (0.0, 0.0), "right": (0.0, 0.0)}, [], 0.5
    for foot, x, z in steps:
        x_0, z_0 = at[foot]
        high = max(z, z_0) + CLEAR
        places = (
            (0.0, x_0, z_0), (0.2, x_0, z_0 + 0.03), (0.9, x_0, z_0 + 0.03), (1.5, x_0, high),
            (2.5, x, high), (2.8, x, high), (3.6, x, z - press), (4.0, x, z - press), (4.2, x, z),
        )  # fmt: skip
        points += [WayPoint(at=begin + t, **{foot: (px, 0.0, pz)}) for t, px, pz in places]
        at[foot], begin = (x, z), begin + 4.4
    return points, begin


def walk_over(
    robot, steps, blocks, *, plant=VELOCITY_TELEOP_PLANT, rest=1.0, press=0.03, **options
):
    """Steps over blocks, with knees bent a little as a live run has them."""
    points, end = careful_steps(*steps, press=press)
    dynamics = Dynamics(robot)
    dynamics.update(RobotState(robot.q_home, np.zeros(robot.nv)))
    return run_teleop(
        robot,
        lambda c: ScriptedDevice(points, *c.estimator.anchors),
        replace(plant, blocks=tuple(blocks)),
        duration=end + rest,
        q_start=standing_posture(robot, com_height=0.94 * float(dynamics.com[2])),
        **options,
    )


def trace(run):
    """Modes with their times, for whoever reads a failed test."""
    log = run.log
    changes = np.flatnonzero(np.diff(log.mode, prepend=-1))
    modes = " ".join(f"{log.time[i]:.2f} {MODES[log.mode[i]].name}" for i in changes)
    return f"{modes}; end {log.time[-1]:.2f}, tilt {log.tilt[-1]:.2f} rad, fell {run.fell}"


def true_soles(run):
    """Where the soles are at the end [m]."""
    robot, data = run.plant.robot, run.plant.data
    return [data.site(name).xpos.copy() for name in list(robot.soles)[:2]]
