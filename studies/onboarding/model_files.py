"""`models_folder`, `listed_models`, `other_models`, `all_models`: the robots below a folder."""

import importlib.metadata
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

from poise.errors import ConfigurationError
from studies.onboarding.listed import LISTED, Listed
from studies.plan import StudyOptions

_FEWEST_JOINTS = 10
"""Files with fewer joints are hands, arms and scenery."""


def models_folder(options: StudyOptions) -> Path:
    """The folder that the options name, or that of example-robot-data.

    Args:
        options: of the study.

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


def listed_models(folder: Path) -> dict[Listed, Path]:
    """The models of the list that are below a folder, in its order, with their files.

    Args:
        folder: with the models.
    """
    files = {model: folder / model.file for model in LISTED}
    return {model: path for model, path in files.items() if path.is_file()}


def other_models(folder: Path) -> tuple[Path, ...]:
    """Every URDF and MJCF below a folder that is not listed.

    Args:
        folder: with the models.
    """
    listed = set(listed_models(folder).values())
    return tuple(path for path in _models(folder) if path not in listed)


def all_models(folder: Path) -> tuple[Path, ...]:
    """Those of the list, then the others.

    Args:
        folder: with the models.

    Raises:
        ConfigurationError: there is none.
    """
    paths = (*listed_models(folder).values(), *other_models(folder))
    if not paths:
        raise ConfigurationError(
            "no model of a robot stands below the folder", got=str(folder), wanted="URDF or MJCF"
        )
    return paths


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
