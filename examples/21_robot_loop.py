"""The loop of a humanoid on a robot's computer: sensors, estimator, leader, controller, drives.

A simulated robot stands in for the hardware: replace what mentions `plant`.
"""

import argparse
import gc
from pathlib import Path
from time import sleep

import numpy as np

import poise
from poise.dynamics import SensorReadings
from poise.estimation import StateEstimator
from poise.locomotion import ScriptedDevice

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--robot", default="biped20", help="a name, or a described URDF or MJCF file")
parser.add_argument("--seconds", type=float, default=1.0, help="of each of the two runs")
parser.add_argument("--record", type=Path, help="a Parquet file for the signals of the first run")
options = parser.parse_args()

robot = poise.load_robot(options.robot)


class Link:
    """Drives and sensors."""

    def __init__(self):
        self.plant = poise.Plant(robot, poise.sim.PlantConfig(control_dt=0.002))

    def clock(self):
        """Return the clock that stamps measurements [s]; on a robot `time.monotonic()`."""
        return self.plant.time

    def read(self):
        """Return the measured state."""
        raw = self.plant.state()
        q, v = robot.q_home.copy(), np.zeros(robot.nv)  # q[:3] and v[:3] are estimated
        q[3:7] = raw.q[3:7]  # world_R_base of the inertial unit, (x, y, z, w)
        v[3:6] = raw.v[3:6]  # angular velocity along the base's axes [rad/s]
        q[7:], v[6:] = raw.q[7:], raw.v[6:]  # in the order of robot.joint_names [rad, rad/s]
        # [force; moment] of the ground on the robot, in the sole's frame at its centre [N, N m]:
        wrenches = {sole: raw.contacts[sole] for sole in robot.soles}  # "left_sole", "right_sole"
        readings = SensorReadings(
            raw.readings.angular_velocity,  # along the unit's axes [rad/s]
            raw.readings.specific_force,  # at rest 9.81 upwards [m/s^2]
            raw.readings.torque,  # of the motors [N m]; np.zeros(0) where nothing measures it
        )
        return poise.RobotState(q, v, wrenches, raw.time, readings)

    def send(self, torque):
        """Send torques [N m] to the drives, in the order of robot.joint_names."""
        self.plant.step(poise.Command(poise.CommandStatus.OK, torque))

    def stop(self, why):
        """Bring the robot to rest, by drives that damp the joints."""
        print("stopped:", why)


def run(link, estimator, controller, leader=None, *, seconds, period=0.002, keep=None):
    """Run the loop; a leader that has a `dt` needs that as the period."""

    def tick():
        estimate = estimator.update(link.read())
        if leader is not None:
            leader.lead(estimate)
        return estimate, controller.step(estimate)

    tick()  # makes what all others use; nothing is sent
    for part in (leader, estimator, controller):
        if hasattr(part, "reset"):
            part.reset()
    gc.collect()
    gc.freeze()
    why, failed, begin = "an error", 0, link.clock()
    due = begin
    try:
        while due < begin + seconds:
            estimate, command = tick()
            link.send(command.torque)
            if hasattr(estimator, "command"):  # one that compensates late sensors
                estimator.command(command.acceleration, due)
            if keep is not None:
                keep(estimate, command)
            failed = 0 if command.status.ok else failed + 1
            if failed > 25 or command.status is poise.CommandStatus.FALLEN:
                why = command.status.value
                break
            due = max(due + period, link.clock())
            sleep(max(0.0, due - link.clock()))
        else:
            why = "the end"
    finally:
        link.stop(why)
        gc.unfreeze()


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
    run(Link(), StateEstimator(robot), controller, seconds=options.seconds, keep=keep)
finally:
    if options.record is not None:
        record.to_pandas().to_parquet(options.record)
print(f"{len(record.times('q'))} ticks, last status {record.notes('status')[-1][1]}")

# Feet by an operator; a device of yours takes the place of the scripted one.
teleoperator = poise.StepTeleoperator(robot)
teleoperator.device = ScriptedDevice([], *teleoperator.estimator.anchors)
controller, estimator = teleoperator.controller(), teleoperator.estimator
run(Link(), estimator, controller, teleoperator, seconds=options.seconds, period=teleoperator.dt)
