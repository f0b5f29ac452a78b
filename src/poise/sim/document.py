"""The robot's own document, made ready for MuJoCo: meshes found, compiler options set."""

import xml.etree.ElementTree as ET
from pathlib import Path

import mujoco

from poise.errors import RobotError
from poise.robots.meshes import mesh_path
from poise.robots.robot import ModelSource
from poise.sim.meshes import mesh_bytes

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
    """Parse the robot's document into a MuJoCo specification.

    Args:
        source: the document.

    Returns:
        The specification, not yet compiled: links, joints and geometry, and nothing else.

    Raises:
        RobotError: the document cannot be read, or a mesh cannot be found.
    """
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
    extension = ET.SubElement(root, "mujoco")
    ET.SubElement(extension, "compiler", _COMPILER | _MASSLESS)
    assets = _gather_meshes(root, source)
    return mujoco.MjSpec.from_string(ET.tostring(root, encoding="unicode"), assets=assets)


def _gather_meshes(root: ET.Element, source: ModelSource) -> dict[str, bytes]:
    """Read all meshes, and give each file a name of its own that MuJoCo can tell apart."""
    names: dict[Path, str] = {}
    assets: dict[str, bytes] = {}
    for element in root.iter("mesh"):
        path = mesh_path(element.get("filename", ""), source)
        if path not in names:
            data, suffix = mesh_bytes(path)
            names[path] = f"mesh{len(names):03d}{suffix}"
            assets[names[path]] = data
        element.set("filename", names[path])
    return assets


def _parse_mjcf(source: ModelSource) -> mujoco.MjSpec:
    root = ET.fromstring(source.text)
    if source.directory is not None:
        _anchor_assets(root, source.directory)
    spec = mujoco.MjSpec.from_string(ET.tostring(root, encoding="unicode"))
    spec.compiler.fusestatic = False
    spec.compiler.discardvisual = False
    spec.compiler.balanceinertia = False
    spec.compiler.boundmass = float(_MASSLESS["boundmass"])
    spec.compiler.boundinertia = float(_MASSLESS["boundinertia"])
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


def _anchor_assets(root: ET.Element, directory: Path) -> None:
    """Make the folders for meshes and textures absolute, for a document read from a string."""
    compilers = root.findall("compiler") or [ET.SubElement(root, "compiler")]
    for compiler in compilers:
        asset_dir = compiler.get("assetdir", "")
        for key in ("meshdir", "texturedir"):
            compiler.set(key, str(directory / compiler.get(key, asset_dir)))
