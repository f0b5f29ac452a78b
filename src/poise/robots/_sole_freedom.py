"""`with_controlled_soles`: what the legs of a robot can do with its soles."""

from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.robots._robot import Robot

_SMALL = 0.02
"""A motion of the sole is none of a leg's if it takes the joints 1 / 0.02 as far as it should."""


def with_controlled_soles(robot: Robot) -> Robot:
    """The robot with `Sole.controlled` of each sole, found in its home posture.

    Args:
        robot: the robot.
    """
    soles = {
        name: replace(sole, controlled=_controlled(robot, name))
        for name, sole in robot.soles.items()
    }
    return replace(robot, soles=MappingProxyType(soles))


def _controlled(robot: Robot, sole: str) -> tuple[int, ...]:
    """Drops one turn after another from the sole's motion until the leg can do what is left.

    A motion that the leg cannot make is one against which a wrench w does no work, w^T J = 0: a left
    singular vector of its Jacobian. Of the turns in it the largest is given up: for a leg whose
    ankle does not roll w is a force through the hip to the side, and the sole rolls; for one
    without yaw it is a moment about the vertical.
    """
    model, data, frame = robot.model, robot.model.createData(), robot.frame_id(sole)
    pin.computeJointJacobians(model, data, robot.q_home)
    pin.updateFramePlacements(model, data)
    joints = robot.leg_joints(sole)
    J = pin.getFrameJacobian(model, data, frame, pin.ReferenceFrame.LOCAL)
    J = J[:, [model.joints[j].idx_v for j in joints]]
    if joints:
        J[:3] /= np.linalg.norm(data.oMi[joints[0]].translation - data.oMf[frame].translation)
    left = [0, 1, 2, 3, 4, 5]
    while len(left) > 3:
        U, sigma = _left_vectors(J[left])
        if sigma > _SMALL:
            break
        left.remove(max((k for k in left if k >= 3), key=lambda k: abs(U[left.index(k)])))
    return tuple(left)


def _left_vectors(J: Float64[np.ndarray, "m n"]) -> tuple[Float64[np.ndarray, " m"], float]:
    """The motion that is hardest to make, and how far the joints get it."""
    values, vectors = np.linalg.eigh(J @ J.T)
    return vectors[:, 0], float(np.sqrt(max(values[0], 0.0)))
