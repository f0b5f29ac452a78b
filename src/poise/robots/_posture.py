"""`standing_posture`: a configuration with the feet so far apart and the CoM so high.

The home configuration: joints as described, the base so that the soles stand on the ground.
"""

from collections.abc import Mapping

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._checks import checked_number
from poise.errors import RobotError
from poise.robots._limits import hinges
from poise.robots._robot import Robot, Sole
from poise.robots._stance import REACHED, StanceGoals

_FLAT_POSITION = 2e-3  # Soles this far off one plane [m] cannot stand on it
FULL_TILT = 1e-2  # A sole that is tilted by this much stands on its edge alone [rad]


def home_configuration(
    model: pin.Model,
    soles: Mapping[str, Sole],
    posture: Mapping[str, float],
    *,
    floating: bool,
    where: str,
) -> Float64[np.ndarray, " nq"]:
    """The joints as described, the soles flat on z = 0 about the origin, their mean direction x."""
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
    for name, joint in hinges(model):
        k = joint.idx_q
        low, high = model.lowerPositionLimit[k], model.upperPositionLimit[k]
        if not low <= q[k] <= high:
            raise RobotError(
                f"home position of joint {name!r} of {where} is outside its limits",
                got=float(q[k]),
                wanted=f"{low:.4g} to {high:.4g} rad",
            )


def _check_flat(world_T_sole: pin.SE3, name: str, where: str) -> None:
    height = float(world_T_sole.translation[2])
    tilt = float(np.linalg.norm(world_T_sole.rotation[:2, 2]))
    upright = world_T_sole.rotation[2, 2] > 0.0
    if abs(height) > _FLAT_POSITION or tilt > FULL_TILT or not upright:
        raise RobotError(
            f"sole {name!r} of {where} does not lie in the plane of the first in the home posture",
            got=f"{1000.0 * height:.1f} mm high, tilted by {tilt:.3f} rad",
            wanted="joint positions under `home` that put all soles flat on one plane",
        )


def standing_posture(
    robot: Robot, *, feet_apart: float | None = None, com_height: float | None = None
) -> Float64[np.ndarray, " nq"]:
    """The home posture with other legs: soles side by side about the origin, CoM so high [m]."""
    if not robot.floating_base or len(robot.soles) < 2:
        raise RobotError(
            f"robot {robot.name!r} has no feet to stand on", got=list(robot.soles), wanted="two"
        )
    model, data = robot.model, robot.model.createData()
    frames = [robot.frame_id(name) for name in list(robot.soles)[:2]]
    pin.framesForwardKinematics(model, data, robot.q_home)
    left, right = (data.oMf[i].translation for i in frames)
    apart, height = float(left[1] - right[1]), float(pin.centerOfMass(model, data)[2])
    if feet_apart is not None:
        apart = checked_number(feet_apart, "distance of the feet [m]", above=0.0)
    if com_height is not None:
        height = checked_number(com_height, "height of the CoM [m]", above=0.0)
    upright = pin.Quaternion(robot.q_home[3:7]).matrix()
    goals = StanceGoals(model, frames, upright, apart, height, True)
    joints = {j for sole in robot.soles for j in robot.leg_joints(sole)}
    columns = [*range(6), *sorted(int(model.joints[j].idx_v) for j in joints)]
    bounds = model.lowerPositionLimit, model.upperPositionLimit
    q, levels = goals.solve(robot.q_home, columns, bounds)
    if any(np.abs(error).max() > REACHED for error, _ in levels):
        raise RobotError(
            f"the legs of robot {robot.name!r} do not get there",
            got=f"feet {apart:.3f} m apart, CoM {height:.3f} m high",
            wanted="a lower CoM, or feet nearer to each other",
        )
    return q
