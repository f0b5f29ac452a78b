"""Hands that are led without a simulator: samples of hands alone, and arms that do as asked."""

import numpy as np

from poise.dynamics import Dynamics, RobotState
from poise.locomotion import HandLeader, OperatorGuard, OperatorSample, TrackedPose

DT = 0.002


def hand(x, y=0.0, z=0.0, clutch=True, **more):
    return TrackedPose.of((x, y, z), clutch, **more)


def both(time, left=None, right=None, rest=False):
    """A sample of hands alone."""
    return OperatorSample(time, hands=(left, right), rest=rest)


class Hand:
    """The left hand of a guard, a tick of which says how far the hand goes."""

    def __init__(self, begin=None, dt=DT):
        self._guard = OperatorGuard(dt=dt)
        if begin is not None:
            self.tick(TrackedPose(begin.position, False, begin.orientation), 0.0)
            self.tick(begin, DT)

    def __getattr__(self, name):
        return getattr(self._guard.hands[0], name)

    def tick(self, part, time):
        self._guard.check(None if part is None else both(time, part), time)
        return self.step


class Follows:
    """A leader of hands whose arms are where they are asked to be."""

    def __init__(self, robot, *, dt=DT, **options):
        self.robot, self.leader, self.dt = robot, HandLeader(robot, dt=dt, **options), dt
        self.time, self.guard = 0.0, OperatorGuard(dt=dt)
        self.index = [7 + robot.joint_index(name) for name in self.leader.task.joints]
        self._dynamics = Dynamics(robot)

    def say(self, left=None, right=None, seconds=None, rest=False):
        for _ in range(round((seconds or self.dt) / self.dt)):
            self.time += self.dt
            state = RobotState(self.q, np.zeros(self.robot.nv), time=self.time)
            self.guard.check(both(self.time, left, right, rest), self.time)
            self.leader.lead(self.guard, state)

    @property
    def q(self):
        q = self.robot.q_home.copy()
        q[self.index] = self.leader.task.target_position
        return q

    def pose(self, side):
        """Place and orientation of a hand in the torso's frame."""
        dynamics, robot = self._dynamics, self.robot
        dynamics.update(RobotState(self.q, np.zeros(robot.nv)))
        frames = (robot.torso, robot.hands[side])
        (o, R), (p, turned) = (dynamics.placement(robot.frame_id(name)) for name in frames)
        return R.T @ (p - o), R.T @ turned
