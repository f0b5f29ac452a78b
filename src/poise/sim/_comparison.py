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
from poise.sim._equalities import pulling_tendons
from poise.sim._mapping import StateMap

_PLACE_TOLERANCE = 1e-3
"""Places written in metres to four decimals are off by up to 0.05 mm an axis, so by sqrt(3) 0.05 mm
a joint, and by this much after the twelve joints from a floating base to a hand [m]."""

_AXIS_TOLERANCE = 5e-3
"""Angles written to three decimals are off by up to 0.0005 rad an axis, so by sqrt(3) 0.0005 rad a
joint; six joints that turn about one axis, as those of a leg or an arm, turn them by this much
[rad]."""

_SWING = 0.4
"""Joints are compared at home and this far from it, where wrong zeros and signs show [rad]."""

_MASS_TOLERANCE = 5e-3
"""Relative difference of masses written with three digits."""

_MASS_STEP = 1e-3
"""Masses written in kilograms to three decimals differ by up to this [kg]."""

_COM_TOLERANCE = 2e-3
"""Difference of centres of mass written in metres to three decimals, in joints that stand apart by
as much as is allowed: sqrt(3) 0.5 mm and 1 mm [m]."""

_RELATIVE_TOLERANCE = 1e-2
"""Relative difference of other quantities that is not worth a word."""

_COARSE_STEP = 5e-3
"""Feet chatter on the ground with longer time steps [s]."""

_WRONG_WHERE_SPARSE = "4.0.0"
"""The version of MuJoCo whose sparse Cholesky factorization is wrong, see its issue 3767."""

_SHOWN = 8
"""Joints that a message names."""


def find_base(robot: Robot, model: mujoco.MjModel, prefix: str) -> pin.SE3 | None:
    """Return the pose of the base in the body of the free joint, from all joints' places."""
    mapping = StateMap(robot, model, prefix=prefix)
    home, swung = robot.q_home[-robot.nj :], _swung(robot)[-robot.nj :]
    postures = [_with_base_at_origin(robot, joints) for joints in (home, swung)]
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
    robot: Robot, model: mujoco.MjModel, mapping: StateMap, drives: Drives, prefix: str
) -> tuple[str, ...]:
    """Return what the controller does not know of a MuJoCo model, a sentence each."""
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
        *_frames(robot, model, mapping, prefix),
        *_worst("armature", "kg m^2", names, armature, own),
        *_worst("joint damping", "N m s/rad", names, damping, none),
        *_worst("dry friction", "N m", names, model.dof_frictionloss[dofs], none),
        *_worst("joint stiffness", "N m/rad", names, model.jnt_stiffness[joints], none),
        *_listed("tendons that resist or limit its joints", pulling_tendons(model, mapping)),
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
    """Mass, and centre of mass at home: of the whole robot, and of what each joint moves."""
    data, ours = _in_mujoco(model, mapping, robot.q_home), robot.model.createData()
    pin.forwardKinematics(robot.model, ours, robot.q_home)
    masses, centers = np.zeros(robot.model.njoints), np.zeros((robot.model.njoints, 3))
    for body, joint in _movers(robot, model, mapping).items():
        masses[joint] += model.body_mass[body]
        centers[joint] += model.body_mass[body] * data.xipos[body]
    own = np.array([inertia.mass for inertia in robot.model.inertias])
    own[0] = masses[0] = 0.0  # What is fixed to the world moves nobody.
    places = [pose.act(i.lever) for pose, i in zip(ours.oMi, robot.model.inertias, strict=True)]
    total, com = masses.sum(), centers[1:].sum(axis=0) / masses.sum()
    off = np.abs(masses - own)
    heavy = np.minimum(masses, own) > _MASS_STEP
    apart = np.zeros(len(own))
    apart[heavy] = np.linalg.norm(
        centers[heavy] / masses[heavy, None] - np.array(places)[heavy], axis=1
    )
    lines = list[str]()
    differ = off > np.maximum(_MASS_TOLERANCE * own, _MASS_STEP)
    if differ.any() or abs(total - robot.mass) > _MASS_TOLERANCE * robot.mass:
        k = int(off.argmax())
        lines.append(
            f"mass: {total:.4g} kg in the model, {robot.mass:.4g} kg to the controller; most what "
            f"{robot.model.names[k]} moves: {masses[k]:.4g} kg and {own[k]:.4g} kg"
        )
    whole = float(np.linalg.norm(com - own @ np.array(places) / robot.mass))
    if max(whole, apart.max()) > _COM_TOLERANCE:
        k = int(apart.argmax())
        lines.append(
            f"centre of mass at home: {1e3 * whole:.1f} mm apart; most of what "
            f"{robot.model.names[k]} moves: {1e3 * apart[k]:.1f} mm"
        )
    return lines


def _movers(robot: Robot, model: mujoco.MjModel, mapping: StateMap) -> dict[int, int]:
    """Bodies of the robot's tree, with Pinocchio's last joint that moves each; 0 for none."""
    first = robot.model.njoints - robot.nj
    joint_of = {j: first + k for k, j in enumerate(mapping.joints)}
    if mapping.free_joint is not None:
        joint_of[mapping.free_joint] = first - 1
    root = model.body_rootid[model.jnt_bodyid[mapping.joints[0]]]
    movers = {0: 0}
    # MuJoCo has a body after the one that carries it.
    for body in (int(b) for b in np.flatnonzero(model.body_rootid == root)):
        start = int(model.body_jntadr[body])
        own = [j for j in range(start, start + int(model.body_jntnum[body])) if j in joint_of]
        movers[body] = joint_of[own[-1]] if own else movers[int(model.body_parentid[body])]
    return movers


def _frames(robot: Robot, model: mujoco.MjModel, mapping: StateMap, prefix: str) -> list[str]:
    """Links that a joint moves, and whose frames stand elsewhere in the model, by name."""
    bodies = {
        k: body
        for k, frame in enumerate(robot.model.frames)
        if frame.type == pin.FrameType.BODY
        and (body := mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, prefix + frame.name)) >= 0
        and model.body_weldid[body]
    }
    apart = dict.fromkeys(bodies, (0.0, 0.0))
    for q in (robot.q_home, _swung(robot)):
        data, ours = _in_mujoco(model, mapping, q), robot.model.createData()
        pin.framesForwardKinematics(robot.model, ours, q)
        for k, body in bodies.items():
            place = np.linalg.norm(data.xpos[body] - ours.oMf[k].translation)
            turned = ours.oMf[k].rotation.T @ data.xmat[body].reshape(3, 3)
            angle = np.linalg.norm(pin.log3(turned))
            apart[k] = max(apart[k][0], float(place)), max(apart[k][1], float(angle))
    wrong = {k: max(p / _PLACE_TOLERANCE, a / _AXIS_TOLERANCE) for k, (p, a) in apart.items()}
    most = max(wrong, key=lambda k: wrong[k], default=None)
    if most is None or wrong[most] <= 1.0:
        return []
    return [
        f"frames of {sum(size > 1.0 for size in wrong.values())} links, most "
        f"{robot.model.frames[most].name}: {1e3 * apart[most][0]:.3g} mm and "
        f"{apart[most][1]:.3g} rad apart"
    ]


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


def _in_mujoco(
    model: mujoco.MjModel, mapping: StateMap, q: Float64[np.ndarray, " nq"]
) -> mujoco.MjData:
    """Kinematics of the model in a configuration of the robot."""
    data = mujoco.MjData(model)
    data.qpos[:] = mapping.qpos(q)
    mujoco.mj_kinematics(model, data)
    return data


def _swung(robot: Robot) -> Float64[np.ndarray, " nq"]:
    """The home posture with every joint turned away from it."""
    q = robot.q_home.copy()
    q[-robot.nj :] += _SWING * np.where(np.arange(robot.nj) % 2, 1.0, -1.0)
    return q


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
    data = _in_mujoco(model, mapping, q)
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
        "is rigidly one with the robot's base: load the robot from the MJCF of this model",
    )
