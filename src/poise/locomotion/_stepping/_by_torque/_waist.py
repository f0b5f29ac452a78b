"""`waist_ranges`: how far a waist turns the torso against the pelvis, about each axis."""

import numpy as np
from jaxtyping import Float64

from poise.dynamics import Dynamics, RobotState
from poise.locomotion._stepping._stance import Biped

_ALONG = 0.7
"""A joint turns about an axis of the pelvis along which its own has this part at home."""


def waist_ranges(biped: Biped) -> Float64[np.ndarray, "3 2"]:
    """Least and largest roll, pitch and yaw of the torso against the pelvis, from home [rad].

    Zero about axes for which the waist has no joint: there only the pelvis turns the torso.
    """
    robot = biped.robot
    dynamics = Dynamics(robot)
    dynamics.update(RobotState(robot.q_home, np.zeros(robot.nv)))
    pelvis, torso = (
        dynamics.frame(f).jacobian[3:, robot.base_dofs :] for f in (biped.pelvis, biped.torso)
    )
    axes = dynamics.frame(biped.pelvis).rotation.T @ (torso - pelvis)
    joints = slice(robot.nq - robot.nj, None)
    home = robot.q_home[joints]
    limits = np.column_stack(
        (
            robot.model.lowerPositionLimit[joints] - home,
            robot.model.upperPositionLimit[joints] - home,
        )
    )
    ranges = np.zeros((3, 2))
    for axis in range(3):
        for joint in np.flatnonzero(np.abs(axes[axis]) > _ALONG).tolist():
            ranges[axis] += np.sort(axes[axis, joint] * limits[joint])
    return ranges
