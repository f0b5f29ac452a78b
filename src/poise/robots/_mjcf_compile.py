"""MJCF read by MuJoCo's own compiler, which resolves defaults, classes, frames and geometry.

`parse_mjcf`: a document as MuJoCo's specification. `compile_mjcf`: a settled one, compiled.
"""

import importlib
import xml.etree.ElementTree as ET
from collections.abc import Set
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.errors import MissingExtraError, RobotError
from poise.robots._robot import ModelSource


def mujoco_module(where: str) -> ModuleType:
    """MuJoCo, which reads MJCF.

    Raises:
        MissingExtraError: it is not installed.
    """
    try:
        return importlib.import_module("mujoco")
    except ModuleNotFoundError:
        raise MissingExtraError("mujoco", "sim", f"Reading {where}, which is MJCF,") from None


def compile_mjcf(source: ModelSource, where: str, pictured: Set[str] = frozenset()) -> Any:
    """MuJoCo's compiled model of a settled document.

    Args:
        source: the document.
        where: the file, for messages.
        pictured: bodies whose meshes are read although no inertia comes from them.

    Raises:
        RobotError: MuJoCo cannot compile it.
    """
    mujoco = mujoco_module(where)
    spec = parse_mjcf(ET.fromstring(source.text), source.directory, where)
    spec.compiler.fusestatic = False
    spec.compiler.balanceinertia = False
    spec.compiler.boundmass, spec.compiler.boundinertia = 1e-12, 1e-14
    _drop_unread_meshes(mujoco, spec, pictured)
    try:
        return spec.compile()
    except ValueError as error:
        raise RobotError(f"MuJoCo cannot build {where}: {_one_line(error)}") from None


def parse_mjcf(root: ET.Element, directory: Path | None, where: str) -> Any:
    """MuJoCo's specification of a document, not yet compiled.

    Args:
        root: the document's root element.
        directory: where its relative paths start.
        where: the file, for messages.

    Raises:
        RobotError: MuJoCo cannot read it.
    """
    mujoco = mujoco_module(where)
    if directory is not None:
        root = ET.fromstring(ET.tostring(root, encoding="unicode"))
        # MuJoCo takes the last of several compiler sections for its folders.
        for compiler in root.findall("compiler") or [ET.SubElement(root, "compiler")]:
            folder = compiler.get("assetdir", "")
            for key in ("meshdir", "texturedir"):
                compiler.set(key, str(directory / compiler.get(key, folder)))
    try:
        return mujoco.MjSpec.from_string(ET.tostring(root, encoding="unicode"))
    except ValueError as error:
        raise RobotError(f"MuJoCo cannot read {where}: {_one_line(error)}") from None


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())


def _drop_unread_meshes(mujoco: ModuleType, spec: Any, pictured: Set[str]) -> None:
    """Leave out the meshes that no inertia comes from: a controller reads no pictures."""
    if spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE:
        return
    kinds = (mujoco.mjtGeom.mjGEOM_MESH, mujoco.mjtGeom.mjGEOM_SDF)
    kept: set[str] = set()
    for body in spec.bodies:
        for geom in [g for g in body.geoms if g.meshname]:
            unread = body.explicitinertial or body.name == "world"
            if geom.type in kinds and unread and body.name not in pictured:
                spec.delete(geom)
            else:
                kept.add(geom.meshname)
    for mesh in [m for m in spec.meshes if (m.name or Path(m.file).stem) not in kept]:
        spec.delete(mesh)


def drop_mesh_geoms(root: ET.Element, files: set[str]) -> list[str]:
    """Take the pictures out of an MJCF document whose mesh files are not there.

    Args:
        root: the document's root element, changed in place.
        files: names of the missing files, as the document has them.

    Returns:
        Bodies without an inertia of their own that have lost a mesh their mass may come from.
    """
    meshes = [m for m in root.iter("mesh") if m.get("file") in files]
    names = {m.get("name") or Path(m.get("file", "")).stem for m in meshes}
    bare: list[str] = []
    for parent in list(root.iter()):
        gone = [g for g in parent if g.tag == "geom" and g.get("mesh") in names]
        for geom in gone:
            parent.remove(geom)
        if gone and parent.tag == "body" and parent.find("inertial") is None:
            bare.append(parent.get("name", ""))
        for mesh in meshes:
            if mesh in list(parent):
                parent.remove(mesh)
    return bare


def rotation_of(quaternion: Float64[np.ndarray, "4"]) -> Float64[np.ndarray, "3 3"]:
    """The rotation matrix of MuJoCo's quaternion (w, x, y, z)."""
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    return pin.Quaternion(w, x, y, z).toRotationMatrix()


def pose_of(position: Float64[np.ndarray, "3"], quaternion: Float64[np.ndarray, "4"]) -> pin.SE3:
    """The pose that MuJoCo has as a position and a quaternion."""
    return pin.SE3(rotation_of(np.asarray(quaternion)), np.array(position, dtype=np.float64))
