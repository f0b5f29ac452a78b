"""Hands that are led without a simulator: samples of hands alone, and arms that do as asked."""

import numpy as np

from poise.dynamics import Dynamics, RobotState
from poise.locomotion import HandLeader, OperatorGuard, OperatorSample
from poise.locomotion._stepping._guard import Tracker
from poise.locomotion._stepping._limbs import Goal

DT = 0.002


def both(time, left=None, right=None, rest=False):
    """A sample of hands alone."""
    return OperatorSample(time, hands=(left, right), rest=rest)


class Hand(Tracker):
    """A tracker of a hand, a tick of which says how far the hand goes."""

    def __init__(self):
        super().__init__(DT)

    def tick(self, sample, time):
        self.update(sample, time)
        return self.step


class Follows:
    """A leader of hands whose arms are where they are asked to be."""

    def __init__(self, robot, **options):
        self.robot, self.leader = robot, HandLeader(robot, dt=DT, **options)
        self.time, self.guard = 0.0, OperatorGuard(dt=DT)
        self.index = [7 + robot.joint_index(name) for name in self.leader.task.joints]

    def say(self, left=None, right=None, seconds=DT, rest=False):
        for _ in range(round(seconds / DT)):
            self.time += DT
            state = RobotState(self.q, np.zeros(self.robot.nv), time=self.time)
            self.guard.check(both(self.time, left, right, rest), self.time)
            self.leader.lead(self.guard, state)

    @property
    def q(self):
        q = self.robot.q_home.copy()
        q[self.index] = self.leader.task.target_position
        return q

    @property
    def rotation(self):
        """Torso_R_hand of the right one."""
        dynamics = Dynamics(self.robot)
        dynamics.update(RobotState(self.q, np.zeros(self.robot.nv)))
        torso, right = (
            dynamics.frame(self.robot.frame_id(name)).rotation
            for name in (self.robot.torso, self.robot.hands[1])
        )
        return torso.T @ right


class Arms:
    """The model of the arms that a leader has, sent to places; None for an arm that rests."""

    def __init__(self, robot, *, dt=DT, **options):
        self.motion = HandLeader(robot, dt=dt, **options)._arms

    def __getattr__(self, name):
        return getattr(self.motion, name)

    def each(self, name):
        """An attribute of each arm."""
        return [getattr(arm, name) for arm in self.motion.limbs]

    @property
    def joints(self):
        return self.motion.task.joints

    @property
    def hands(self):
        return self.each("place")

    def advance(self, places, rotations=None, rates=None):
        nothing = [None] * len(places)
        goals = zip(places, rotations or nothing, rates or nothing, strict=True)
        self.motion.advance([None if goal[0] is None else Goal(*goal) for goal in goals])
