"""`model_files`: the robots below a folder."""

import importlib.metadata
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

from poise.errors import ConfigurationError
from studies.plan import StudyOptions

_FEWEST_JOINTS = 10
"""Files with fewer joints are hands, arms and scenery."""


def model_files(options: StudyOptions) -> tuple[Path, tuple[Path, ...]]:
    """The folder with the models, and their files in it.

    Args:
        options: which may name the folder.

    Raises:
        ConfigurationError: no such folder, none in it, or none is named and example-robot-data is
            missing.
    """
    folder = _folder(options)
    paths = tuple(_models(folder))
    if not paths:
        raise ConfigurationError(
            "no model of a robot stands below the folder", got=str(folder), wanted="URDF or MJCF"
        )
    return folder, paths


def _folder(options: StudyOptions) -> Path:
    """Where the models are.

    Raises:
        ConfigurationError: no such folder, or none is named and example-robot-data is missing.
    """
    if options.directory is not None:
        folder = Path(options.directory)
        if not folder.is_dir():
            raise ConfigurationError("no such folder", got=str(folder), wanted="--dir DIR")
        return folder
    try:
        data = importlib.metadata.distribution("example-robot-data")
    except importlib.metadata.PackageNotFoundError:
        raise ConfigurationError(
            "no models to try", got="no --dir", wanted="--dir DIR, or example-robot-data"
        ) from None
    return Path(str(data.locate_file("cmeel.prefix/share/example-robot-data/robots")))


def _models(folder: Path) -> Iterator[Path]:
    """Files with a robot of some size in them; scenes that include one are left out."""
    for path in sorted([*folder.rglob("*.urdf"), *folder.rglob("*.xml")]):
        try:
            root = ET.parse(path).getroot()
        except (ET.ParseError, OSError, UnicodeDecodeError):
            continue
        if root.tag == "robot":
            joints = [j for j in root.findall("joint") if j.get("type") != "fixed"]
        elif root.tag == "mujoco":
            joints = [j for world in root.findall("worldbody") for j in world.iter("joint")]
        else:
            continue
        if len(joints) >= _FEWEST_JOINTS:
            yield path
