"""The catalog: robots that can be loaded by name, each from a description like a user's own."""

import importlib.metadata
import re
import zipfile
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

from poise._schema import Count, Positive, Text, checked, read
from poise._yaml import read_text, read_yaml
from poise.errors import MissingExtraError, RobotError
from poise.robots._description import Description, parse_description

_DATA_PACKAGE, _DATA_EXTRA = "example-robot-data", "robots"
_DATA_FOLDER = "cmeel.prefix/share/example-robot-data/robots"
_FOLDER = Path(__file__).parent
_FAMILY = re.compile(r"humanoid([1-9][0-9]{0,8})")
_ORDER = ("humanoid33", "biped20", "g1")  # These stand first in the list; the others follow by name


@checked(RobotError)
@dataclass(frozen=True, kw_only=True)
class _About:
    """The section `catalog` of a description file: see `CatalogEntry`."""

    summary: Text
    joints: Count
    mass: Positive
    file: Text


@dataclass(frozen=True, kw_only=True)
class CatalogEntry:
    """Facts about a robot of the catalog that are known without loading it."""

    name: str  # the one that `load_robot` takes
    summary: str  # one line about it
    joints: int  # actuated ones
    mass: float  # of the whole robot [kg]
    licence: str  # of the model's files
    installed: bool  # True where it can be loaded here
    source: str  # where the document comes from: "bundled" or the package's name
    description: Description  # the facts, as a user's description file holds them
    file: str  # the model file, among the bundled ones or inside example-robot-data


def catalog() -> tuple[CatalogEntry, ...]:
    """All robots with a name, without loading any.

    The parametric humanoid stands here once, with 33 joints; `humanoid20` to `humanoid60` load too.
    """
    return tuple(_read_entry(name) for name in catalog_names())


def catalog_names() -> tuple[str, ...]:
    """Names of the robots in the catalog."""
    names = {path.stem for path in _FOLDER.glob("descriptions/*.yaml")}
    return (*_ORDER, *sorted(names - set(_ORDER)))


def find_entry(name: str) -> CatalogEntry | None:
    """The entry of a name, the humanoids of other joint counts included; None if there is none."""
    if name in catalog_names():
        return _read_entry(name)
    family = _FAMILY.fullmatch(name)
    if family is None:
        return None
    joints = int(family[1])
    stems = (file.removesuffix(".urdf") for file in _bundled_files())
    counts = sorted(int(m[1]) for stem in stems if (m := _FAMILY.fullmatch(stem)))
    if joints not in counts:
        raise RobotError(
            "no parametric humanoid has that many joints",
            got=name,
            wanted=f"humanoid{counts[0]} to humanoid{counts[-1]}",
        )
    return replace(_read_entry("humanoid33"), name=name, joints=joints, file=f"{name}.urdf")


def open_entry(entry: CatalogEntry) -> tuple[str, Path | None, tuple[Path, ...]]:
    """Text of an entry's document, its folder and the folders of its packages."""
    if entry.file in _bundled_files():
        with _open_bundled() as models:
            return models.read(entry.file).decode(), None, ()
    folder = _data_folder()
    if folder is None:
        raise MissingExtraError(_DATA_PACKAGE, _DATA_EXTRA, f"robot {entry.name!r}")
    path = folder / entry.file
    # The files name their meshes package://example-robot-data/robots/...
    return read_text(path, error=RobotError), path.parent, (folder.parent.parent,)


@cache
def _read_entry(name: str) -> CatalogEntry:
    where = f"{name}.yaml"
    text = read_text(_FOLDER / "descriptions" / where, error=RobotError)
    data = read_yaml(text, where, error=RobotError)
    about = read(_About, data.pop("catalog"), where, error=RobotError)
    description = parse_description(data, where)
    bundled = about.file in _bundled_files()
    return CatalogEntry(
        name=name,
        licence=description.licence,
        installed=bundled or _data_folder() is not None,
        source="bundled" if bundled else _DATA_PACKAGE,
        description=description,
        **vars(about),
    )


def _open_bundled() -> zipfile.ZipFile:
    return zipfile.ZipFile(_FOLDER / "models" / "bundled.zip")


@cache
def _bundled_files() -> frozenset[str]:
    with _open_bundled() as models:
        return frozenset(models.namelist())


def _data_folder() -> Path | None:
    """Folder of example-robot-data, None if it is not installed."""
    try:
        distribution = importlib.metadata.distribution(_DATA_PACKAGE)
    except importlib.metadata.PackageNotFoundError:
        return None
    folder = Path(str(distribution.locate_file(_DATA_FOLDER)))
    return folder if folder.is_dir() else None
