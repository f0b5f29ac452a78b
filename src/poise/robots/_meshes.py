"""A stick figure for a URDF document without pictures, so that it can be seen when simulated.

Where the mesh files of a robot's document are.
"""

import math
import os
import xml.etree.ElementTree as ET
from pathlib import Path

from poise.errors import RobotError
from poise.robots._document import Document, end_of
from poise.robots._mjcf_assets import drop_mesh_geoms, mesh_file
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
    found = _find(filename, source)
    if found is not None:
        return found
    raise RobotError(
        "a mesh of the robot cannot be found",
        got=filename,
        wanted="one of: " + ", ".join(map(str, _candidates(filename, source))),
    )


def drop_missing_meshes(root: ET.Element, source: ModelSource, where: str) -> list[str]:
    """Take the meshes that are not there out of a document, without reading any.

    Args:
        root: the parsed document, changed in place.
        source: the same document, with its folders.
        where: the file or the robot's name, for messages.

    Returns:
        The names of the missing files.

    Raises:
        RobotError: a mesh file is empty or a placeholder, or a body's mass would come from a mesh
            that is missing.
    """
    urdf = source.kind == "urdf"
    missing = {n for n, file in _named(root, source).items() if not _is_mesh(file, source, where)}
    if not missing:
        return []
    if urdf:
        for link in root.findall("link"):
            for shape in [*link.findall("visual"), *link.findall("collision")]:
                mesh = shape.find("geometry/mesh")
                if mesh is not None and mesh.get("filename", "") in missing:
                    link.remove(shape)
        return sorted(missing)
    lighter = drop_mesh_geoms(root, missing, source, where)
    if lighter:
        raise RobotError(
            f"meshes that the mass of bodies of {where} comes from cannot be found",
            got={"bodies": lighter, "meshes": sorted(missing)},
            wanted="these meshes, or an <inertial> of each of the bodies in their place",
        )
    return sorted(missing)


def found_meshes(root: ET.Element, source: ModelSource) -> list[Path]:
    """The mesh files of a document that are there, in the order of their names.

    Args:
        root: the parsed document.
        source: the same document, with its folders.
    """
    found = (_find(file, source) for _, file in sorted(_named(root, source).items()))
    return [file for file in found if file is not None]


def _named(root: ET.Element, source: ModelSource) -> dict[str, str]:
    """The meshes that a document names, with the folder that MJCF has for all of them."""
    if source.kind == "urdf":
        return {e.get("filename", ""): e.get("filename", "") for e in root.iter("mesh")}
    names = (e.get("file") for e in root.iter("mesh"))
    return {name: mesh_file(root, name) for name in names if name}


_PLACEHOLDER = b"version https://git-lfs"
"""How a file begins that stands for one that Git LFS keeps elsewhere."""


def _is_mesh(name: str, source: ModelSource, where: str) -> bool:
    """Whether a mesh is there."""
    found = _find(name, source)
    if found is None:
        return False
    with found.open("rb") as file:
        start = file.read(len(_PLACEHOLDER))
    if not start or start == _PLACEHOLDER:
        raise RobotError(
            f"mesh {name!r} of {where} is {'a Git LFS pointer' if start else 'empty'}",
            got=f"{found.stat().st_size} bytes in {found}",
            wanted="the mesh itself: fetch it anew (git lfs pull), or take it out of the model",
        )
    return True


def asset_folders(document: Document, path: Path) -> tuple[Path, tuple[Path, ...]]:
    """Where the files that a document names are: its folder, and those of its packages."""
    directory = path.parent.resolve()
    urdf = document.kind == "urdf"
    return directory, package_folders(document.root, directory) if urdf else ()


def package_folders(root: ET.Element, directory: Path) -> tuple[Path, ...]:
    """Folders that may hold the packages a URDF names: those above it, and ROS's own.

    Args:
        root: the parsed document.
        directory: the folder of the document.

    Returns:
        The folders that hold one of the packages, or are one of them under another name, as an
        archive that was unpacked elsewhere is.
    """
    files = {
        e.get("filename", "").removeprefix(_PACKAGE)
        for e in root.iter("mesh")
        if e.get("filename", "").startswith(_PACKAGE)
    }
    ros = [Path(p) for p in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if p]
    places = [directory, *directory.parents, *ros]
    names = {file.partition("/")[0] for file in files}
    inside = {file.partition("/")[2] for file in files}
    holding = [p for p in places if any((p / name).is_dir() for name in names)]
    being = [p for p in places if any(file and (p / file).is_file() for file in inside)]
    return tuple(dict.fromkeys([*holding, *being]))


def _find(filename: str, source: ModelSource) -> Path | None:
    return next((c for c in _candidates(filename, source) if c.is_file()), None)


def _candidates(filename: str, source: ModelSource) -> list[Path]:
    name = filename.removeprefix("file://")
    if name.startswith(_PACKAGE):
        relative = name.removeprefix(_PACKAGE)
        inside = relative.partition("/")[2]
        return [d / p for d in source.package_dirs for p in (relative, inside)]
    if Path(name).is_absolute() or source.directory is None:
        return [Path(name)]
    return [source.directory / name]


_RADIUS = 0.02
"""Radius of the figure's sticks, and of the balls at their ends, which hide shorter sticks [m]."""


def has_shapes(root: ET.Element) -> bool:
    """True where a document has anything to see or to touch."""
    return any(root.find(path) is not None for path in ("link/visual", "link/collision", ".//geom"))


def add_figure(root: ET.Element) -> bool:
    """Draw sticks between the joints of a URDF without shapes; True if it had none."""
    if has_shapes(root):
        return False
    links = {link.get("name", ""): link for link in root.findall("link")}
    for link in links.values():
        if link.find("inertial") is not None:
            ball = f'<visual><geometry><sphere radius="{_RADIUS}"/></geometry></visual>'
            link.append(ET.fromstring(ball))
    for joint in root.findall("joint"):
        origin = joint.find("origin")
        text = "0 0 0" if origin is None else origin.get("xyz", "0 0 0")
        x, y, z = map(float, text.split())
        length = math.hypot(x, y, z)
        if length > _RADIUS:
            # The cylinder's z axis is tilted about y, then turned about z.
            rpy = f"0 {math.atan2(math.hypot(x, y), z)} {math.atan2(y, x)}"
            stick = (
                f'<visual><origin xyz="{x / 2} {y / 2} {z / 2}" rpy="{rpy}"/>'
                f'<geometry><cylinder radius="{_RADIUS}" length="{length}"/></geometry></visual>'
            )
            links[end_of(joint, "parent")].append(ET.fromstring(stick))
    return True
