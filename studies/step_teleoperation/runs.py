"""Running a script, and what the study measures of a run."""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float64
from scipy.spatial import ConvexHull

from poise.apps.teleoperation import VELOCITY_TELEOP_PLANT, Script, TeleopLog, TeleopRun, run_teleop
from poise.locomotion import Mode, StepTeleoperator, TeleopParameters
from poise.robots import Robot
from poise.sim import PlantConfig


class Servos(NamedTuple):
    """Gains of the servos of a plant, over the joint's torque limit."""

    stiffness: float  # [1/rad]
    damping: float  # [s/rad]

    def __str__(self) -> str:
        """As in names: `70/2.5`."""
        return f"{self.stiffness:g}/{self.damping:g}"

    def at(self, plant: PlantConfig) -> PlantConfig:
        """The plant with these servos."""
        servo = PlantConfig.Servo(stiffness=self.stiffness, damping=self.damping)
        return replace(plant, servo=servo)


SOFT = Servos(VELOCITY_TELEOP_PLANT.servo.stiffness, VELOCITY_TELEOP_PLANT.servo.damping)
"""Poise's own: the CoM on one leg of `biped20` is held at 12 rad/s, over a pendulum of 3.6."""

STIFF = Servos(1000.0, 50.0)
"""Near what the paper assumes, velocities as commanded: all the torque where a joint is off by 1
mrad or by 0.02 rad/s. The CoM is held at 46 rad/s."""

SETTLED = 0.3
"""From when on margins count: the robot has come to rest on the ground [s]."""


def run_script(robot: Robot, script: Script, servos: Servos = SOFT, **changes: Any) -> TeleopRun:
    """One script on the plant of teleoperation; `changes` go to `run_teleop`."""
    plant = replace(servos.at(VELOCITY_TELEOP_PLANT), blocks=script.blocks)
    return run_teleop(
        robot,
        script.device,
        plant,
        duration=script.duration,
        q_start=script.posture(robot),
        **changes,
    )


def script_parameters(robot: Robot, script: Script) -> TeleopParameters:
    """The parameters that a run of the script has by itself."""
    return StepTeleoperator(robot, q_start=script.posture(robot), actuation="velocity").parameters


def first(log: TeleopLog, mode: Mode, after: float = 0.0) -> float | None:
    """When a mode was first entered after a time [s]; None for never."""
    times = log.entries(mode)
    times = times[times > after]
    return float(times[0]) if len(times) else None


def edge_distance(robot: Robot, log: TeleopLog) -> Float64[np.ndarray, " T"]:
    """Distance of the ZMP from the edge of the support polygon, negative outside [m].

    Soles are taken to be level and turned as in the world, which is what they are commanded to be.
    """
    halves = [(0.5 * s.length, 0.5 * s.width) for s in list(robot.soles.values())[:2]]
    modes, out = tuple(Mode), np.empty(len(log))
    for i in range(len(log)):
        support = modes[log.mode[i]].support if modes[log.mode[i]].single else None
        feet = (0, 1) if support is None else (support,)
        corners = [
            (float(log.soles[i, f, 0]) + x, float(log.soles[i, f, 1]) + y)
            for f in feet
            for x in (-halves[f][0], halves[f][0])
            for y in (-halves[f][1], halves[f][1])
        ]
        x, y = log.zmp[i]
        # Rows [n, d] of the edges: n is a unit vector outwards, n x + d is negative inside.
        edges = ConvexHull(corners).equations
        out[i] = -(edges @ (x, y, 1.0)).max()
    return out


def least_margin(run: TeleopRun, after: float = SETTLED) -> float:
    """The ZMP's least distance from the edge after a time [s], negative outside [mm]."""
    margin = edge_distance(run.plant.robot, run.log)[run.log.time > after]
    return 1e3 * float(margin.min())


def beyond(robot: Robot, log: TeleopLog, script: Script) -> float:
    """How far the hindmost heel ends ahead of a script's last block; negative for short of it [m].

    Soles and blocks lie along x.
    """
    end = max(block.center[0] + 0.5 * block.size[0] for block in script.blocks)
    halves = [0.5 * sole.length for sole in list(robot.soles.values())[:2]]
    return min(float(log.soles[-1, i, 0]) - half for i, half in enumerate(halves)) - end


_LIFTED = 0.5
"""Share of the commanded height below which a foot counts as not lifted."""


def left_undone(robot: Robot, run: TeleopRun, script: Script) -> list[str]:
    """List commands of the script that a robot has not carried out; empty for none."""
    undone = ["fell"] if run.fell else []
    for i, foot in enumerate(("left", "right")):
        led = [point[2] for at in script.points if (point := getattr(at, foot)) is not None]
        highest = max(led, default=0.0)
        rise = float((run.log.soles[:, i, 2] - run.log.soles[0, i, 2]).max())
        if rise < _LIFTED * highest:
            undone.append(f"{foot} foot not lifted")
    if run.log.touched.any():
        undone.append("touched a block")
    if script.blocks and beyond(robot, run.log, script) <= 0.0:
        undone.append("a foot not beyond the blocks")
    return undone


def fall_note(run: TeleopRun) -> str:
    """What became of the robot, for a table."""
    return f"fell at {run.log.time[-1]:.2f} s" if run.fell else "stood"
