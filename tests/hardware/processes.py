"""Links and controllers that run in processes of their own, for the tests beside."""

import math
import struct
import time
from functools import partial

import numpy as np
from links import JOINTS, LIMITS, command, state

import poise
from poise.estimation import StateEstimator
from poise.hardware import (
    LastCheck,
    LinkInfo,
    LinkStatus,
    PlantLink,
    ProcessLink,
    TorqueSplit,
    robot_state,
)

LINE = struct.Struct("5d")
"""Time, largest stiffness, shares of torque and velocity limits, and the sum of all numbers."""


class Leg:
    """Three joints, each an inertia of 1 kg m^2 with ideal drives; writes down its commands."""

    refused, reason = 0, ""

    def __init__(self, log=None, fails_at=math.inf, joints=JOINTS):
        self.info = LinkInfo(name="leg", rate=500.0, joints=joints)
        self.status = LinkStatus.OK
        self.log = None if log is None else open(log, "ab", buffering=0)  # noqa: SIM115
        self.begin, self.fails_at = time.monotonic(), fails_at
        self.q, self.dq, self.tau, self.ticks = (
            np.array([0.0, 1.0, 0.0]),
            np.zeros(3),
            np.zeros(3),
            0,
        )

    def clock(self):
        return time.monotonic()

    def read(self):
        if time.monotonic() - self.begin > self.fails_at:
            raise OSError("the cable is out")
        return state(0.002 * self.ticks, self.q, self.dq, time.monotonic(), tau=self.tau)

    def write(self, given):
        self.tau = given.torque(self.q, self.dq)
        self.dq = self.dq + 0.002 * self.tau
        self.q, self.ticks = self.q + 0.002 * self.dq, self.ticks + 1
        if self.log is not None:
            write_line(self.log, given, self.tau / LIMITS.tau_max, self.dq / LIMITS.v_max)

    def close(self):
        self.status = LinkStatus.LOST


def write_line(log, given, torque, speed):
    numbers = np.concatenate([given.q, given.dq, given.kp, given.kd, given.tau, torque, speed])
    largest = given.kp.max(), np.abs(torque).max(), np.abs(speed).max()
    log.write(LINE.pack(time.monotonic(), *largest, numbers.sum()))


def commands_of(log):
    """Lines of a log, as an array."""
    with open(log, "rb") as file:
        whole = file.read()
        return np.array(list(LINE.iter_unpack(whole[: len(whole) // LINE.size * LINE.size])))


def swing(make, check, ready, priority=None):
    """A controller's process: swing all joints until it is killed."""
    link = ProcessLink(make, check, linger=1.0, priority=priority)
    ready.send(link.pid)
    begin = link.clock()
    while True:
        wave = 0.2 * math.sin(10.0 * (link.clock() - begin))
        q = np.array([wave, 1.0 + wave, wave])
        link.write(command(q=q, tau=np.zeros(3)))
        time.sleep(0.002)


class Hanging(PlantLink):
    """A plant that stands still until the first torque, as a robot on its ropes."""

    log, hangs = None, True

    def write(self, command):
        self.hangs = self.hangs and not command.tau.any()
        if self.hangs:
            return
        super().write(command)
        state, robot = self.read(), self._plant.robot
        write_line(self.log, command, state.tau / robot.tau_max, state.dq / robot.v_max)


def hang(name, log):
    """Make a link to a plant."""
    robot = poise.load_robot(name)
    link = Hanging(poise.Plant(robot, poise.sim.PlantConfig(control_dt=0.002)), check_of(robot))
    link.log = open(log, "ab", buffering=0)  # noqa: SIM115
    return link


def check_of(robot):
    return LastCheck(robot, kp_max=100.0, kd_max=50.0)


def sway(name, log, ready, priority=None):
    """A controller's process: sway a robot until it is killed."""
    robot = poise.load_robot(name)
    check, soles = check_of(robot), tuple(robot.soles)
    controller, estimator = poise.WholeBodyController(robot), StateEstimator(robot)
    com = next(t for _, t in controller.stack.tasks() if isinstance(t, poise.ComTask))
    home, split = poise.Dynamics(robot).com.copy(), TorqueSplit(check, kp=20.0, kd=1.0)
    link = ProcessLink(partial(hang, name, log), check, soles=soles, priority=priority)
    controller.step(estimator.update(robot_state(robot, link.info, link.read())))
    for part in (controller, estimator):
        part.reset()
    ready.send(link.pid)
    begin, last = link.clock(), math.nan
    while True:
        measured = link.read()
        if measured.time != last:
            last = measured.time
            com.set_target(home + [0.0, 0.03 * math.sin(5.0 * (link.clock() - begin)), 0.0])
            command = controller.step(estimator.update(robot_state(robot, link.info, measured)))
            sent = split.split(command, measured)
            link.write(sent)
        elif last == 0.0:
            link.write(sent)  # It hangs still.
        time.sleep(0.0002)
