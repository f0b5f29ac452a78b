"""A MuJoCo model built from a `Robot`: its own document, a floor, soles, motors, sensors.

The model is a second, independent one: it is parsed from the document, not made from Pinocchio's.

The plant made different from its description, which the controller keeps.
"""

from collections.abc import Generator, Iterable
from contextlib import contextmanager

import mujoco
import numpy as np
from jaxtyping import Float64

from poise.errors import RobotError, UnknownNameError
from poise.robots import FrameRole, Robot, drop_meshes, free_name
from poise.sim._config import PlantConfig
from poise.sim._disturbances import LinkError, Payload
from poise.sim._document import add_sticks, convert_meshes, parse_document
from poise.sim._self_contact import covers, exclude_lasting_contacts, let_touch
from poise.sim._weld import weld_joints
from poise.sim._world import FLOOR_ONLY, add_world


def apply_model_error(model: mujoco.MjModel, robot: Robot, config: PlantConfig) -> None:
    """Scale masses and inertias and shift centres of mass in a compiled model.

    Payloads and geometry of our own keep their mass.
    """
    names = [model.body(i).name for i in range(model.nbody)]
    links = [i for i, name in enumerate(names) if name and name != "world"]
    model.body_mass[links] *= config.mass_scale
    model.body_inertia[links] *= config.mass_scale * config.inertia_scale
    for error in config.link_errors:
        if error.link not in names:
            raise UnknownNameError(
                f"unknown link of robot {robot.name!r}",
                got=error.link,
                choices=[names[i] for i in links],
            )
        _apply_to_link(model, names.index(error.link), error)
    # Quantities derived from the masses (subtree masses, inverse weights) must follow.
    mujoco.mj_setConst(model, mujoco.MjData(model))


def _apply_to_link(model: mujoco.MjModel, body: int, error: LinkError) -> None:
    model.body_mass[body] *= error.mass_scale
    model.body_inertia[body] *= error.mass_scale * error.inertia_scale
    model.body_ipos[body] += np.array(error.com_offset)
    # MuJoCo skips the offset of the inertial frame where a body says it has none.
    model.body_sameframe[body] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
    model.body_simple[body] = 0


_SOLE_THICKNESS = 0.02
"""The box under a foot reaches this far up from the sole [m]; only its lower face matters."""

_FRICTION_IMPEDANCE = 10.0
"""Friction is this much stiffer than the normal direction, so a standing foot does not creep."""

_BASE_JOINT = "floating_base"
_HIDDEN_GROUP = 3
"""MuJoCo's viewers do not draw geometry of this group unless asked to."""


def build_model(robot: Robot, config: PlantConfig, *, pictures: bool = False) -> mujoco.MjModel:
    """Build and compile the MuJoCo model of a robot in its world.

    Bodies, joints and sites carry the names of links, joints and frame roles; motor i drives
    `robot.joint_names[i]`.
    """
    soles = [robot.roles[name] for name in robot.soles]
    spec = parse_document(robot.source)
    spec.modelname = robot.name
    _set_options(spec, config)
    _place_base(spec, robot)
    _set_joints(spec, robot, config)
    if not any(body.geoms for body in spec.bodies[1:]):
        add_sticks(spec)
    feet = [body for role in soles for body in _rigid_with(_body(spec, role.link, robot))]
    touching = covers(spec) if config.self_contact else []
    _bare_feet(feet)
    _make_solid(geom for geom in touching if geom.parent not in feet)
    _sort_geometry(spec)
    for role in robot.roles.values():
        _body(spec, role.link, robot).add_site(
            name=role.name, pos=role.position, quat=_quaternion(role.rotation), group=5
        )
    boxes = [_add_sole(spec, robot, role) for role in soles]
    if config.self_contact:
        let_touch([*touching, *boxes], config.contact_time_constant)
    for payload in config.payloads:
        _add_payload(spec, robot, payload)
    _add_motors(spec, robot, config)
    if robot.floating_base:
        _add_imu(spec, robot)
    add_world(spec, robot, config)
    if not pictures:
        drop_meshes(mujoco, spec, lambda geom: bool(geom.contype or geom.conaffinity))
    if robot.source.kind == "urdf":
        convert_meshes(spec)
    model = _compile(spec, robot)
    if config.self_contact:
        exclude_lasting_contacts(spec, model, robot)
        model = _compile(spec, robot)
    apply_model_error(model, robot, config)
    return model


@contextmanager
def _uncached() -> Generator[None]:
    """Keep meshes out of MuJoCo's cache, where a second copy would stay as long as the process."""
    cache = mujoco.mj_getCache()
    capacity = mujoco.mj_getCacheCapacity(cache)
    mujoco.mj_setCacheCapacity(cache, mujoco.mj_getCacheSize(cache))
    try:
        yield
    finally:
        mujoco.mj_setCacheCapacity(cache, capacity)


@_uncached()
def _compile(spec: mujoco.MjSpec, robot: Robot) -> mujoco.MjModel:
    try:
        try:
            return spec.compile()
        except ValueError as error:
            if robot.source.kind != "urdf" or "mesh volume is too small" not in str(error):
                raise
        # A flat mesh, which is drawn all the same: a URDF's links say their inertia.
        for mesh in spec.meshes:
            mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
        return spec.compile()
    except ValueError as error:
        raise RobotError(f"MuJoCo cannot build robot {robot.name!r}: {error}") from error


def _set_options(spec: mujoco.MjSpec, config: PlantConfig) -> None:
    option = spec.option
    option.timestep = config.physics_dt
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.impratio = _FRICTION_IMPEDANCE
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    # A diverged run must be seen, not silently started again.
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET


def _place_base(spec: mujoco.MjSpec, robot: Robot) -> None:
    """Give a floating base its free joint: without one MuJoCo welds the root to the world."""
    free = [j for j in spec.joints if j.type == mujoco.mjtJoint.mjJNT_FREE]
    for joint in free:
        spec.delete(joint)
    if robot.floating_base:
        root = spec.worldbody.first_body()
        root.add_freejoint(name=free_name(_BASE_JOINT, [joint.name for joint in spec.joints]))
        root.pos, root.quat = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)


def _set_joints(spec: mujoco.MjSpec, robot: Robot, config: PlantConfig) -> None:
    """Weld the locked joints, and give the others the robot's rotor inertias."""
    weld_joints(spec, robot.source.locked_joints)
    armature = {
        name: float(robot.model.armature[joint.idx_v])
        for name, joint in zip(robot.model.names, robot.model.joints, strict=True)
        if joint.nv == 1
    }
    for joint in spec.joints:
        if joint.type == mujoco.mjtJoint.mjJNT_FREE:
            continue
        joint.armature = armature.get(joint.name, 0.0)
        joint.damping = (config.joint_damping, 0.0, 0.0)
        joint.frictionloss = config.joint_friction
        # The motors saturate at the robot's own limits; a second clamp could only contradict them.
        joint.actfrclimited = mujoco.mjtLimited.mjLIMITED_FALSE


def _rigid_with(body: mujoco.MjsBody) -> list[mujoco.MjsBody]:
    """All bodies that are rigidly one with it, itself among them."""
    top = body
    while not top.joints and top.parent.name != "world":
        top = top.parent
    rigid = [top]
    # The list grows as it is gone through.
    for part in rigid:
        rigid += [child for child in part.bodies if not child.joints]
    return rigid


def _make_solid(geoms: Iterable[mujoco.MjsGeom]) -> None:
    """Let geometry that was made to look at be met by the ground, too."""
    for geom in geoms:
        geom.contype, geom.conaffinity = FLOOR_ONLY


def _bare_feet(feet: Iterable[mujoco.MjsBody]) -> None:
    """Switch off the document's own collision geometry on everything rigidly one with a sole.

    Contact geometry of our own takes its place, so that the ground meets the foot exactly on the
    plane of the sole.
    """
    for body in feet:
        for geom in [g for g in body.geoms if g.contype or g.conaffinity]:
            # Not deleted: in an MJCF the body's mass may come from it.
            geom.contype, geom.conaffinity = 0, 0
            geom.group = _HIDDEN_GROUP


def _sort_geometry(spec: mujoco.MjSpec) -> None:
    """Let the robot's geometry touch the ground only, and hide it behind pictures if there are."""
    for body in spec.bodies:
        solid = [g for g in body.geoms if g.contype or g.conaffinity]
        pictures = len(body.geoms) > len(solid)
        for geom in solid:
            geom.contype, geom.conaffinity = FLOOR_ONLY
            if pictures:
                geom.group = _HIDDEN_GROUP


def _add_sole(spec: mujoco.MjSpec, robot: Robot, role: FrameRole) -> mujoco.MjsGeom:
    """Put a thin box on the foot whose lower face is the sole: contact points are its corners."""
    sole = robot.soles[role.name]
    half = np.array([sole.length / 2, sole.width / 2, _SOLE_THICKNESS / 2])
    center = role.position + role.rotation @ np.array([0.0, 0.0, half[2]])
    body = _body(spec, role.link, robot)
    return body.add_geom(
        name=f"{role.name}_contact",
        group=_HIDDEN_GROUP if body.geoms else 0,
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=half,
        pos=center,
        quat=_quaternion(role.rotation),
        contype=FLOOR_ONLY[0],
        conaffinity=FLOOR_ONLY[1],
        rgba=(0.25, 0.27, 0.3, 1.0),
        mass=0.0,
    )


def _add_payload(spec: mujoco.MjSpec, robot: Robot, payload: Payload) -> None:
    offset = np.array(payload.offset, dtype=np.float64)
    role = robot.roles.get(payload.frame)
    body = _body(spec, role.link if role else payload.frame, robot)
    position = role.position + role.rotation @ offset if role else offset
    ball = body.add_body(
        pos=position,
        mass=payload.mass,
        inertia=(payload.inertia,) * 3,
        # Left out, MuJoCo puts the centre of mass as far off again as the body itself.
        ipos=(0.0, 0.0, 0.0),
        iquat=(1.0, 0.0, 0.0, 0.0),
        explicitinertial=True,
    )
    ball.add_geom(
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=(payload.radius, 0.0, 0.0),
        contype=0,
        conaffinity=0,
        group=1,
        rgba=(0.8, 0.35, 0.1, 1.0),
    )


def _add_motors(spec: mujoco.MjSpec, robot: Robot, config: PlantConfig) -> None:
    """One motor a joint: its control is a torque, or the position of a PD servo."""
    for name, limit in zip(robot.joint_names, robot.tau_max, strict=True):
        motor = spec.add_actuator(
            name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT, forcerange=(-limit, limit)
        )
        motor.forcelimited = bool(np.isfinite(limit))
        if config.actuation == "torque":
            motor.set_to_motor()
        else:
            kp, kd = config.servo.stiffness * limit, config.servo.damping * limit
            motor.gaintype = mujoco.mjtGain.mjGAIN_FIXED
            motor.biastype = mujoco.mjtBias.mjBIAS_AFFINE
            motor.gainprm[0] = kp
            motor.biasprm[1:3] = (-kp, -kd)


def _add_imu(spec: mujoco.MjSpec, robot: Robot) -> None:
    for name, kind in (
        ("gyro", mujoco.mjtSensor.mjSENS_GYRO),
        ("accelerometer", mujoco.mjtSensor.mjSENS_ACCELEROMETER),
    ):
        spec.add_sensor(
            name=name, type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname=robot.pelvis
        )


def _body(spec: mujoco.MjSpec, name: str, robot: Robot) -> mujoco.MjsBody:
    body = spec.body(name)
    if body is None:
        raise UnknownNameError(
            "unknown frame or link",
            got=name,
            choices=(*robot.roles, *(b.name for b in spec.bodies if b.name != "world")),
        )
    return body


def _quaternion(rotation: Float64[np.ndarray, "3 3"]) -> Float64[np.ndarray, "4"]:
    """MuJoCo's quaternion (w, x, y, z) of a rotation matrix."""
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(rotation).ravel())
    return quaternion
