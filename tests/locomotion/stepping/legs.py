"""Legs bent by hand: robots whose sagittal joints are known, with level soles."""

import numpy as np

from poise.dynamics import Dynamics, RobotState
from poise.locomotion._walking._legs import measure_leg

PITCHES = {"biped20": (2, 3, 4), "talos": (2, 3, 4), "g1": (0, 3, 4)}
"""Places of hip pitch, knee and ankle pitch in a leg."""


def leg_joints(robot, sole):
    """Indices among the robot's joints, from the hip on."""
    return [joint - 2 for joint in robot.leg_joints(sole)]


def measured_leg(robot, sole):
    return measure_leg(Dynamics(robot), sole, robot.q_home)


def bent(robot, hip, knee, ankle):
    """Dynamics of a robot with a level base and both legs bent so; other leg joints at zero."""
    q = robot.q_home.copy()
    for sole in list(robot.soles)[:2]:
        joints = np.array(leg_joints(robot, sole))
        q[7 + joints] = 0.0
        q[7 + joints[list(PITCHES[robot.name])]] = hip, knee, ankle
    dynamics = Dynamics(robot)
    dynamics.update(RobotState(q, np.zeros(robot.nv)))
    return dynamics


def soles_of(dynamics):
    robot = dynamics.robot
    return [dynamics.frame(robot.frame_id(name)).position for name in list(robot.soles)[:2]]
