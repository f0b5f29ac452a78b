"""MJCF read by MuJoCo's own compiler, which resolves defaults, classes, frames and geometry.

`make_spec`: MuJoCo's specification of a text. `parse_mjcf`: of a document. `settled_spec`: of a
settled one. `compile_mjcf`: the model of a settled one.
"""

import xml.etree.ElementTree as ET
from collections.abc import Callable, Set
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.errors import RobotError, import_extra
from poise.robots._robot import ModelSource


def mujoco_module(where: str) -> ModuleType:
    """MuJoCo, which reads MJCF."""
    return import_extra("mujoco", "sim", f"Reading {where}, which is MJCF,")


def compile_mjcf(source: ModelSource, where: str, pictured: Set[str] = frozenset()) -> Any:
    """MuJoCo's compiled model of a settled document."""
    spec = settled_spec(source, where)
    # A controller reads no pictures.
    drop_meshes(mujoco_module(where), spec, lambda geom: geom.parent.name in pictured)
    return compile_spec(spec, where)


def settled_spec(source: ModelSource, where: str) -> Any:
    """MuJoCo's specification of a settled document, which compiles link by link."""
    spec = parse_mjcf(ET.fromstring(source.text), source.directory, where)
    spec.compiler.fusestatic = False
    # MuJoCo needs some mass on every moving body; a massless one gets this little.
    spec.compiler.boundmass = max(spec.compiler.boundmass, 1e-12)
    spec.compiler.boundinertia = max(spec.compiler.boundinertia, 1e-14)
    return spec


def compile_spec(spec: Any, where: str) -> Any:
    """MuJoCo's compiled model of a specification."""
    try:
        return spec.compile()
    except ValueError as error:
        raise RobotError(f"MuJoCo cannot build {where}: {error}") from None


def parse_mjcf(root: ET.Element, directory: Path | None, where: str) -> Any:
    """MuJoCo's specification of a document, not yet compiled."""
    mujoco = mujoco_module(where)
    if directory is not None:
        root = ET.fromstring(ET.tostring(root, encoding="unicode"))
        anchor_assets(root, directory)
    try:
        return make_spec(mujoco, root)
    except ValueError as error:
        raise RobotError(f"MuJoCo cannot read {where}: {error}") from None


def make_spec(mujoco: ModuleType, root: ET.Element) -> Any:
    """MuJoCo's specification of a URDF or MJCF document, with a dense constraint Jacobian.

    MuJoCo itself takes a sparse one from 60 degrees of freedom on, whatever else is in the scene.
    MuJoCo 4.0.0 may then factor a wrong Hessian in Newton's method (its issue 3767): convergence is
    slow, and accelerations are wrong.
    """
    spec = mujoco.MjSpec.from_string(ET.tostring(root, encoding="unicode"))
    spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    return spec


def anchor_assets(root: ET.Element, directory: Path) -> None:
    """Make the folders for meshes and textures absolute, for a document read from a string."""
    folders = {k: str(directory / asset_folder(root, k)) for k in ("meshdir", "texturedir")}
    # Of several sections the last wins, attribute by attribute.
    for compiler in root.findall("compiler") or [ET.SubElement(root, "compiler")]:
        compiler.attrib.update(folders)


def asset_folder(root: ET.Element, key: str) -> Path:
    """The folder for meshes or textures that a document names."""
    folder = Path()
    for compiler in root.findall("compiler"):
        folder = Path(compiler.get(key, compiler.get("assetdir", str(folder))))
    return folder


def drop_meshes(mujoco: ModuleType, spec: Any, needed: Callable[[Any], bool]) -> None:
    """Leave out mesh geometry that no inertia comes from, and the meshes that nothing else uses."""
    sources = mujoco.mjtInertiaFromGeom
    if spec.compiler.inertiafromgeom == sources.mjINERTIAFROMGEOM_TRUE:
        return
    given = spec.compiler.inertiafromgeom == sources.mjINERTIAFROMGEOM_FALSE
    kinds = (mujoco.mjtGeom.mjGEOM_MESH, mujoco.mjtGeom.mjGEOM_SDF)
    kept: set[str] = set()
    for body in spec.bodies:
        unread = given or body.explicitinertial or body.name == "world"
        for geom in [g for g in body.geoms if g.meshname]:
            if geom.type in kinds and unread and not needed(geom):
                spec.delete(geom)
            else:
                kept.add(geom.meshname)
    for mesh in [m for m in spec.meshes if (m.name or Path(m.file).stem) not in kept]:
        spec.delete(mesh)


def rotation_of(quaternion: Float64[np.ndarray, "4"]) -> Float64[np.ndarray, "3 3"]:
    """The rotation matrix of MuJoCo's quaternion (w, x, y, z)."""
    w, x, y, z = quaternion / np.linalg.norm(quaternion)
    return pin.Quaternion(w, x, y, z).toRotationMatrix()


def pose_of(position: Float64[np.ndarray, "3"], quaternion: Float64[np.ndarray, "4"]) -> pin.SE3:
    """The pose that MuJoCo has as a position and a quaternion."""
    return pin.SE3(rotation_of(np.asarray(quaternion)), np.array(position, dtype=np.float64))
