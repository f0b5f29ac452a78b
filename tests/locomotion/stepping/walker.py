"""What the tests of teleoperation share: devices, short runs, and robots that cannot be walked."""

import numpy as np
import pinocchio as pin

from poise.apps.teleoperation import VELOCITY_TELEOP_PLANT, run_teleop
from poise.locomotion import OperatorSample, ScriptedDevice, TrackedPose, WayPoint


def hands(*points):
    """A device by way-points, for `run_teleop`."""

    def make(controller):
        return ScriptedDevice(points, *controller.estimator.anchors)

    return make


def up_and_down(foot="right", lift=0.5, lower=2.2, height=0.08):
    """Way-points that lift a foot and put it down."""
    places = ((lift, 0.0), (lift + 0.1, 0.03), (lift + 0.6, height), (lower, height),
              (lower + 0.5, -0.03), (lower + 0.8, -0.03), (lower + 1.0, 0.0))  # fmt: skip
    return [WayPoint(at=at, **{foot: (0.0, 0.0, z)}) for at, z in places]


def walk(robot, points, duration, plant=VELOCITY_TELEOP_PLANT, **changes):
    return run_teleop(robot, hands(*points), plant, duration=duration, **changes)


def sample(time, left=(0.0, 0.135, 0.0), right=(0.0, -0.135, 0.0), rates=(None, None), **more):
    """A sample of two foot devices, and of whatever else."""
    feet = (
        TrackedPose.of(place, velocity=rate)
        for place, rate in zip((left, right), rates, strict=True)
    )
    return OperatorSample(time, tuple(feet), **more)


class Says:
    """A device that says the same whenever it is asked."""

    def __init__(self, sample):
        self._sample = sample

    def sample(self, time):
        return self._sample


def feet(left, right, left_rate=None, right_rate=None):
    """A sample of two foot devices at places of any kind."""
    parts = TrackedPose(left, velocity=left_rate), TrackedPose(right, velocity=right_rate)
    return OperatorSample(0.0, parts)


def facing(robot, yaw):
    """Its home, turned about the vertical."""
    q = robot.q_home.copy()
    turn = pin.exp3(np.array([0.0, 0.0, yaw]))
    q[:3] = turn @ q[:3]
    q[3:7] = pin.Quaternion(turn @ pin.Quaternion(q[3:7]).matrix()).coeffs()
    return q
