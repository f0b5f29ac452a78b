"""Comparison of a user's MuJoCo model with the controller's robot.

Joints that stand or turn elsewhere are refused. What may be meant so, such as a heavier link, is
described in a sentence.
"""

from collections.abc import Sequence

import mujoco
import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._show import few
from poise.errors import RobotError
from poise.robots import GRAVITY, Robot
from poise.sim._drives import Drives, Joints
from poise.sim._mapping import StateMap

Lines = Float64[np.ndarray, "nj 2 3"]  # origin [m] and axis of each joint

# Places written in metres to four decimals are off by up to 0.05 mm an axis, so by sqrt(3) 0.05 mm
# a joint, and by this much after the twelve joints from a floating base to a hand [m].
_PLACE_TOLERANCE = 1e-3

# Angles written to three decimals are off by up to 0.0005 rad an axis, so by sqrt(3) 0.0005 rad a
# joint; six joints that turn about one axis, as in a leg or an arm, turn them by this much [rad].
_AXIS_TOLERANCE = 5e-3
_TOLERANCES = np.array([_PLACE_TOLERANCE, _AXIS_TOLERANCE])

_MASS_TOLERANCE = 5e-3  # relative difference of masses written with three digits
_MASS_STEP = 1e-3  # difference of masses written in kilograms to three decimals [kg]

_RELATIVE_TOLERANCE = 1e-2  # of other quantities: smaller differences are left out
_WRONG_WHERE_SPARSE = "4.0.0"  # MuJoCo whose sparse Cholesky factorization is wrong (issue 3767)


def find_base(robot: Robot, model: mujoco.MjModel, prefix: str) -> pin.SE3 | None:
    """Pose of the base in the body of the free joint, None for the same; refuse other joints."""
    mapping = StateMap(robot, model, prefix=prefix)
    postures = [pin.neutral(robot.model), pin.neutral(robot.model)]
    for q, joints in zip(postures, (robot.q_home, _swung(robot)), strict=True):
        q[-robot.nj :] = joints[-robot.nj :]
    ours = np.array([_lines_in_pinocchio(robot, q) for q in postures])
    theirs = np.array([_lines_in_mujoco(mapping, q) for q in postures])
    if (np.linalg.norm(ours - theirs, axis=-1) <= _TOLERANCES).all():
        return None
    placement = _rigid_motion(ours[0], theirs[0])
    moved = ours @ placement.rotation.T
    moved[..., 0, :] += placement.translation
    apart = np.linalg.norm(moved - theirs, axis=-1).max(axis=0)
    mismatch = (apart / _TOLERANCES).max(axis=1)
    if mismatch.max() > 1.0:
        order = [k for k in np.argsort(-mismatch).tolist() if mismatch[k] > 1.0]
        raise RobotError(
            f"joints of robot {robot.name!r} stand or turn elsewhere in the MuJoCo model",
            got=few(
                [
                    f"{robot.joint_names[k]}: {1e3 * apart[k, 0]:.3g} mm, {apart[k, 1]:.3g} rad"
                    for k in order
                ]
            ),
            wanted="the same zeros, signs and places of all joints, and the free joint in a body "
            "that is rigidly one with the robot's base: load the robot from the MJCF of this model",
        )
    if not robot.floating_base:
        raise RobotError(
            f"the fixed base of robot {robot.name!r} stands elsewhere in the MuJoCo model",
            got=f"{np.round(placement.translation, 4).tolist()} m, turned by "
            f"{np.linalg.norm(pin.log3(placement.rotation)):.4f} rad",
            wanted="the place that the robot's own document gives it",
        )
    return placement


def differences(
    robot: Robot,
    model: mujoco.MjModel,
    mapping: StateMap,
    drives: Drives,
    tendons: Sequence[str],
    prefix: str,
) -> tuple[str, ...]:
    """Properties of a MuJoCo model missing from the controller's model, a sentence each."""
    joints, none = list(mapping.joints), np.zeros(robot.nj)
    dofs = model.jnt_dofadr[joints]
    # Ranges may be wider than those of the controller, which keeps to its own.
    span = np.where(model.jnt_limited[joints], model.jnt_range[joints].T, [[-np.inf], [np.inf]])
    reach = drives.strength(robot.q_home[-robot.nj :])
    compared = {
        ("armature", "kg m^2"): (
            model.dof_armature[dofs] + drives.armature,
            robot.model.armature[robot.base_dofs :],
        ),
        ("joint damping", "N m s/rad"): (model.dof_damping[dofs] + drives.damping, none),
        ("dry friction", "N m"): (model.dof_frictionloss[dofs], none),
        ("joint stiffness", "N m/rad"): (model.jnt_stiffness[joints], none),
        ("torque limits", "N m"): (
            np.minimum(np.minimum(-reach[0], reach[1]), robot.tau_max),
            robot.tau_max,
        ),
        ("lower position limits", "rad"): (np.maximum(span[0], robot.q_min), robot.q_min),
        ("upper position limits", "rad"): (np.minimum(span[1], robot.q_max), robot.q_max),
    }
    listed = {
        "tendons that resist or limit its joints": tendons,
        "joints whose actuators act late (a filter or a delay)": drives.delayed,
        "joints that no actuator moves, so that torques go through data.qfrc_applied": [
            robot.joint_names[k] for k in drives.unactuated
        ],
        "joints on the robot that its description lacks or locks, which are left alone": (
            _strangers(model, mapping)
        ),
    }
    return (
        *_bodies(robot, model, mapping),
        *_frames(robot, model, mapping, prefix),
        *(
            line
            for (what, unit), (theirs, ours) in compared.items()
            for line in _worst(what, unit, robot.joint_names, theirs, ours)
        ),
        *(f"{what}: {', '.join(names)}" for what, names in listed.items() if names),
        *_world(model),
    )


def _worst(what: str, unit: str, names: Sequence[str], model: Joints, robot: Joints) -> list[str]:
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


def _bodies(robot: Robot, model: mujoco.MjModel, mapping: StateMap) -> list[str]:
    """Mass, and centre of mass at home: of the whole robot, and of what each joint moves."""
    data, ours = mapping.at(robot.q_home), robot.model.createData()
    pin.forwardKinematics(robot.model, ours, robot.q_home)
    masses, centers = np.zeros(robot.model.njoints), np.zeros((robot.model.njoints, 3))
    for body, joint in mapping.movers().items():
        masses[joint] += model.body_mass[body]
        centers[joint] += model.body_mass[body] * data.xipos[body]
    own = np.array([inertia.mass for inertia in robot.model.inertias])
    own[0] = masses[0] = 0.0  # Bodies fixed to the world move no joint.
    levers = [pose.act(i.lever) for pose, i in zip(ours.oMi, robot.model.inertias, strict=True)]
    places = np.array(levers)
    total, com = masses.sum(), centers[1:].sum(axis=0) / masses.sum()
    off, names = np.abs(masses - own), robot.model.names
    lines = list[str]()
    differ = off > np.maximum(_MASS_TOLERANCE * own, _MASS_STEP)
    if differ.any() or abs(total - robot.mass) > _MASS_TOLERANCE * robot.mass:
        k = int(off.argmax())
        lines.append(
            f"mass: {total:.4g} kg in the model, {robot.mass:.4g} kg to the controller; most what "
            f"{names[k]} moves: {masses[k]:.4g} kg and {own[k]:.4g} kg"
        )
    heavy = np.flatnonzero(np.minimum(masses, own) > _MASS_STEP)
    apart = np.zeros(len(own))
    apart[heavy] = np.linalg.norm(centers[heavy] / masses[heavy, None] - places[heavy], axis=1)
    whole = float(np.linalg.norm(com - own @ places / robot.mass))
    # Joints may be apart by half of it; the rest is that of three decimals, sqrt(3) 0.5 mm.
    if max(whole, apart.max()) > 2.0 * _PLACE_TOLERANCE:
        k = int(apart.argmax())
        lines.append(
            f"centre of mass at home: {1e3 * whole:.1f} mm apart; most of what "
            f"{names[k]} moves: {1e3 * apart[k]:.1f} mm"
        )
    return lines


def _frames(robot: Robot, model: mujoco.MjModel, mapping: StateMap, prefix: str) -> list[str]:
    """A sentence on links that a joint moves, and whose frames stand elsewhere in the model."""
    bodies = {
        k: body
        for k, frame in enumerate(robot.model.frames)
        if frame.type == pin.FrameType.BODY
        and (body := mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, prefix + frame.name)) >= 0
        and model.body_weldid[body]
    }
    if not bodies:
        return []
    apart = np.zeros((len(bodies), 2))
    for q in (robot.q_home, _swung(robot)):
        data, ours = mapping.at(q), robot.model.createData()
        pin.framesForwardKinematics(robot.model, ours, q)
        for k, (frame, body) in enumerate(bodies.items()):
            pose = ours.oMf[frame]
            place = np.linalg.norm(data.xpos[body] - pose.translation)
            turned = pin.log3(pose.rotation.T @ data.xmat[body].reshape(3, 3))
            apart[k] = np.maximum(apart[k], (place, np.linalg.norm(turned)))
    wrong = (apart / _TOLERANCES).max(axis=1)
    most = int(wrong.argmax())
    if wrong[most] <= 1.0:
        return []
    return [
        f"frames of {int((wrong > 1.0).sum())} links, most "
        f"{robot.model.frames[[*bodies][most]].name}: {1e3 * apart[most, 0]:.3g} mm and "
        f"{apart[most, 1]:.3g} rad apart"
    ]


def _strangers(model: mujoco.MjModel, mapping: StateMap) -> list[str]:
    """Joints in the robot's tree of bodies that are not the robot's."""
    there = np.flatnonzero(np.isin(model.jnt_bodyid, [*mapping.movers()])).tolist()
    others = set(there) - {*mapping.joints, mapping.free_joint}
    return [model.joint(j).name or f"joint {j}" for j in sorted(others)]


def _world(model: mujoco.MjModel) -> list[str]:
    """Gravity, the time step, and a constraint solver that may go wrong."""
    lines: list[str] = []
    gravity = np.array(model.opt.gravity)
    if np.abs(gravity - [0.0, 0.0, -GRAVITY]).max() > _RELATIVE_TOLERANCE * GRAVITY:
        lines.append(f"gravity: {gravity.tolist()} m/s^2, not {GRAVITY} downwards")
    if model.body_gravcomp.any():
        lines.append("bodies whose gravity the simulator compensates (gravcomp)")
    if (step := float(model.opt.timestep)) > 5e-3:
        lines.append(f"time step: {1e3 * step:.4g} ms; feet chatter above some 5 ms")
    newton = model.opt.solver == mujoco.mjtSolver.mjSOL_NEWTON
    if newton and mujoco.mj_isSparse(model) and mujoco.__version__ == _WRONG_WHERE_SPARSE:
        lines.append(
            f"constraint Jacobian: sparse, with which Newton's method of MuJoCo "
            f"{_WRONG_WHERE_SPARSE} may go wrong; "
            "set model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE"
        )
    return lines


def _swung(robot: Robot, angle: float = 0.4) -> Float64[np.ndarray, " nq"]:
    """The home posture with every joint turned away from it, where wrong signs show."""
    q = robot.q_home.copy()
    q[-robot.nj :] += angle * np.where(np.arange(robot.nj) % 2, 1.0, -1.0)
    return q


def _lines_in_pinocchio(robot: Robot, q: Float64[np.ndarray, " nq"]) -> Lines:
    model, data = robot.model, robot.model.createData()
    # Pinocchio gives that of a single joint as a vector.
    columns = pin.computeJointJacobians(model, data, q).reshape(6, -1)[:, -robot.nj :]
    # A hinge turns about its axis, a slide moves along it.
    axes = np.where(columns[3:].any(axis=0), columns[3:], columns[:3])
    origins = [data.oMi[i].translation for i in range(model.njoints - robot.nj, model.njoints)]
    return np.stack((origins, axes.T), axis=1)


def _lines_in_mujoco(mapping: StateMap, q: Float64[np.ndarray, " nq"]) -> Lines:
    data, joints = mapping.at(q), list(mapping.joints)
    return np.stack((data.xanchor[joints], data.xaxis[joints]), axis=1)


def _rigid_motion(ours: Lines, theirs: Lines) -> pin.SE3:
    """The rigid motion from our joints to theirs, by least squares (Kabsch)."""
    centers = ours[:, 0].mean(axis=0), theirs[:, 0].mean(axis=0)
    a = np.vstack((ours[:, 0] - centers[0], ours[:, 1]))
    b = np.vstack((theirs[:, 0] - centers[1], theirs[:, 1]))
    u, _, vt = np.linalg.svd(a.T @ b)
    flip = np.diag([1.0, 1.0, np.sign(np.linalg.det(vt.T @ u.T))])
    rotation = vt.T @ flip @ u.T
    return pin.SE3(rotation, centers[1] - rotation @ centers[0])
