"""Mesh files that a document names: found, missing, empty."""

import os
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path

from poise.errors import RobotError
from poise.robots._document import Document
from poise.robots._robot import ModelSource

_PLACEHOLDER = b"version https://git-lfs"
"""The first bytes of a file that stands for one that Git LFS keeps elsewhere."""


def drop_missing_meshes(document: Document) -> list[str]:
    """Take the meshes that are not there out of a document, and return their names."""
    missing = {n for n, path in document.meshes().items() if not _is_mesh(n, path, document.where)}
    lighter = document.drop_meshes(missing) if missing else []
    if lighter:
        raise RobotError(
            f"meshes that the mass of bodies of {document.where} comes from cannot be found",
            got={"bodies": lighter, "meshes": sorted(missing)},
            wanted="these meshes, or an <inertial> of each of the bodies in their place",
        )
    return sorted(missing)


def _is_mesh(name: str, path: Path | None, where: str) -> bool:
    if path is None:
        return False
    with path.open("rb") as file:
        start = file.read(len(_PLACEHOLDER))
    if not start or start == _PLACEHOLDER:
        raise RobotError(
            f"mesh {name!r} of {where} is {'a Git LFS pointer' if start else 'empty'}",
            got=f"{path.stat().st_size} bytes in {path}",
            wanted="the mesh itself: fetch it anew (git lfs pull), or take it out of the model",
        )
    return True


_PACKAGE = "package://"


def mesh_path(filename: str, source: ModelSource) -> Path:
    """Find the file that a URDF means by `package://...`, `file://...` or a plain path.

    A package folder may be the one that holds the package or the package itself.
    """
    places = _candidates(filename, source.directory, source.package_dirs)
    found = next((place for place in places if place.is_file()), None)
    if found is None:
        raise RobotError(
            "a mesh of the robot cannot be found",
            got=filename,
            wanted="one of: " + ", ".join(map(str, places)),
        )
    return found


def find_mesh(filename: str, directory: Path | None, packages: Sequence[Path]) -> Path | None:
    """The file that `mesh_path` finds; None where there is none."""
    places = _candidates(filename, directory, packages)
    return next((place for place in places if place.is_file()), None)


def _candidates(filename: str, directory: Path | None, packages: Sequence[Path]) -> list[Path]:
    name = filename.removeprefix("file://")
    if name.startswith(_PACKAGE):
        relative = name.removeprefix(_PACKAGE)
        inside = relative.partition("/")[2]
        return [folder / part for folder in packages for part in (relative, inside)]
    if Path(name).is_absolute() or directory is None:
        return [Path(name)]
    return [directory / name]


def package_folders(root: ET.Element, directory: Path | None) -> tuple[Path, ...]:
    """Folders that hold a package that a URDF names, or are one under another name.

    They are looked for above the document's folder and in ROS's own path.
    """
    names = (e.get("filename", "") for e in root.iter("mesh"))
    files = {n.removeprefix(_PACKAGE) for n in names if n.startswith(_PACKAGE)}
    ros = [Path(p) for p in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if p]
    places = [*([directory, *directory.parents] if directory is not None else ()), *ros]
    packages = {file.partition("/")[0] for file in files}
    inside = {file.partition("/")[2] for file in files}
    holding = [p for p in places if any((p / name).is_dir() for name in packages)]
    being = [p for p in places if any(file and (p / file).is_file() for file in inside)]
    return tuple(dict.fromkeys([*holding, *being]))
