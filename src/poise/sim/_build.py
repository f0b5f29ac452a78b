"""A MuJoCo model built from a `Robot`: its own document, a floor, soles, motors, sensors.

The model is a second, independent one: it is parsed from the document, not made from Pinocchio's.
"""

from collections.abc import Generator
from contextlib import contextmanager

import mujoco
import numpy as np
from jaxtyping import Float64

from poise.errors import RobotError, UnknownNameError
from poise.robots import FrameRole, Robot, compile_spec, drop_meshes, free_name
from poise.sim._config import Payload, PlantConfig
from poise.sim._document import add_sticks, convert_meshes, parse_document, weld_joints
from poise.sim._self_contact import exclude_lasting_contacts, let_touch

# Collision bits of the robot's geometry: it meets the ground, never itself
FLOOR_ONLY = {"contype": 0, "conaffinity": 1}

_HIDDEN_GROUP = 3  # MuJoCo's viewers do not draw geometry of this group unless asked to

_LOOKS = """<mujoco>
  <asset>
    <texture name="sky" type="skybox" builtin="gradient" width="128" height="128"
      rgb1="0.93 0.95 0.98" rgb2="0.70 0.78 0.88"/>
    <texture name="checker" type="2d" builtin="checker" width="256" height="256"
      rgb1="0.86 0.88 0.90" rgb2="0.76 0.79 0.82"/>
    <material name="floor" texture="checker" texrepeat="2 2" texuniform="true"/>
  </asset>
  <worldbody>
    <light name="sun" type="directional" pos="0 0 4" dir="-0.4 0.3 -1" castshadow="false"
      diffuse="0.5 0.5 0.5" specular="0.1 0.1 0.1"/>
  </worldbody>
</mujoco>"""


def build_model(robot: Robot, config: PlantConfig, *, pictures: bool = False) -> mujoco.MjModel:
    """Build and compile the MuJoCo model of a robot in its world; motor i drives joint i."""
    soles = [robot.roles[name] for name in robot.soles]
    spec = parse_document(robot.source)
    spec.modelname = robot.name
    _set_options(spec, config)
    _place_base(spec, robot)
    _set_joints(spec, robot, config)
    if not any(body.geoms for body in spec.bodies[1:]):
        add_sticks(spec)
    feet = [body for role in soles for body in _rigid_with(_body(spec, role.link, robot))]
    touching = list[mujoco.MjsGeom]()
    for body in spec.bodies[1:]:
        solid, foot = [geom for geom in body.geoms if _is_solid(geom)], body in feet
        covers = solid or ([*body.geoms] if config.self_contact else [])
        touching += covers
        for geom in covers:
            # A sole takes the place of a foot's geometry. Not deleted: mass may come from it.
            geom.contype, geom.conaffinity = (0, 0) if foot else FLOOR_ONLY.values()
            if solid and (foot or len(body.geoms) > len(solid)):  # behind pictures
                geom.group = _HIDDEN_GROUP
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
        for name in ("gyro", "accelerometer"):
            kind = getattr(mujoco.mjtSensor, f"mjSENS_{name.upper()}")
            site = mujoco.mjtObj.mjOBJ_SITE
            spec.add_sensor(name=name, type=kind, objtype=site, objname=robot.pelvis)
    _add_looks(spec)
    _add_ground(spec, robot, config)
    if not pictures:
        drop_meshes(mujoco, spec, _is_solid)
    if robot.source.kind == "urdf":
        convert_meshes(spec)
    model = _compile(spec, robot)
    if config.self_contact:
        exclude_lasting_contacts(spec, model, robot)
        model = _compile(spec, robot)
    _apply_model_error(model, robot, config)
    return model


def _is_solid(geom: mujoco.MjsGeom) -> bool:
    return bool(geom.contype or geom.conaffinity)


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
    where = f"robot {robot.name!r}"
    try:
        return compile_spec(spec, where)
    except RobotError as error:
        if robot.source.kind != "urdf" or "mesh volume is too small" not in str(error):
            raise
    # A flat mesh, which is drawn all the same: the links of a URDF have their inertia.
    for mesh in spec.meshes:
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    return compile_spec(spec, where)


def _set_options(spec: mujoco.MjSpec, config: PlantConfig) -> None:
    option = spec.option
    option.timestep = config.physics_dt
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    # Friction is so much stiffer than normals: a standing foot stays.
    option.impratio = 10.0
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    # A diverged run must be reported, not silently restarted.
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET


def _place_base(spec: mujoco.MjSpec, robot: Robot) -> None:
    """Give a floating base its free joint: without one MuJoCo welds the root to the world."""
    for joint in [j for j in spec.joints if j.type == mujoco.mjtJoint.mjJNT_FREE]:
        spec.delete(joint)
    if robot.floating_base:
        root = spec.worldbody.first_body()
        root.add_freejoint(name=free_name("floating_base", [joint.name for joint in spec.joints]))
        root.pos, root.quat = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)


def _set_joints(spec: mujoco.MjSpec, robot: Robot, config: PlantConfig) -> None:
    """Weld the locked joints, and give the others the robot's rotor inertias."""
    weld_joints(spec, robot.source.locked_joints)
    armature = dict(zip(robot.joint_names, robot.model.armature[robot.base_dofs :], strict=True))
    for joint in spec.joints:
        if joint.type == mujoco.mjtJoint.mjJNT_FREE:
            continue
        joint.armature = float(armature.get(joint.name, 0.0))
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
    # The list grows during the iteration.
    for part in rigid:
        rigid += [child for child in part.bodies if not child.joints]
    return rigid


def _add_sole(
    spec: mujoco.MjSpec, robot: Robot, role: FrameRole, thickness: float = 0.02
) -> mujoco.MjsGeom:
    """Put a thin box on the foot whose lower face is the sole: contact points are its corners."""
    sole = robot.soles[role.name]
    half = np.array([sole.length / 2, sole.width / 2, thickness / 2])
    body = _body(spec, role.link, robot)
    return body.add_geom(
        name=f"{role.name}_contact",
        group=_HIDDEN_GROUP if body.geoms else 0,
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=half,
        pos=role.position + role.rotation @ np.array([0.0, 0.0, half[2]]),
        quat=_quaternion(role.rotation),
        rgba=(0.25, 0.27, 0.3, 1.0),
        mass=0.0,
        **FLOOR_ONLY,
    )


def _add_payload(spec: mujoco.MjSpec, robot: Robot, payload: Payload) -> None:
    offset = np.array(payload.offset, dtype=np.float64)
    role = robot.roles.get(payload.frame)
    ball = _body(spec, role.link if role else payload.frame, robot).add_body(
        pos=role.position + role.rotation @ offset if role else offset,
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
        # Motors with drives of their own limit their torques themselves.
        motor.forcelimited = bool(np.isfinite(limit)) and config.motors is None
        if config.actuation == "torque":
            motor.set_to_motor()
        else:
            kp, kd = config.servo.stiffness * limit, config.servo.damping * limit
            motor.set_to_position(kp=kp, kv=kd)


def _add_ground(spec: mujoco.MjSpec, robot: Robot, config: PlantConfig) -> None:
    """Add floor and blocks; a fixed-base robot has a floor to look at that it cannot touch."""
    surface = {
        "contype": int(robot.floating_base),
        "conaffinity": 0,
        "condim": 3,  # Sliding only: a sole's yaw moment comes from its corners, as it should.
        "friction": (config.friction, 0.0, 0.0),
        "solref": (config.contact_time_constant, 1.0),
        # Stiff from touchdown: a 100 kg robot sinks in by about 0.01 mm.
        "solimp": (0.95, 0.99, 0.001, 0.5, 2.0),
        "priority": 1,  # The ground sets the contact parameters, not the robot's document.
    }
    slope = np.array([1.0, 0.0, 0.0, 0.0])
    mujoco.mju_quatIntegrate(slope, np.array([*config.floor_slope, 0.0]), 1.0)
    spec.worldbody.add_geom(
        name="floor",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=(0.0, 0.0, 0.05),
        quat=slope,
        material="plant_floor",
        **surface,
    )
    for i, block in enumerate(config.blocks):
        spec.worldbody.add_geom(
            name=f"block{i}",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=0.5 * np.array(block.size),
            pos=block.pose.translation,
            quat=_quaternion(block.pose.rotation),
            rgba=(0.55, 0.6, 0.65, 1.0),
            **surface,
        )


def _add_looks(spec: mujoco.MjSpec) -> None:
    """Light colours, no shadows and no reflections: software rendering is slow enough."""
    world = mujoco.MjSpec.from_string(_LOOKS)
    spec.attach(world, prefix="plant_", frame=spec.worldbody.add_frame())
    light, quality = spec.visual.headlight, spec.visual.quality
    light.ambient, light.diffuse, light.specular = (np.full(3, x) for x in (0.34, 0.3, 0.05))
    # Balls and cylinders of fewer facets than MuJoCo's default: a third off the time of a picture.
    quality.numslices, quality.numstacks = 20, 10


def _apply_model_error(model: mujoco.MjModel, robot: Robot, config: PlantConfig) -> None:
    """Scale masses and inertias of links, and shift centres of mass; payloads stay."""
    links = {name: i for i in range(1, model.nbody) if (name := model.body(i).name)}
    bodies = [*links.values()]
    model.body_mass[bodies] *= config.mass_scale
    model.body_inertia[bodies] *= config.mass_scale * config.inertia_scale
    for error in config.link_errors:
        if error.link not in links:
            wrong = f"unknown link of robot {robot.name!r}"
            raise UnknownNameError(wrong, got=error.link, choices=[*links])
        body = links[error.link]
        model.body_mass[body] *= error.mass_scale
        model.body_inertia[body] *= error.mass_scale * error.inertia_scale
        model.body_ipos[body] += np.array(error.com_offset)
        # MuJoCo skips the offset of the inertial frame where a body is flagged to have none.
        model.body_sameframe[body] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
        model.body_simple[body] = 0
    # Quantities derived from the masses (subtree masses, inverse weights) must follow.
    mujoco.mj_setConst(model, mujoco.MjData(model))


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
