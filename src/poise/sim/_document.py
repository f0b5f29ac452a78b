"""The robot's own document made ready for MuJoCo: meshes found, locked joints welded."""

import xml.etree.ElementTree as ET
from collections.abc import Collection
from pathlib import Path

import mujoco
import numpy as np

from poise.errors import RobotError
from poise.robots import (
    ModelSource,
    compile_spec,
    is_binary_stl,
    load_mesh,
    make_spec,
    mesh_path,
    settled_spec,
)


def add_sticks(spec: mujoco.MjSpec, *, slenderness: float = 0.12, shortest: float = 0.01) -> None:
    """Draw each link as sticks, without collision, from its own joint to those of its children."""
    for body in spec.bodies[1:]:
        for child in body.bodies:
            length = float(np.linalg.norm(child.pos))
            if length < shortest:
                continue
            body.add_geom(
                type=mujoco.mjtGeom.mjGEOM_CAPSULE,
                fromto=(0.0, 0.0, 0.0, *child.pos),
                size=(slenderness * length, 0.0, 0.0),
                contype=0,
                conaffinity=0,
                mass=0.0,
                group=1,
                rgba=(0.75, 0.77, 0.8, 1.0),
            )


# Keep the document's inertias, its separate links and its textures.
_COMPILER = {
    "autolimits": "true",
    "balanceinertia": "false",
    "discardvisual": "false",
    "fusestatic": "false",
    "inertiafromgeom": "false",
    "strippath": "false",
}

# MuJoCo needs some mass on every moving body; the document's massless links get this little.
_MASSLESS = {"boundmass": "1e-12", "boundinertia": "1e-14"}

_MOST_BYTES = 200_000 * 50  # of the triangles of a binary STL file that MuJoCo reads


def parse_document(source: ModelSource) -> mujoco.MjSpec:
    """Parse the robot's document into a MuJoCo specification."""
    try:
        spec = _parse_urdf(source) if source.kind == "urdf" else _parse_mjcf(source)
    except (ValueError, ET.ParseError) as error:
        raise RobotError(f"MuJoCo cannot read the robot's document: {error}") from error
    # Couplings between joints (mimic joints, closed loops) are not part of a `Robot`.
    for coupling in [*spec.equalities]:
        spec.delete(coupling)
    return spec


def _parse_urdf(source: ModelSource) -> mujoco.MjSpec:
    root = ET.fromstring(source.text)
    for element in root.findall("mujoco"):
        root.remove(element)
    for limit in root.iter("limit"):
        ends = [float(limit.attrib.pop(key, "0")) for key in ("lower", "upper")]
        if ends[0] < ends[1]:  # MuJoCo writes others, those of welded joints, to its log.
            limit.attrib.update(lower=repr(ends[0]), upper=repr(ends[1]))
    extension = ET.SubElement(root, "mujoco")
    ET.SubElement(extension, "compiler", _COMPILER | _MASSLESS)
    # MuJoCo identifies meshes by the stems of their files.
    names: dict[Path, str] = {}
    for element in root.iter("mesh"):
        path = mesh_path(element.get("filename", ""), source)
        element.set("filename", names.setdefault(path, f"mesh{len(names):03d}{path.suffix}"))
    spec = make_spec(mujoco, root)
    paths = {name: str(path) for path, name in names.items()}
    for mesh in spec.meshes:
        mesh.file = paths[mesh.file]
    return spec


def convert_meshes(spec: mujoco.MjSpec) -> None:
    """Read those meshes of a URDF's specification that MuJoCo cannot."""
    for mesh in spec.meshes:
        path = Path(mesh.file)
        if path.suffix == ".obj":
            continue
        if is_binary_stl(path) and path.stat().st_size <= _MOST_BYTES:
            continue  # COLLADA, STL as text and larger ones are left.
        vertices, faces = load_mesh(path)
        corners = vertices[faces]
        if np.einsum("ti,ti->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) < 0.0:
            # Inside out, as a mirrored part is: it would be drawn unlit.
            faces = faces[:, ::-1]
        mesh.file, mesh.uservert, mesh.userface = "", vertices.ravel(), faces.ravel()


def weld_joints(spec: mujoco.MjSpec, locked: Collection[str]) -> None:
    """Take joints out of a specification that are to stand at zero."""
    # MuJoCo leaves a body whose joint is taken out where it is at the joint's `ref`, so bodies are
    # placed first: as compiled, because a document may give placements in many ways.
    joints = [joint for joint in spec.joints if joint.name in locked]
    if any(joint.ref != 0.0 for joint in joints):
        model = compile_spec(spec, "the robot's document")
        data = mujoco.MjData(model)
        for joint in joints:
            data.joint(joint.name).qpos[:] = 0.0
        mujoco.mj_kinematics(model, data)
        for body in spec.bodies[1:]:
            if any(joint.name in locked for joint in body.joints):
                _place(body, model, data)
    for joint in joints:
        spec.delete(joint)


def _place(body: mujoco.MjsBody, model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Fix a body to its parent, and its joints to it, where they are."""
    own, parent = data.body(body.name), data.body(body.parent.name)
    away, turn, unturn = np.empty(3), np.empty(4), np.empty(4)
    mujoco.mju_negQuat(unturn, parent.xquat)
    mujoco.mju_mulQuat(turn, unturn, own.xquat)
    mujoco.mju_rotVecQuat(away, own.xpos - parent.xpos, unturn)
    body.set_frame(body.parent.add_frame())
    body.pos, body.quat = away, turn
    body.alt.type = mujoco.mjtOrientation.mjORIENTATION_QUAT
    for joint in body.joints:
        k = model.joint(joint.name).id
        joint.set_frame(body.add_frame())
        joint.pos = own.xmat.reshape(3, 3).T @ (data.xanchor[k] - own.xpos)
        joint.axis = own.xmat.reshape(3, 3).T @ data.xaxis[k]


def _parse_mjcf(source: ModelSource) -> mujoco.MjSpec:
    spec = settled_spec(source, "the robot's document")
    spec.compiler.discardvisual = False
    for geom in spec.geoms:
        geom.name = ""  # It might be that of the plant's floor, or of a sole.
    # The plant has its own motors, sensors, floor and lights.
    for leftover in (
        *spec.actuators,
        *spec.sensors,
        *spec.keys,
        *spec.worldbody.geoms,
        *spec.worldbody.lights,
        *spec.worldbody.cameras,
    ):
        spec.delete(leftover)
    return spec
