"""`files_digest`: a digest of the files that a robot is loaded from."""

import hashlib
from pathlib import Path

from poise._yaml import read_text
from poise.errors import RobotError
from poise.robots._document import parse
from poise.robots._meshes import asset_folders, found_meshes
from poise.robots._robot import ModelSource

DESCRIPTION_SUFFIX = ".poise.yaml"
"""Behind the stem of a model file, the name of its description beside it."""


def files_digest(path: str | Path) -> str:
    """Eight letters for a URDF or MJCF with its includes, meshes and the description beside it."""
    path = Path(path)
    document = parse(read_text(path, error=RobotError), path.name, path.parent)
    directory, packages = asset_folders(document, path)
    source = ModelSource(
        kind=document.kind, text=document.text, directory=directory, package_dirs=packages
    )
    digest = hashlib.sha256(source.text.encode())
    for file in found_meshes(document.root, source):
        digest.update(file.read_bytes())
    description = path.with_name(path.stem + DESCRIPTION_SUFFIX)
    if description.is_file():
        digest.update(description.read_bytes())
    return digest.hexdigest()[:8]
