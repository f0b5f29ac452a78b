"""A robot that does what it is told, without dynamics: the kinematics of a command."""

import numpy as np
import pinocchio as pin
import pytest

from poise.dynamics import RobotState

LEG = ("hip", "knee", "ankle")


class Follower:
    """Integrates joint velocities, with the base moved so that one frame stands still.

    Written without Poise's elimination of the base: the base is put where the frame's placement,
    from a forward kinematics of its own, comes out as it was.
    """

    def __init__(self, robot, q, stance, dt):
        self.robot, self.dt, self.time = robot, dt, 0.0
        self._data = robot.model.createData()
        self.q, self.v = q.copy(), np.zeros(robot.nv)
        self.stand_on(stance)

    def placement(self, frame, q=None):
        pin.framesForwardKinematics(self.robot.model, self._data, self.q if q is None else q)
        return self._data.oMf[self.robot.model.getFrameId(frame)].copy()

    def stand_on(self, frame):
        self.stance = frame
        self._stood = None if frame is None else self.placement(frame)

    @property
    def joints(self):
        return self.q[self.robot.nq - self.robot.nj :]

    @property
    def com(self):
        return pin.centerOfMass(self.robot.model, self._data, self.q).copy()

    def state(self):
        return RobotState(self.q.copy(), self.v.copy(), time=self.time)

    def move(self, u):
        """One period; leaves the velocity that led there in `v`."""
        before = self.q
        first = self.robot.nq - self.robot.nj
        q = before.copy()
        q[first:] += self.dt * u
        if self.stance is not None:
            base = pin.XYZQUATToSE3(q[:7])
            q[:7] = pin.SE3ToXYZQUAT(self._stood * self.placement(self.stance, q).inverse() * base)
            q[3:7] /= np.linalg.norm(q[3:7])
        self.q, self.time = q, self.time + self.dt
        self.v = pin.difference(self.robot.model, before, q) / self.dt

    def momentum(self, q, v):
        return pin.computeCentroidalMomentum(self.robot.model, self._data, q, v).vector.copy()


@pytest.fixture
def follow():
    def make(robot, stance=None, dt=1e-3, q=None):
        return Follower(robot, robot.q_home if q is None else q, stance, dt)

    return make


@pytest.fixture
def leg_joints():
    return lambda robot: [n for n in robot.joint_names if any(part in n for part in LEG)]
