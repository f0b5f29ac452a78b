"""A stick figure for a URDF document without pictures, so that it can be seen when simulated.

Where the mesh files of a robot's document are.
"""

import os
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

from poise.errors import RobotError
from poise.robots._parametric import PALETTE, Shape, add_shape, rod, sphere
from poise.robots._robot import ModelSource

_PACKAGE = "package://"


def mesh_path(filename: str, source: ModelSource) -> Path:
    """Find the file that a URDF means by `package://...`, `file://...` or a plain path.

    A package folder may be the one that holds the package or the package itself.

    Args:
        filename: the name as the document gives it.
        source: the document.

    Returns:
        The file.

    Raises:
        RobotError: there is no such file; the message says where it was looked for.
    """
    candidates = _candidates(filename, source)
    for candidate in candidates:
        if candidate.is_file():
            return candidate
    raise RobotError(
        "a mesh of the robot cannot be found",
        got=filename,
        wanted="one of: " + ", ".join(map(str, candidates)),
    )


def check_meshes(root: ET.Element, source: ModelSource) -> None:
    """Check that every mesh of a document exists, without reading any.

    Args:
        root: the parsed document.
        source: the same document, with its folders.

    Raises:
        RobotError: a mesh cannot be found.
    """
    if source.kind == "urdf":
        names = {e.get("filename", "") for e in root.iter("mesh")}
    else:
        folder = _mesh_folder(root)
        names = {str(folder / e.get("file", "")) for e in root.iter("mesh") if e.get("file")}
    for name in sorted(names):
        mesh_path(name, source)


def package_folders(root: ET.Element, directory: Path) -> tuple[Path, ...]:
    """Folders that may hold the packages a URDF names: those above it, and ROS's own.

    Args:
        root: the parsed document.
        directory: the folder of the document.

    Returns:
        The folders that hold one of the packages.
    """
    names = {
        e.get("filename", "").removeprefix(_PACKAGE).partition("/")[0]
        for e in root.iter("mesh")
        if e.get("filename", "").startswith(_PACKAGE)
    }
    ros = [Path(p) for p in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if p]
    places = [directory, *directory.parents, *ros]
    return tuple(p for p in places if any((p / name).is_dir() for name in names))


def _candidates(filename: str, source: ModelSource) -> list[Path]:
    name = filename.removeprefix("file://")
    if name.startswith(_PACKAGE):
        relative = name.removeprefix(_PACKAGE)
        inside = relative.partition("/")[2]
        return [d / p for d in source.package_dirs for p in (relative, inside)]
    if Path(name).is_absolute() or source.directory is None:
        return [Path(name)]
    return [source.directory / name]


def _mesh_folder(root: ET.Element) -> Path:
    folder = Path()
    for compiler in root.iter("compiler"):
        folder = Path(compiler.get("meshdir", compiler.get("assetdir", str(folder))))
    return folder


_ROD, _BALL = 0.02, 0.03
"""Radii of a stick and of the ball at each link's origin [m]."""

_SHORT = 0.01
"""Offsets shorter than this need no stick [m]."""


def add_figure(root: ET.Element) -> bool:
    """Draw sticks between the joints of a URDF document, if it has no visual and no collision.

    Inertias stay as they are: only pictures are added.

    Args:
        root: the document's root element, changed in place.

    Returns:
        Whether anything was drawn.
    """
    if root.find("link/visual") is not None or root.find("link/collision") is not None:
        return False
    links = {link.get("name", ""): link for link in root.findall("link")}
    for link in links.values():
        if link.find("inertial") is not None:
            _draw(link, sphere(_BALL, colour="joint"))
    for joint in root.findall("joint"):
        parent, origin = joint.find("parent"), joint.find("origin")
        if parent is None or origin is None:
            continue
        end = np.array([float(x) for x in origin.get("xyz", "0 0 0").split()])
        if np.linalg.norm(end) > _SHORT:
            _draw(links[parent.get("link", "")], rod((0.0, 0.0, 0.0), end.tolist(), _ROD))
    return True


def _draw(link: ET.Element, shape: Shape) -> None:
    visual = ET.SubElement(link, "visual")
    add_shape(visual, shape)
    material = ET.SubElement(visual, "material", name=f"figure_{shape.colour}")
    ET.SubElement(material, "color", rgba=" ".join(map(str, PALETTE[shape.colour])))
