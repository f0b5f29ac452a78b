"""Limits, states and commands of a leg with three joints, for the tests beside."""

from types import SimpleNamespace

import numpy as np

from poise.hardware import LastCheck, MotorCommand, MotorState

JOINTS = "hip", "knee", "ankle"
LIMITS = SimpleNamespace(
    joint_names=JOINTS,
    q_min=np.array([-1.0, 0.0, -0.5]),
    q_max=np.array([1.0, 2.0, 0.5]),
    v_max=np.array([10.0, 10.0, 5.0]),
    tau_max=np.array([100.0, 120.0, 40.0]),
)
"""Limits of a leg, without a robot."""


def make_check(**settings):
    return LastCheck(LIMITS, **{"kp_max": 200.0, "kd_max": 10.0} | settings)


def state(time=0.0, q=(0.0, 1.0, 0.0), dq=(0.0, 0.0, 0.0), arrived=None, **fields):
    known = {
        "time": time,
        "arrived": time if arrived is None else arrived,
        "q": np.array(q),
        "dq": np.array(dq),
        "tau": np.zeros(3),
        "temperature": np.full(3, 40.0),
        "quaternion": np.array([0.0, 0.0, 0.0, 1.0]),
        "gyro": np.zeros(3),
        "acceleration": np.array([0.0, 0.0, 9.81]),
        "wrenches": np.zeros((0, 6)),
    }
    return MotorState(**known | fields)


def command(**fields):
    known = {
        "q": np.array([0.0, 1.0, 0.0]),
        "dq": np.zeros(3),
        "kp": np.full(3, 20.0),
        "kd": np.full(3, 1.0),
        "tau": np.array([10.0, -20.0, 5.0]),
    }
    return MotorCommand(**known | fields)
