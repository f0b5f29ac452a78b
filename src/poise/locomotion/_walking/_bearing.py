"""`bearing`: the part of its sole on which a foot can carry the whole robot by itself."""

import pinocchio as pin

from poise.locomotion._support import SolePart
from poise.robots import Robot

_ALIGNED = 0.7
"""A joint whose axis has this much of a sole's axis turns the foot about it."""


def bearing(robot: Robot, sole: str, outwards: float) -> SolePart:
    """All of the sole, but for what its leg cannot hold.

    An ankle with the torque tau holds the weight W as far as tau / W from its axis. A sole that
    leans with its leg does so outwards while it carries alone, as the body is on its side of the
    middle, and stands on its outer edge.
    """
    size = robot.soles[sole]
    back, front = _held(robot, sole, 4, 0, 0.5 * size.length)
    right, left = _held(robot, sole, 3, 1, 0.5 * size.width)
    if size.leans:
        left = right = 0.5 * outwards * size.width
    return SolePart(0.5 * (front + back), 0.5 * (left + right), front - back, left - right)


def _held(robot: Robot, sole: str, turn: int, axis: int, half: float) -> tuple[float, float]:
    """The part of a sole along one axis that the joint which turns it about the other one holds."""
    model, data, frame = robot.model, robot.model.createData(), robot.frame_id(sole)
    pin.computeJointJacobians(model, data, robot.q_home)
    J = pin.getFrameJacobian(model, data, frame, pin.ReferenceFrame.LOCAL)
    pose = pin.updateFramePlacement(model, data, frame)
    for joint in reversed(robot.leg_joints(sole)):
        column = model.joints[joint].idx_v
        if abs(J[turn, column]) > _ALIGNED:
            at = float(pose.actInv(data.oMi[joint].translation)[axis])
            torque = float(robot.tau_max[column - robot.base_dofs])
            reach = torque / robot.weight
            low, high = max(at - reach, -half), min(at + reach, half)
            if low < high:
                return low, high
            # An ankle that holds nothing of the sole: as near to its axis as can be.
            nearest = min(max(at, -half), half)
            return nearest, nearest
    return -half, half
