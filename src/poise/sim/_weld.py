"""Locked joints of the plant: welded at zero, as the controller has them."""

from collections.abc import Collection

import mujoco
import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.errors import RobotError


def weld_joints(spec: mujoco.MjSpec, locked: Collection[str]) -> None:
    """Take joints out of a specification that are to stand at zero.

    MuJoCo leaves a body whose joint is taken out where it is at the joint's `ref`.
    """
    joints = [joint for joint in spec.joints if joint.name in locked]
    if any(joint.ref != 0.0 for joint in joints):
        _move_to_zero(spec, locked)
    for joint in joints:
        spec.delete(joint)


def _move_to_zero(spec: mujoco.MjSpec, locked: Collection[str]) -> None:
    """Place bodies where they are when their locked joints are at zero, the others at `ref`.

    Where bodies and joints are is taken from the compiled model: a document may say it in many
    ways, and from within frames.
    """
    try:
        model = spec.compile()
    except ValueError as error:
        raise RobotError(f"MuJoCo cannot build the robot's document: {error}") from error
    for body in spec.bodies:
        if not any(joint.name in locked for joint in body.joints):
            continue
        at = model.body(body.name)
        place, kept = _pose(at.pos, at.quat), list[mujoco.MjsJoint]()
        for joint in body.joints:
            if joint.name not in locked:
                _put_joint(body, joint, model.joint(joint.name).pos, model.joint(joint.name).axis)
                kept.append(joint)
                continue
            turn = _turn_to_zero(model, joint.name)
            place = place * turn
            # Joints before it stay where they are: the body turns under them.
            for other in kept:
                axis = turn.rotation.T @ np.array(other.axis)
                _put_joint(body, other, turn.actInv(np.array(other.pos)), axis)
        body.set_frame(body.parent.add_frame())
        body.pos, body.quat = place.translation, pin.Quaternion(place.rotation).coeffs()[_WXYZ]
        body.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT


_WXYZ = [3, 0, 1, 2]
"""MuJoCo's order of a quaternion in Pinocchio's."""


def _put_joint(
    body: mujoco.MjsBody,
    joint: mujoco.MjsJoint,
    position: Float64[np.ndarray, "3"],
    axis: Float64[np.ndarray, "3"],
) -> None:
    """Place a joint along the axes of its body, whatever frame it stands in."""
    joint.set_frame(body.add_frame())
    joint.pos, joint.axis = position, axis


def _turn_to_zero(model: mujoco.MjModel, name: str) -> pin.SE3:
    """How a body moves, along its axes, while a joint of its goes from `ref` to zero."""
    joint = model.joint(name)
    way = -float(joint.qpos0[0]) * np.array(joint.axis)
    if joint.type[0] == mujoco.mjtJoint.mjJNT_SLIDE:
        return pin.SE3(np.eye(3), way)
    anchor = pin.SE3(np.eye(3), np.array(joint.pos))
    return anchor * pin.SE3(pin.exp3(way), np.zeros(3)) * anchor.inverse()


def _pose(position: Float64[np.ndarray, "3"], quaternion: Float64[np.ndarray, "4"]) -> pin.SE3:
    return pin.SE3(pin.Quaternion(*quaternion).toRotationMatrix(), np.array(position))
