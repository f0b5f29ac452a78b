"""`with_controlled_soles`: a robot that knows what its legs can do with its soles."""

from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.robots._robot import Robot

_SMALL = 0.02
"""A sole cannot make a motion that is this slow with the joints of its leg at unit speed."""

_NO_LENGTH = 1e-9
"""A leg that is shorter has a sole at its first joint's origin [m]."""

_ALL = (0, 1, 2, 3, 4, 5)
"""Every component of a motion."""


def with_controlled_soles(robot: Robot) -> Robot:
    """The robot with `Sole.controlled` of each sole as its home posture has it.

    Args:
        robot: the robot.
    """
    soles = {
        name: replace(sole, controlled=_controlled(robot, name))
        for name, sole in robot.soles.items()
    }
    return replace(robot, soles=MappingProxyType(soles))


def _controlled(robot: Robot, sole: str) -> tuple[int, ...]:
    """Gives up one turn of a sole after another until its leg can do all that is left.

    A leg cannot make the motion w with w^T J = 0, a left singular vector of its Jacobian J. Of the
    turns in w the largest is given up. A leg whose ankle does not roll lacks a shift to the side,
    seen from its hip, and gives up roll; one whose hip does not yaw gives up yaw.
    """
    J = _leg_jacobian(robot, sole)
    kept = list(_ALL)
    while turns := [i for i, k in enumerate(kept) if k >= 3]:
        squares, motions = np.linalg.eigh(J[kept] @ J[kept].T)
        if squares[0] > _SMALL**2:
            return tuple(kept)
        del kept[max(turns, key=lambda i: abs(motions[i, 0]))]
    # What it lacks is no turn: a straight knee, or hips that cannot spread.
    return _ALL


def _leg_jacobian(robot: Robot, sole: str) -> Float64[np.ndarray, "6 joints"]:
    """The Jacobian of a sole along its own axes, for the joints of its leg; by the leg's length."""
    model, data, frame = robot.model, robot.model.createData(), robot.frame_id(sole)
    pin.computeJointJacobians(model, data, robot.q_home)
    J = pin.getFrameJacobian(model, data, frame, pin.ReferenceFrame.LOCAL)
    joints = robot.leg_joints(sole)
    J = J[:, [model.joints[j].idx_v for j in joints]]
    if joints:
        foot = pin.updateFramePlacement(model, data, frame).translation
        length = float(np.linalg.norm(data.oMi[joints[0]].translation - foot))
        # At the origin of a slide there is no length to measure its motion by.
        J[:3] /= length if length > _NO_LENGTH else 1.0
    return J
