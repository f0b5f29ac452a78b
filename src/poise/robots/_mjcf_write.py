"""`mjcf_of`: MJCF text of a model in memory, of MuJoCo or of Pinocchio."""

import xml.etree.ElementTree as ET
from typing import Any

import numpy as np
import pinocchio as pin

from poise.errors import RobotError
from poise.robots._document import free_name
from poise.robots._limits import NO_LIMIT
from poise.robots._mjcf_compile import compile_spec, mujoco_module

_SIZES = {"SPHERE": 1, "CAPSULE": 2, "ELLIPSOID": 3, "CYLINDER": 2, "BOX": 3, "PLANE": 3}
"""Kinds of geoms beside meshes that are written, and how many sizes they have."""


def mjcf_of(given: Any, geometry: pin.GeometryModel | None = None) -> str:
    """Write a model as MJCF."""
    if isinstance(given, pin.Model):
        return _of_pinocchio(given, geometry).text
    mujoco = mujoco_module("a MuJoCo model")
    if isinstance(given, mujoco.MjSpec):
        spec = given.copy()
        # Links stay apart, with what can be seen of them.
        spec.compiler.fusestatic = spec.compiler.discardvisual = False
        given = compile_spec(spec, "the specification")
    return _of_mujoco(mujoco, given).text


class _Writer:
    """MJCF document under construction."""

    def __init__(self, name: str) -> None:
        self._root = ET.Element("mujoco", model=name)
        ET.SubElement(self._root, "compiler", angle="radian", autolimits="false")
        self._asset = self.section("asset")
        self.world = self.section("worldbody")

    @property
    def text(self) -> str:
        return ET.tostring(self._root, encoding="unicode")

    def section(self, tag: str) -> ET.Element:
        return ET.SubElement(self._root, tag)

    def mesh(self, name: str, vertices: Any, faces: Any) -> str:
        """The name of a mesh, which is written once."""
        if all(element.get("name") != name for element in self._asset):
            # A shell has an inertia, whatever its triangles enclose.
            points = {"vertex": np.ravel(vertices), "face": np.ravel(faces).astype(int)}
            _add(self._asset, "mesh", name=name, inertia="shell", **points)
        return name


def _add(parent: ET.Element, tag: str, **attributes: Any) -> ET.Element:
    """Add an element with texts, truths, numbers and arrays; None is left out."""
    return ET.SubElement(
        parent, tag, {k: _written(v) for k, v in attributes.items() if v is not None}
    )


def _written(value: Any) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, bool | np.bool_):
        return "true" if value else "false"
    return " ".join(map(repr, np.atleast_1d(value).tolist()))


def _of_mujoco(mujoco: Any, model: Any) -> _Writer:
    writer, bodies = _Writer(model.names.split(b"\0", 1)[0].decode()), dict[int, ET.Element]()
    joints, bodies[0] = [_name(model, "joint", j) for j in range(model.njnt)], writer.world
    for body in range(1, model.nbody):
        element = bodies[body] = _add(
            bodies[int(model.body_parentid[body])],
            "body",
            name=_name(model, "body", body),
            pos=model.body_pos[body],
            quat=model.body_quat[body],
        )
        _add(
            element,
            "inertial",
            pos=model.body_ipos[body],
            quat=model.body_iquat[body],
            mass=model.body_mass[body],
            diaginertia=model.body_inertia[body],
        )
        first = int(model.body_jntadr[body])
        for joint in range(first, first + int(model.body_jntnum[body])):
            _add_joint(mujoco, model, element, joint)
    for geom in range(model.ngeom):
        _add_geom(mujoco, model, writer, bodies[int(model.geom_bodyid[geom])], geom)
    for site in range(model.nsite):
        place = {"pos": model.site_pos[site], "quat": model.site_quat[site]}
        name = _name(model, "site", site)
        _add(bodies[int(model.site_bodyid[site])], "site", name=name, **place)
    _add_actuators(mujoco, model, writer.section("actuator"), joints)
    _add_equalities(mujoco, model, writer.section("equality"), joints)
    keys = writer.section("keyframe")
    for key in range(model.nkey):
        _add(keys, "key", name=_name(model, "key", key), qpos=model.key_qpos[key])
    return writer


def _name(model: Any, kind: str, index: int) -> str:
    return getattr(model, kind)(index).name or f"{kind}{index}"


def _add_joint(mujoco: Any, model: Any, body: ET.Element, joint: int) -> None:
    kind = mujoco.mjtJoint(model.jnt_type[joint]).name.removeprefix("mjJNT_").lower()
    if kind == "free":
        _add(body, "freejoint", name=_name(model, "joint", joint))
        return
    dof = int(model.jnt_dofadr[joint])
    _add(
        body,
        "joint",
        name=_name(model, "joint", joint),
        type=kind,
        pos=model.jnt_pos[joint],
        axis=model.jnt_axis[joint],
        range=model.jnt_range[joint],
        limited=bool(model.jnt_limited[joint]),
        actuatorfrcrange=model.jnt_actfrcrange[joint],
        actuatorfrclimited=bool(model.jnt_actfrclimited[joint]),
        armature=model.dof_armature[dof],
        damping=np.ravel(model.dof_damping[dof])[:1],
        frictionloss=model.dof_frictionloss[dof],
        stiffness=np.ravel(model.jnt_stiffness[joint])[:1],
        ref=None if kind == "ball" else model.qpos0[model.jnt_qposadr[joint]],
    )


def _add_geom(mujoco: Any, model: Any, writer: _Writer, body: ET.Element, geom: int) -> None:
    kind = mujoco.mjtGeom(model.geom_type[geom]).name.removeprefix("mjGEOM_")
    size, mesh, painted = None, None, int(model.geom_matid[geom])
    if kind == "MESH":
        number = int(model.geom_dataid[geom])
        v, f = int(model.mesh_vertadr[number]), int(model.mesh_faceadr[number])
        vertices = model.mesh_vert[v : v + int(model.mesh_vertnum[number])]
        faces = model.mesh_face[f : f + int(model.mesh_facenum[number])]
        mesh = writer.mesh(f"mesh{number}", vertices, faces)
    elif kind in _SIZES:
        size = model.geom_size[geom][: _SIZES[kind]]
    else:
        return
    _add(
        body,
        "geom",
        type=kind.lower(),
        pos=model.geom_pos[geom],
        quat=model.geom_quat[geom],
        size=size,
        mesh=mesh,
        contype=int(model.geom_contype[geom]),
        conaffinity=int(model.geom_conaffinity[geom]),
        group=int(model.geom_group[geom]),
        rgba=model.geom_rgba[geom] if painted < 0 else model.mat_rgba[painted],
        mass="0",
    )


def _add_actuators(mujoco: Any, model: Any, section: ET.Element, joints: list[str]) -> None:
    kinds, none = mujoco.mjtTrn, int(mujoco.mjtBias.mjBIAS_NONE)
    for motor in range(model.nu):
        if model.actuator_trntype[motor] in (kinds.mjTRN_JOINT, kinds.mjTRN_JOINTINPARENT):
            _add(
                section,
                "general",
                joint=joints[int(model.actuator_trnid[motor, 0])],
                gear=model.actuator_gear[motor],
                biastype="none" if int(model.actuator_biastype[motor]) == none else "affine",
                gainprm=model.actuator_gainprm[motor, 0],
                forcelimited=bool(model.actuator_forcelimited[motor]),
                forcerange=model.actuator_forcerange[motor],
                ctrllimited=bool(model.actuator_ctrllimited[motor]),
                ctrlrange=model.actuator_ctrlrange[motor],
            )


def _add_equalities(mujoco: Any, model: Any, section: ET.Element, joints: list[str]) -> None:
    kinds = {"mjEQ_JOINT": "joint", "mjEQ_CONNECT": "connect", "mjEQ_WELD": "weld"}
    for index in range(model.neq):
        tag = kinds.get(mujoco.mjtEq(model.eq_type[index]).name)
        ends, data = (
            (int(model.eq_obj1id[index]), int(model.eq_obj2id[index])),
            model.eq_data[index],
        )
        about = {"name": _name(model, "equality", index), "active": bool(model.eq_active0[index])}
        if tag == "joint":
            one, other = (joints[end] if end >= 0 else None for end in ends)
            _add(section, tag, joint1=one, joint2=other, polycoef=data[:5], **about)
        elif tag is not None:
            if model.eq_objtype[index] == mujoco.mjtObj.mjOBJ_SITE:
                ends, data = tuple(int(model.site_bodyid[end]) for end in ends), np.zeros(3)
            one, other = (_name(model, "body", end) if end > 0 else None for end in ends)
            anchor = data[:3] if tag == "connect" else None
            _add(section, tag, body1=one, body2=other, anchor=anchor, **about)


def _of_pinocchio(model: pin.Model, geometry: pin.GeometryModel | None) -> _Writer:
    """Bodies bear the names of body frames; one at a joint without a frame has its name."""
    writer, bodies = _Writer(model.name), dict[int, ET.Element]()
    frames = [f for f in model.frames if f.type == pin.FrameType.BODY and f.name != "world"]
    taken = {"world", *(f.name for f in frames)}
    for index in range(model.njoints):
        joint, place = model.joints[index], model.jointPlacements[index]
        own = [f.name for f in frames if f.parentJoint == index and f.placement.isIdentity(1e-12)]
        name = own[0] if own else free_name(f"{model.names[index]}_link", taken)
        taken.add(name)
        free = joint.shortname() == "JointModelFreeFlyer"
        above = writer.world if free or index == 0 else bodies[int(model.parents[index])]
        bodies[index] = body = _add_body(above, name, place)
        if free:
            _add(body, "freejoint", name=model.names[index])
        elif index > 0:
            _add_pinocchio_joint(model, body, index)
        inertia, moments = model.inertias[index], model.inertias[index].inertia
        if inertia.mass > 0.0:
            full = moments[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
            mass = float(inertia.mass)
            _add(body, "inertial", pos=np.array(inertia.lever), mass=mass, fullinertia=full)
    for frame in frames:
        if all(frame.name != body.get("name") for body in bodies.values()):
            _add_body(bodies[int(frame.parentJoint)], frame.name, frame.placement)
    for number, shape in enumerate(() if geometry is None else geometry.geometryObjects):
        _add_shape(writer, bodies[int(shape.parentJoint)], number, shape)
    return writer


def _add_body(parent: ET.Element, name: str, place: pin.SE3) -> ET.Element:
    return _add(parent, "body", name=name, **_placed(place))


def _placed(place: pin.SE3) -> dict[str, Any]:
    return {
        "pos": place.translation,
        "quat": pin.Quaternion(place.rotation).coeffs()[[3, 0, 1, 2]],
    }


def _add_pinocchio_joint(model: pin.Model, body: ET.Element, index: int) -> None:
    joint, name = model.joints[index], model.names[index]
    data, v = joint.createData(), joint.idx_v
    joint.calc(data, pin.neutral(model)[joint.idx_q :][: joint.nq], np.zeros(joint.nv))
    motion = np.ravel(data.S)
    if joint.nv != 1 or (motion[:3].any() and motion[3:].any()):
        raise RobotError(
            f"joint {name!r} of {model.name or 'pin.Model'} is neither hinge nor slide",
            got=joint.shortname(),
            wanted="hinges and slides, behind a free base or none",
        )
    turns = bool(np.abs(motion[3:]).max() > 0.5)
    span = [
        float(limit[joint.idx_q]) for limit in (model.lowerPositionLimit, model.upperPositionLimit)
    ]
    limited = joint.nq == 1 and max(map(abs, span)) < NO_LIMIT
    effort = float(model.effortLimit[v])
    forced = 0.0 < effort < NO_LIMIT
    _add(
        body,
        "joint",
        name=name,
        type="hinge" if turns else "slide",
        axis=motion[3:] if turns else motion[:3],
        limited=limited,
        range=span if limited else None,
        actuatorfrclimited=forced,
        actuatorfrcrange=[-effort, effort] if forced else None,
        armature=float(model.armature[v]),
        damping=float(model.damping[v]),
        frictionloss=float(model.upperDryFrictionLimit[v]),
    )


def _add_shape(writer: _Writer, body: ET.Element, number: int, shape: pin.GeometryObject) -> None:
    solid, size, mesh = shape.geometry, None, None
    kind = type(solid).__name__.lower()
    if kind == "box":
        size = np.array(solid.halfSide)
    elif kind == "sphere":
        size = solid.radius
    elif kind in ("cylinder", "capsule"):
        size = [solid.radius, solid.halfLength]
    elif hasattr(solid, "tri_indices"):
        faces = [[t[0], t[1], t[2]] for t in map(solid.tri_indices, range(solid.num_tris))]
        kind, mesh = "mesh", writer.mesh(f"mesh{number}", solid.vertices(), faces)
    else:
        return
    _add(body, "geom", type=kind, size=size, mesh=mesh, mass="0", **_placed(shape.placement))
