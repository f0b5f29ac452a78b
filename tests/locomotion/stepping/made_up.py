"""A robot that stays where it is put, whatever its step teleoperator commands."""

import numpy as np
from walker import sample

from poise.dynamics import Dynamics, RobotState
from poise.locomotion import DeviceStatus, StepTeleoperator

DT = 0.002


class MadeUp:
    """States and devices by hand, where torques are commanded.

    Attributes:
        q: configuration.
        loads: of the left and of the right sole, over the weight.
        up: height of the left and of the right device over the place of its foot [m]; None for no
            device.
        ahead, aside: of the right device from the place of its foot, forward and left [m].
    """

    def __init__(self, robot):
        self.robot, self.teleoperator = robot, StepTeleoperator(robot)
        self.q, self.loads, self.up, self.time = robot.q_home.copy(), (0.5, 0.5), (0.0, 0.0), 0.0
        self.ahead = self.aside = 0.0
        self.teleoperator.device = self

    def sample(self, time):
        if self.up is None:
            return None
        (left, right), (up_left, up_right) = self.teleoperator.estimator.anchors, self.up
        right = right + np.array([self.ahead, self.aside, up_right])
        return sample(time, left + np.array([0.0, 0.0, up_left]), right)

    def turn(self, joint, angle):
        """Turn a joint [rad]."""
        self.q[self.robot.nq - self.robot.nj + self.robot.joint_index(joint)] += angle

    def tick(self):
        robot, teleoperator = self.robot, self.teleoperator
        wrenches = {
            sole: np.array([0.0, 0.0, load * robot.weight, 0.0, 0.0, 0.0])
            for sole, load in zip(teleoperator.soles, self.loads, strict=True)
        }
        measured = RobotState(self.q.copy(), np.zeros(robot.nv), wrenches, self.time)
        teleoperator.lead(teleoperator.estimator.update(measured))
        for contact in teleoperator.stack.contacts:
            contact.advance(self.time)
        self.time += DT

    def until(self, time):
        while self.time < time - 0.5 * DT:
            self.tick()

    def stand_again(self):
        """Land, and go on until the operator leads again."""
        self.until(self.time + 0.5)
        self.loads = (0.5, 0.5)
        while self.overruled:
            self.tick()
            assert self.time < 5.0

    @property
    def mode(self):
        return self.teleoperator.mode

    @property
    def overruled(self):
        return self.teleoperator.status.device is DeviceStatus.OVERRULED


def leaning(robot, foot, inwards=0.0):
    """Return a configuration whose CoM is over a sole, so far inwards of its middle [m].

    Both soles lie as they do at home: hips and ankles turn.
    """
    dynamics, first = Dynamics(robot), robot.nq - robot.nj
    goal = np.array([0.0, -inwards if foot == 0 else inwards])

    def turned(angles):
        q = robot.q_home.copy()
        for side in ("left", "right"):
            for axis, angle in zip(("pitch", "roll"), angles, strict=True):
                q[first + robot.joint_index(f"{side}_hip_{axis}_joint")] += angle
                q[first + robot.joint_index(f"{side}_ankle_{axis}_joint")] -= angle
        return q

    def miss(angles):
        dynamics.update(RobotState(turned(angles), np.zeros(robot.nv)))
        place, _ = dynamics.placement(robot.frame_id(list(robot.soles)[foot]))
        return (dynamics.com - place)[:2] - goal

    angles, step = np.zeros(2), 1e-6
    for _ in range(20):
        slopes = [
            (miss(angles + way) - miss(angles - way)) / (2.0 * step) for way in step * np.eye(2)
        ]
        angles = angles - np.linalg.solve(np.column_stack(slopes), miss(angles))
    assert np.abs(miss(angles)).max() < 1e-9
    return turned(angles)
