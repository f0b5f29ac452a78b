"""How far a user's MuJoCo model is the robot that a controller knows.

What cannot be right is refused: joints that stand or turn elsewhere. What may be meant so, such as
a heavier link, is said in words.
"""

from collections.abc import Sequence

import mujoco
import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.errors import RobotError
from poise.robots import GRAVITY, Robot
from poise.sim._drives import Drives
from poise.sim._mapping import StateMap

_PLACE_TOLERANCE = 1e-3
"""Files written with three or four digits put joints this far apart [m]."""

_AXIS_TOLERANCE = 5e-3
"""And turn their axes by this much [rad]."""

_SWING = 0.4
"""Joints are compared at home and this far from it, where wrong zeros and signs show [rad]."""

_MASS_TOLERANCE = 5e-3
"""Relative difference of the mass that is not worth a word."""

_COM_TOLERANCE = 2e-3
"""Difference of the centre of mass at home that is not worth a word [m]."""

_RELATIVE_TOLERANCE = 1e-2
"""Relative difference of other quantities that is not worth a word."""

_COARSE_STEP = 5e-3
"""Feet chatter on the ground with longer time steps [s]."""

_WRONG_WHERE_SPARSE = "4.0.0"
"""The version of MuJoCo whose sparse Cholesky factorization is wrong, see its issue 3767."""

_SHOWN = 8
"""Joints that a message names."""


def find_base(robot: Robot, model: mujoco.MjModel, prefix: str) -> pin.SE3 | None:
    """Where the robot's base is in the body of the free joint, from where all joints stand.

    Args:
        robot: the robot.
        model: a MuJoCo model that has it.
        prefix: what stands before the names of its joints.

    Returns:
        The placement, None where base and body are one, as for a fixed base.

    Raises:
        RobotError: a joint stands or turns elsewhere, or a fixed base stands elsewhere.
    """
    mapping = StateMap(robot, model, prefix=prefix)
    home = robot.q_home[7 if robot.floating_base else 0 :]
    swing = _SWING * np.where(np.arange(robot.nj) % 2, 1.0, -1.0)
    postures = [_with_base_at_origin(robot, joints) for joints in (home, home + swing)]
    ours = np.array([_joints_in_pinocchio(robot, q) for q in postures])
    theirs = np.array([_joints_in_mujoco(model, mapping, q) for q in postures])
    if _mismatch(ours, theirs).max() <= 1.0:
        return None
    placement = _rigid_motion(ours[0], theirs[0])
    moved = np.concatenate(
        (
            ours[..., :3] @ placement.rotation.T + placement.translation,
            ours[..., 3:] @ placement.rotation.T,
        ),
        axis=-1,
    )
    mismatch = _mismatch(moved, theirs)
    if mismatch.max() > 1.0:
        _refuse_joints(robot, moved, theirs, mismatch)
    if not robot.floating_base:
        raise RobotError(
            f"the fixed base of robot {robot.name!r} stands elsewhere in the MuJoCo model",
            got=f"{np.round(placement.translation, 4).tolist()} m, turned by "
            f"{np.linalg.norm(pin.log3(placement.rotation)):.4f} rad",
            wanted="the place that the robot's own document gives it",
        )
    return placement


def differences(
    robot: Robot, model: mujoco.MjModel, mapping: StateMap, drives: Drives
) -> tuple[str, ...]:
    """What the controller does not know of a MuJoCo model, a sentence each.

    Args:
        robot: the robot that the controller knows.
        model: the MuJoCo model.
        mapping: between the two.
        drives: the actuators.
    """
    joints = list(mapping.joints)
    dofs, names = model.jnt_dofadr[joints], robot.joint_names
    none = np.zeros(len(joints))
    own = robot.model.armature[robot.base_dofs :]
    armature = model.dof_armature[dofs] + drives.armature
    damping = model.dof_damping[dofs] + drives.damping
    # Ranges may be wider than the controller knows: it keeps to what it knows.
    span = np.where(model.jnt_limited[joints], model.jnt_range[joints].T, [[-np.inf], [np.inf]])
    low, high = np.maximum(span[0], robot.q_min), np.minimum(span[1], robot.q_max)
    reach = drives.strength(robot.q_home[len(robot.q_home) - robot.nj :])
    torque = np.minimum(np.minimum(-reach[0], reach[1]), robot.tau_max)
    lines = [
        *_bodies(robot, model, mapping),
        *_worst("armature", "kg m^2", names, armature, own),
        *_worst("joint damping", "N m s/rad", names, damping, none),
        *_worst("dry friction", "N m", names, model.dof_frictionloss[dofs], none),
        *_worst("joint stiffness", "N m/rad", names, model.jnt_stiffness[joints], none),
        *_worst("torque limits", "N m", names, torque, robot.tau_max),
        *_worst("lower position limits", "rad", names, low, robot.q_min),
        *_worst("upper position limits", "rad", names, high, robot.q_max),
        *_listed("joints whose actuators act late (a filter or a delay)", drives.delayed),
        *_listed(
            "joints that no actuator moves, so that torques go through data.qfrc_applied",
            [names[k] for k in drives.unactuated],
        ),
        *_listed(
            "joints on the robot that its description lacks or locks, which are left alone",
            _strangers(model, mapping),
        ),
        *_world(model),
    ]
    return tuple(lines)


def _worst(
    what: str,
    unit: str,
    names: Sequence[str],
    model: Float64[np.ndarray, " nj"],
    robot: Float64[np.ndarray, " nj"],
) -> list[str]:
    """A sentence on the joint where a quantity differs most, none where it is the same."""
    off = np.abs(model - robot)
    differ = off > _RELATIVE_TOLERANCE * np.abs(robot)
    if not differ.any():
        return []
    k = int(np.argmax(np.where(differ, off, -1.0)))
    return [
        f"{what} of {int(differ.sum())} joints, most {names[k]}: {model[k]:.4g} {unit} in the "
        f"model, {robot[k]:.4g} to the controller"
    ]


def _listed(what: str, names: Sequence[str]) -> list[str]:
    return [f"{what}: {', '.join(names)}"] if names else []


def _bodies(robot: Robot, model: mujoco.MjModel, mapping: StateMap) -> list[str]:
    """Mass, and centre of mass at home."""
    root = model.body_rootid[model.jnt_bodyid[mapping.joints[0]]]
    # What is welded to the world moves nobody, and Pinocchio has it in the universe.
    bodies = np.flatnonzero((model.body_rootid == root) & (model.body_weldid != 0))
    masses = model.body_mass[bodies]
    mass, lines = float(masses.sum()), list[str]()
    if abs(mass - robot.mass) > _MASS_TOLERANCE * robot.mass:
        lines.append(f"mass: {mass:.4g} kg in the model, {robot.mass:.4g} kg to the controller")
    data = mujoco.MjData(model)
    data.qpos[:] = mapping.qpos(robot.q_home)
    mujoco.mj_kinematics(model, data)
    there = masses @ data.xipos[bodies] / mass
    com = pin.centerOfMass(robot.model, robot.model.createData(), robot.q_home)
    off = float(np.linalg.norm(there - com))
    if off > _COM_TOLERANCE:
        lines.append(f"centre of mass at home: {1e3 * off:.1f} mm apart")
    return lines


def _strangers(model: mujoco.MjModel, mapping: StateMap) -> list[str]:
    """Joints in the robot's tree of bodies that are not the robot's."""
    root = model.body_rootid[model.jnt_bodyid[mapping.joints[0]]]
    own = {*mapping.joints, mapping.free_joint}
    there = (j for j in range(model.njnt) if model.body_rootid[model.jnt_bodyid[j]] == root)
    return [model.joint(j).name or f"joint {j}" for j in there if j not in own]


def _world(model: mujoco.MjModel) -> list[str]:
    """Gravity, the time step, and a constraint solver that may go wrong."""
    lines: list[str] = []
    gravity = np.array(model.opt.gravity)
    if np.abs(gravity - [0.0, 0.0, -GRAVITY]).max() > _RELATIVE_TOLERANCE * GRAVITY:
        lines.append(f"gravity: {gravity.tolist()} m/s^2, not {GRAVITY} downwards")
    if model.body_gravcomp.any():
        lines.append("bodies whose gravity the simulator compensates (gravcomp)")
    if model.opt.timestep > _COARSE_STEP:
        step, most = 1e3 * float(model.opt.timestep), 1e3 * _COARSE_STEP
        lines.append(f"time step: {step:.4g} ms; feet chatter above some {most:.4g} ms")
    newton = model.opt.solver == mujoco.mjtSolver.mjSOL_NEWTON
    if newton and mujoco.mj_isSparse(model) and mujoco.__version__ == _WRONG_WHERE_SPARSE:
        lines.append(
            f"constraint Jacobian: sparse, with which Newton's method of MuJoCo "
            f"{_WRONG_WHERE_SPARSE} may go wrong; "
            "set model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE"
        )
    return lines


def _with_base_at_origin(
    robot: Robot, joints: Float64[np.ndarray, " nj"]
) -> Float64[np.ndarray, " nq"]:
    q = pin.neutral(robot.model)
    q[len(q) - len(joints) :] = joints
    return q


def _joints_in_pinocchio(
    robot: Robot, q: Float64[np.ndarray, " nq"]
) -> Float64[np.ndarray, "nj 6"]:
    """Origin and axis of each joint in the world."""
    model, data = robot.model, robot.model.createData()
    pin.computeJointJacobians(model, data, q)
    rows: list[Float64[np.ndarray, "6"]] = []
    for i in range(model.njoints - robot.nj, model.njoints):
        # A matrix of one column comes as a vector.
        jacobian = pin.getJointJacobian(model, data, i, pin.LOCAL_WORLD_ALIGNED).reshape(6, -1)
        motion = jacobian[:, model.joints[i].idx_v]
        # A hinge turns about its axis, a slide moves along it.
        axis = motion[3:] if motion[3:].any() else motion[:3]
        rows.append(np.concatenate((data.oMi[i].translation, axis)))
    return np.array(rows)


def _joints_in_mujoco(
    model: mujoco.MjModel, mapping: StateMap, q: Float64[np.ndarray, " nq"]
) -> Float64[np.ndarray, "nj 6"]:
    data = mujoco.MjData(model)
    data.qpos[:] = mapping.qpos(q)
    mujoco.mj_kinematics(model, data)
    joints = list(mapping.joints)
    return np.hstack((data.xanchor[joints], data.xaxis[joints]))


def _mismatch(
    ours: Float64[np.ndarray, "2 nj 6"], theirs: Float64[np.ndarray, "2 nj 6"]
) -> Float64[np.ndarray, "2 nj"]:
    """How far joints are apart, over the tolerances."""
    off = ours - theirs
    place = np.linalg.norm(off[..., :3], axis=-1) / _PLACE_TOLERANCE
    return np.maximum(place, np.linalg.norm(off[..., 3:], axis=-1) / _AXIS_TOLERANCE)


def _rigid_motion(
    ours: Float64[np.ndarray, "nj 6"], theirs: Float64[np.ndarray, "nj 6"]
) -> pin.SE3:
    """The rigid motion that brings our joints nearest to theirs, by least squares.

    The rotation is that of Kabsch: with the singular values U S V^T of the covariance of centred
    origins, and of axes, R = V diag(1, 1, det V U^T) U^T.
    """
    centers = ours[:, :3].mean(axis=0), theirs[:, :3].mean(axis=0)
    a = np.vstack((ours[:, :3] - centers[0], ours[:, 3:]))
    b = np.vstack((theirs[:, :3] - centers[1], theirs[:, 3:]))
    u, _, vt = np.linalg.svd(a.T @ b)
    flip = np.diag([1.0, 1.0, np.sign(np.linalg.det(vt.T @ u.T))])
    rotation = vt.T @ flip @ u.T
    return pin.SE3(rotation, centers[1] - rotation @ centers[0])


def _refuse_joints(
    robot: Robot,
    ours: Float64[np.ndarray, "2 nj 6"],
    theirs: Float64[np.ndarray, "2 nj 6"],
    mismatch: Float64[np.ndarray, "2 nj"],
) -> None:
    order = np.argsort(-mismatch.max(axis=0))
    wrong = [int(k) for k in order if mismatch[:, k].max() > 1.0]
    off = ours - theirs
    place = np.linalg.norm(off[..., :3], axis=-1).max(axis=0)
    axis = np.linalg.norm(off[..., 3:], axis=-1).max(axis=0)
    raise RobotError(
        f"joints of robot {robot.name!r} stand or turn elsewhere in the MuJoCo model",
        got=[
            f"{robot.joint_names[k]}: {1e3 * place[k]:.3g} mm, {axis[k]:.3g} rad"
            for k in wrong[:_SHOWN]
        ],
        wanted="the same zeros, signs and places of all joints, and the free joint in a body that "
        "is rigidly one with the robot's base",
    )
