"""The home configuration: joints as described, the base so that the soles stand on the ground."""

from collections.abc import Mapping

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.errors import RobotError
from poise.robots.robot import Sole

_FLAT_POSITION = 2e-3
"""Soles this far off one plane [m] cannot stand on it."""

_FLAT_ANGLE = 1e-2
"""Soles tilted this much against each other [rad] cannot stand flat."""


def home_configuration(
    model: pin.Model,
    soles: Mapping[str, Sole],
    posture: Mapping[str, float],
    *,
    floating: bool,
    where: str,
) -> Float64[np.ndarray, " nq"]:
    """The configuration of the joints with the base placed on the soles.

    The first sole lies flat on z = 0; the middle of the soles is at x = y = 0, and their mean
    direction is x.

    Args:
        model: the model, with a frame for each sole.
        soles: the soles, by name.
        posture: joint positions by name [rad]; the others are zero.
        floating: whether the base is free.
        where: the file or the robot's name, for messages.

    Returns:
        The configuration.

    Raises:
        RobotError: a joint is outside its limits, or the soles do not lie in one plane.
    """
    q = pin.neutral(model)
    for name, angle in posture.items():
        q[model.joints[model.getJointId(name)].idx_q] = angle
    _check_limits(model, q, where)
    if not floating:
        return q
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    base_T_soles = [data.oMf[model.getFrameId(name)] for name in soles]
    world_T_base = _on_ground(base_T_soles)
    for name, base_T_sole in zip(soles, base_T_soles, strict=True):
        _check_flat(world_T_base * base_T_sole, name, where)
    q[:7] = pin.SE3ToXYZQUAT(world_T_base)
    return q


def _on_ground(base_T_soles: list[pin.SE3]) -> pin.SE3:
    first = base_T_soles[0].inverse()
    middle = np.mean([(first * s).translation for s in base_T_soles], axis=0)
    forward = np.sum([(first * s).rotation[:, 0] for s in base_T_soles], axis=0)
    yaw = np.arctan2(forward[1], forward[0])
    turn = pin.utils.rotate("z", -float(yaw))
    middle[2] = 0.0
    return pin.SE3(turn, -turn @ middle) * first


def _check_limits(model: pin.Model, q: Float64[np.ndarray, " nq"], where: str) -> None:
    for joint, name in zip(model.joints, model.names, strict=True):
        if joint.nq != 1:
            continue
        low, high = (
            float(model.lowerPositionLimit[joint.idx_q]),
            float(model.upperPositionLimit[joint.idx_q]),
        )
        if not low <= q[joint.idx_q] <= high:
            raise RobotError(
                f"home position of joint {name!r} of {where} is outside its limits",
                got=float(q[joint.idx_q]),
                wanted=f"{low:.4g} to {high:.4g} rad",
            )


def _check_flat(world_T_sole: pin.SE3, name: str, where: str) -> None:
    height = float(world_T_sole.translation[2])
    tilt = float(np.linalg.norm(world_T_sole.rotation[:2, 2]))
    upright = world_T_sole.rotation[2, 2] > 0.0
    if abs(height) > _FLAT_POSITION or tilt > _FLAT_ANGLE or not upright:
        raise RobotError(
            f"sole {name!r} of {where} does not lie in the plane of the first in the home posture",
            got=f"{1000.0 * height:.1f} mm high, tilted by {tilt:.3f} rad",
            wanted="joint positions under `home` that put all soles flat on one plane",
        )
