"""The catalog: robots that can be loaded by name, each from a description like a user's own."""

import importlib.metadata
import re
from dataclasses import dataclass, replace
from functools import cache
from importlib import resources
from pathlib import Path

from poise._schema import Count, Positive, Text, checked, read
from poise._yaml import read_text, read_yaml
from poise.errors import MissingExtraError, RobotError
from poise.robots._description import Description, parse_description
from poise.robots._parametric import MAX_JOINTS, MIN_JOINTS, generate

_DATA_PACKAGE, _DATA_EXTRA = "example-robot-data", "robots"
_DATA_FOLDER = "cmeel.prefix/share/example-robot-data/robots"
_FAMILY = re.compile(r"humanoid([1-9]\d*)")
_ORDER = ("humanoid33", "biped20", "g1")
"""These stand first in the list; the others follow by name."""


@checked(RobotError)
@dataclass(frozen=True, kw_only=True)
class _About:
    """What a description file of the catalog says besides: see `CatalogEntry`."""

    summary: Text
    joints: Count
    mass: Positive
    generator: Text | None = None
    file: Text | None = None


@dataclass(frozen=True, kw_only=True)
class CatalogEntry:
    """What the catalog says about a robot without loading it.

    Attributes:
        name: the name that `load_robot` takes.
        summary: one line about it.
        joints: number of actuated joints.
        mass: total mass [kg].
        licence: licence of the model's files.
        installed: whether it can be loaded here.
        source: where the document comes from: "made in code" or the package's name.
        description: the facts, as a user's description file holds them.
        generator: the generator of a robot made in code, else None.
        file: the model file inside example-robot-data, else None.
    """

    name: str
    summary: str
    joints: int
    mass: float
    licence: str
    installed: bool
    source: str
    description: Description
    generator: str | None = None
    file: str | None = None


def catalog() -> tuple[CatalogEntry, ...]:
    """All robots with a name, without loading any.

    The parametric humanoid stands here once, with 33 joints; `humanoid20` to `humanoid60` load too.
    """
    return tuple(_read_entry(name) for name in catalog_names())


def catalog_names() -> tuple[str, ...]:
    """Names of the robots in the catalog."""
    folder = resources.files("poise.robots").joinpath("descriptions")
    names = {f.name.removesuffix(".yaml") for f in folder.iterdir() if f.name.endswith(".yaml")}
    return (*_ORDER, *sorted(names - set(_ORDER)))


def find_entry(name: str) -> CatalogEntry | None:
    """The entry of a name, the humanoids of other joint counts included; None if there is none.

    Raises:
        RobotError: a humanoid with a number of joints that cannot be made.
    """
    if name in catalog_names():
        return _read_entry(name)
    family = _FAMILY.fullmatch(name)
    if family is None:
        return None
    joints = int(family[1])
    if not MIN_JOINTS <= joints <= MAX_JOINTS:
        raise RobotError(
            "no parametric humanoid has that many joints",
            got=name,
            wanted=f"humanoid{MIN_JOINTS} to humanoid{MAX_JOINTS}",
        )
    base = _read_entry("humanoid33")
    return replace(base, name=name, joints=joints)


def open_entry(entry: CatalogEntry) -> tuple[str, Path | None, tuple[Path, ...]]:
    """The document of an entry: its text, its folder and the folders of its packages.

    Raises:
        MissingExtraError: example-robot-data is not installed.
    """
    if entry.generator is not None:
        return generate(entry.generator, entry.joints), None, ()
    folder = _data_folder()
    if folder is None or entry.file is None:
        raise MissingExtraError(_DATA_PACKAGE, _DATA_EXTRA, f"robot {entry.name!r}")
    path = folder / entry.file
    # The files name their meshes package://example-robot-data/robots/...
    return read_text(path, error=RobotError), path.parent, (folder.parent.parent,)


@cache
def _read_entry(name: str) -> CatalogEntry:
    where = f"{name}.yaml"
    file = resources.files("poise.robots").joinpath("descriptions", where)
    data = read_yaml(file.read_text(encoding="utf-8"), where, error=RobotError)
    about = read(_About, data.pop("catalog"), where, error=RobotError)
    description = parse_description(data, where)
    return CatalogEntry(
        name=name,
        summary=about.summary,
        joints=about.joints,
        mass=about.mass,
        licence=description.licence,
        installed=about.generator is not None or _data_folder() is not None,
        source="made in code" if about.generator is not None else _DATA_PACKAGE,
        description=description,
        generator=about.generator,
        file=about.file,
    )


def _data_folder() -> Path | None:
    """Where example-robot-data lies, None if it is not installed."""
    try:
        distribution = importlib.metadata.distribution(_DATA_PACKAGE)
    except importlib.metadata.PackageNotFoundError:
        return None
    folder = Path(str(distribution.locate_file(_DATA_FOLDER)))
    return folder if folder.is_dir() else None
