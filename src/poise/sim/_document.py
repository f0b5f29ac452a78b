"""The robot's own document, made ready for MuJoCo: meshes found, compiler options set.

A stick figure for a robot whose document has no pictures.
Meshes in a format that MuJoCo reads.
"""

import xml.etree.ElementTree as ET
from pathlib import Path

import mujoco
import numpy as np

from poise.errors import RobotError
from poise.robots import ModelSource, anchor_assets, load_mesh, make_spec, mesh_path

_THICKNESS = 0.12
"""Radius of a stick, as a part of its length."""

_SHORTEST = 0.01
"""Shorter links [m] are not drawn."""


def add_sticks(spec: mujoco.MjSpec) -> None:
    """Draw each link as sticks, without collision, from its own joint to those of its children."""
    for body in spec.bodies[1:]:
        for child in body.bodies:
            length = float(np.linalg.norm(child.pos))
            if length < _SHORTEST:
                continue
            body.add_geom(
                type=mujoco.mjtGeom.mjGEOM_CAPSULE,
                fromto=(0.0, 0.0, 0.0, *child.pos),
                size=(_THICKNESS * length, 0.0, 0.0),
                contype=0,
                conaffinity=0,
                mass=0.0,
                group=1,
                rgba=(0.75, 0.77, 0.8, 1.0),
            )


_BINARY_STL_HEADER = 84
"""Bytes before the first triangle: a text of 80, and the number of triangles."""

_STL_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def _is_binary_stl(path: Path) -> bool:
    with path.open("rb") as file:
        header = file.read(_BINARY_STL_HEADER)
    triangles = int.from_bytes(header[80:], "little")
    return path.stat().st_size == _BINARY_STL_HEADER + triangles * _STL_TRIANGLE.itemsize


def _binary_stl(path: Path) -> bytes:
    """A mesh in another format (COLLADA, text STL), as MuJoCo reads it."""
    vertices, corners = load_mesh(path)
    faces = vertices[corners]
    volume = np.einsum("ti,ti->", faces[:, 0], np.cross(faces[:, 1], faces[:, 2]))
    if volume < 0.0:
        # Inside out, as a mirrored part is: it would be drawn unlit.
        faces = faces[:, ::-1]
    triangles = np.zeros(len(corners), dtype=_STL_TRIANGLE)
    triangles["corners"] = faces
    count = len(corners).to_bytes(4, "little")
    return b"\0" * 80 + count + triangles.tobytes()


_COMPILER = {
    "autolimits": "true",
    "balanceinertia": "false",
    "discardvisual": "false",
    "fusestatic": "false",
    "inertiafromgeom": "false",
    "strippath": "false",
}
"""Keep what the document says: its inertias, its links one by one, its pictures."""

_MASSLESS = {"boundmass": "1e-12", "boundinertia": "1e-14"}
"""MuJoCo wants some mass on every moving body; the document's massless links get this little."""


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
    # MuJoCo tells meshes apart by the stems of their files.
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
    """Convert the meshes of a URDF's specification that MuJoCo cannot read."""
    assets: dict[str, bytes] = {}
    for mesh in spec.meshes:
        path = Path(mesh.file)
        if path.suffix == ".obj" or (path.suffix.lower() == ".stl" and _is_binary_stl(path)):
            continue
        mesh.file = f"{mesh.name}.stl"
        assets[mesh.file] = _binary_stl(path)
    spec.assets = assets


def _parse_mjcf(source: ModelSource) -> mujoco.MjSpec:
    root = ET.fromstring(source.text)
    if source.directory is not None:
        anchor_assets(root, source.directory)
    spec = make_spec(mujoco, root)
    spec.compiler.fusestatic = False
    spec.compiler.discardvisual = False
    for key, least in _MASSLESS.items():
        setattr(spec.compiler, key, max(getattr(spec.compiler, key), float(least)))
    for geom in spec.geoms:
        geom.name = ""  # It might be that of the plant's floor, or of a sole.
    # The plant brings its own motors, sensors, floor and lights.
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
