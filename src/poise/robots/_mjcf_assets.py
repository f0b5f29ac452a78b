"""Where the meshes of an MJCF document are, and what is left of it without some of them."""

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np

from poise.robots._mjcf_compile import asset_folder, mujoco_module, parse_mjcf
from poise.robots._robot import ModelSource


def mesh_file(root: ET.Element, name: str) -> str:
    """Where a mesh is, seen from the document's folder.

    Args:
        root: the document's root element.
        name: of the file, as the document has it.
    """
    said = [c.get("strippath") for c in root.findall("compiler") if c.get("strippath")]
    inside = Path(name).name if said[-1:] == ["true"] else name
    return str(asset_folder(root, "meshdir") / inside)


def drop_mesh_geoms(
    root: ET.Element, files: set[str], source: ModelSource, where: str
) -> list[str]:
    """Take the pictures out of an MJCF document whose mesh files are not there.

    Args:
        root: the document's root element, changed in place.
        files: names of the missing files, as the document has them.
        source: the same document, with its folder.
        where: the file, for messages.

    Returns:
        Bodies that have lost a mesh their mass comes from.
    """
    meshes = [m for m in root.iter("mesh") if m.get("file") in files]
    names = {m.get("name") or Path(m.get("file", "")).stem for m in meshes}
    lighter = _bodies_weighed_by(root, names, source, where)
    for parent in list(root.iter()):
        for child in list(parent):
            if child in meshes or (child.tag == "geom" and child.get("mesh") in names):
                parent.remove(child)
    return lighter


def _bodies_weighed_by(
    root: ET.Element, meshes: set[str], source: ModelSource, where: str
) -> list[str]:
    """Bodies whose mass comes from one of some meshes, as MuJoCo resolves classes and options."""
    mujoco, spec = mujoco_module(where), parse_mjcf(root, source.directory, where)
    sources, options = mujoco.mjtInertiaFromGeom, spec.compiler
    low, high = options.inertiagrouprange
    weighed: list[str] = []
    for body in spec.bodies:
        given = body.explicitinertial and options.inertiafromgeom == sources.mjINERTIAFROMGEOM_AUTO
        if given or options.inertiafromgeom == sources.mjINERTIAFROMGEOM_FALSE:
            continue
        lost = [g for g in body.geoms if g.meshname in meshes and low <= g.group <= high]
        # A mass that is not given is not a number, and follows from the density.
        if any((g.density if np.isnan(g.mass) else g.mass) > 0.0 for g in lost):
            weighed.append(body.name)
    return weighed
