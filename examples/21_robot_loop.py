"""The loop of a humanoid on a robot's computer: sensors, estimator, leader, controller, drives.

A simulated robot stands in for the hardware: another link takes the place of `PlantLink`.
"""

import argparse
import gc
from pathlib import Path
from time import sleep

import numpy as np

import poise
from poise.estimation import StateEstimator
from poise.hardware import Action, LastCheck, PlantLink, TorqueSplit, Watchdog, robot_state
from poise.locomotion import ScriptedDevice

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--robot", default="biped20", help="a name, or a described URDF or MJCF file")
parser.add_argument("--seconds", type=float, default=1.0, help="of each of the two runs")
parser.add_argument("--record", type=Path, help="a Parquet file for the signals of the first run")
options = parser.parse_args()

robot = poise.load_robot(options.robot)

# Full torque at an error of 1 rad, or at the velocity limit, is the most that drives may add.
kp_max, kd_max = robot.tau_max, robot.tau_max / robot.v_max
check = LastCheck(robot, kp_max=kp_max, kd_max=kd_max)


def connect():
    """Connect to the robot."""
    return PlantLink(poise.Plant(robot, poise.sim.PlantConfig(control_dt=0.002)), check)


def run(link, estimator, controller, leader=None, *, seconds, keep=None):
    """Run the loop; a leader that has a `dt` needs that as the link's period."""
    period = 1.0 / link.info.rate
    split = TorqueSplit(check, kp=0.1 * kp_max, kd=0.1 * kd_max, period=period)
    watchdog = Watchdog(robot, period=period)

    def tick(measured, hold=False):
        estimate = estimator.update(robot_state(robot, link.info, measured))
        if leader is not None and not hold:
            leader.lead(estimate)
        return estimate, controller.step(estimate)

    _, command = tick(link.read())  # makes what all others use; nothing is sent
    for part in (leader, estimator, controller):
        if hasattr(part, "reset"):
            part.reset()
    gc.collect()
    gc.freeze()
    why, begin = "an error", link.clock()
    due = begin
    try:
        while due < begin + seconds:
            measured = link.read()
            verdict = watchdog.evaluate(link, measured, command)
            if verdict.response >= Action.DAMP:
                why = verdict.reason
                break
            estimate, command = tick(measured, verdict.response is Action.HOLD)
            link.write(split.split(command, measured))
            if hasattr(estimator, "command"):  # one that compensates late sensors
                estimator.command(command.acceleration, due)
            if keep is not None:
                keep(estimate, command)
            due = max(due + period, link.clock())
            sleep(max(0.0, due - link.clock()))
        else:
            why = "the end"
    finally:
        link.close()  # damps
        gc.unfreeze()
    print("stopped:", why)


record = poise.sim.RunRecord(joints=robot.joint_names)


def keep(estimate, command):
    """Record the signals of a tick."""
    residuals = np.full(2 + len(controller.stack.levels), np.nan)  # a fallback has none
    residuals[: len(command.residuals)] = command.residuals
    samples = {"q": estimate.q, "v": estimate.v, "torque": command.torque, "residuals": residuals}
    samples |= {f"wrench/{sole}": wrench for sole, wrench in estimate.contacts.items()}
    record.add(estimate.time, samples)
    record.note(estimate.time, "status", command.status.value)


# Tasks of a stack: a leader of yours sets their targets; without one they hold.
controller = poise.WholeBodyController(robot)
try:
    run(connect(), StateEstimator(robot), controller, seconds=options.seconds, keep=keep)
finally:
    if options.record is not None:
        record.to_pandas().to_parquet(options.record)
print(f"{len(record.times('q'))} ticks, last status {record.notes('status')[-1][1]}")

# Feet by an operator; a device of yours takes the place of the scripted one.
teleoperator = poise.StepTeleoperator(robot)
teleoperator.device = ScriptedDevice([], *teleoperator.estimator.anchors)
controller, estimator = teleoperator.controller(), teleoperator.estimator
run(connect(), estimator, controller, teleoperator, seconds=options.seconds)
