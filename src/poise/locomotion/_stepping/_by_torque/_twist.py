"""`twist_ranges`: how far joints about the vertical may turn, so that no body winds itself up."""

from collections.abc import Mapping

import numpy as np

from poise.dynamics import Dynamics, RobotState
from poise.locomotion._stepping._stance import Biped

_FARTHEST = 1.2
"""From home [rad]. Waists and hips of some robots turn by 2.6: pushed on one foot, G1 turned its
waist by 2.6 and its pelvis by 1.8 over the feet within two seconds. Then the shorter way for torso
and pelvis to face ahead again is on into the stops, and its trunk leaned on them by half a radian
and more until it fell, eight seconds later."""

_UPRIGHT = 0.7
"""A joint is about the vertical whose axis has this vertical part at home."""


def twist_ranges(biped: Biped) -> Mapping[str, tuple[float, float]]:
    """Lower and upper angle of each joint about the vertical between feet and torso [rad]."""
    robot = biped.robot
    dynamics = Dynamics(robot)
    dynamics.update(RobotState(robot.q_home, np.zeros(robot.nv)))
    found = dict[str, tuple[float, float]]()
    for frame in (*biped.frames, biped.pelvis, biped.torso):
        axes = dynamics.frame(frame).jacobian[3:, robot.base_dofs :]
        for joint in np.flatnonzero(np.abs(axes[2]) > _UPRIGHT).tolist():
            home = float(robot.q_home[robot.nq - robot.nj + joint])
            found[robot.joint_names[joint]] = home - _FARTHEST, home + _FARTHEST
    return found
