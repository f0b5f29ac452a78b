"""`files_digest`: whether the files that a robot is loaded from are those of another time."""

import hashlib
from pathlib import Path

from poise.robots._inputs import XACRO, open_document

DESCRIPTION_SUFFIX = ".poise.yaml"
"""Behind the stem of a model file, the name of its description beside it."""


def description_of(path: Path) -> Path:
    """The description beside a model file."""
    name = path.name.removesuffix(XACRO)
    stem = Path(name).stem if Path(name).suffix in (".urdf", ".xml", ".mjcf") else name
    return path.with_name((stem if name != path.name else path.stem) + DESCRIPTION_SUFFIX)


def files_digest(path: str | Path) -> str:
    """The first letters of a digest of a model file and of all that is loaded along with it.

    These are the files that it includes, the meshes that are there, and the description beside it.
    """
    document = open_document(Path(path))
    digest = hashlib.sha256(document.text.encode())
    for file in document.meshes().values():
        if file is not None:
            digest.update(file.read_bytes())
    description = description_of(Path(path))
    if description.is_file():
        digest.update(description.read_bytes())
    return digest.hexdigest()[:8]
