"""`read_model_file`: what a URDF or MJCF says of a robot, in one form."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from poise._show import few
from poise._yaml import read_text
from poise.errors import RobotError
from poise.robots._base import followers_of, leaders_of, settle_base
from poise.robots._document import mend_inertias, parse, write_limits
from poise.robots._meshes import asset_folders, drop_missing_meshes
from poise.robots._mjcf_facts import read_facts
from poise.robots._robot import ModelSource


@dataclass(kw_only=True)
class ModelFile:
    """What a model file says, with a free base; its remarks are sentences."""

    name: str
    where: str
    source: ModelSource
    links: tuple[str, ...]
    joints: tuple[str, ...]
    fixed: bool
    upright: Float64[np.ndarray, "3 3"]
    poses: Mapping[str, Mapping[str, float]]
    torque: Mapping[str, float]
    grips: Collection[str]
    locked: tuple[str, ...]
    remarks: list[str] = field(default_factory=list[str])


def read_model_file(path: Path) -> ModelFile:
    """Read a file; hinges without position limits get infinite ones."""
    document = parse(read_text(path, error=RobotError), path.name, path.parent)
    links, joints = document.links(), document.joints()
    directory, packages = asset_folders(document, path)
    urdf = document.kind == "urdf"
    mjcf = None if urdf else read_facts(document, directory)
    parents = {p.get("link") for p in document.root.iter("parent")}
    hung = "world" in parents - {c.get("link") for c in document.root.iter("child")}
    settle_base(document, "floating")
    mended = mend_inertias(document)
    if urdf:
        endless = [
            j.get("name", "")
            for j in document.root.findall("joint")
            if j.get("type") == "continuous"
            or (j.get("type") == "revolute" and j.find("limit") is None)
        ]
        write_limits(document, dict.fromkeys(endless, (-1e301, 1e301)), {}, {})
    followers = tuple(dict.fromkeys(followers_of(document, mjcf)))
    source = ModelSource(
        kind=document.kind,
        text=document.text,
        directory=directory,
        package_dirs=packages,
        locked_joints=followers,
    )
    drop_missing_meshes(document.root, source, path.name)
    return ModelFile(
        name=path.stem,
        where=path.name,
        source=replace(source, text=document.text),
        links=links,
        joints=joints,
        fixed=hung if mjcf is None else not mjcf.free,
        upright=np.eye(3) if mjcf is None else mjcf.upright,
        poses={} if mjcf is None else mjcf.poses,
        torque={} if mjcf is None else mjcf.torque,
        grips=leaders_of(document, mjcf),
        locked=followers,
        remarks=[f"inertias that no body has are made possible: {few(mended)}"] if mended else [],
    )
