"""`open_document`: one document from whatever a user has of a robot; a digest of its files."""

import hashlib
import os
from pathlib import Path
from types import ModuleType
from typing import Any

import pinocchio as pin

from poise._checks import checked_kind
from poise._yaml import read_text
from poise.errors import RobotError, import_extra
from poise.robots._document import BLANK, Document, read_document
from poise.robots._limits import NO_LIMIT, hinges
from poise.robots._mjcf_write import mjcf_of
from poise.robots._noise import captured

RobotInput = Any
"""A path, XML text, `pin.Model`, `mujoco.MjModel`, `mujoco.MjSpec` or a module with a path."""

WANTED = (
    "a name of `poise robots`, a path to URDF, MJCF or xacro, XML text, a pinocchio.Model, a "
    "mujoco.MjModel or MjSpec, or a module of robot_descriptions"
)

XACRO = ".xacro"

_PATHS = ("URDF_PATH", "MJCF_PATH", "XACRO_PATH")
"""Attributes of a module of robot_descriptions that name its file."""


def path_of(given: RobotInput) -> Path | None:
    """The file that an input names; None for one that is no file."""
    if isinstance(given, ModuleType):
        path = next((getattr(given, key) for key in _PATHS if hasattr(given, key)), None)
        if not isinstance(path, str | os.PathLike):
            raise RobotError(
                f"module {given.__name__} names no model", got=given, wanted=" or ".join(_PATHS)
            )
        return Path(os.fsdecode(path))
    if isinstance(given, str) and given.lstrip(BLANK)[:1] == "<":
        return None
    return Path(os.fsdecode(given)) if isinstance(given, str | os.PathLike) else None


def open_document(given: RobotInput, geometry: pin.GeometryModel | None = None) -> Document:
    """Read a robot's document."""
    path = path_of(given)
    if geometry is not None and not isinstance(given, pin.Model):
        raise RobotError("geometry comes with a model", got=given, wanted="a pinocchio.Model")
    if path is not None:
        # A pipe without a writer would be waited for.
        if os.path.exists(path) and not os.path.isfile(path):
            raise RobotError("cannot read what is no file", got=str(path), wanted=WANTED)
        expanded = path.suffix == XACRO and path.is_file()
        text = _expanded(path) if expanded else read_text(path, error=RobotError)
        return read_document(text, path.name, path.parent, _package_of(given))
    if isinstance(given, str):
        return read_document(given, "text", Path())
    if isinstance(given, pin.Model):
        if geometry is not None:
            checked_kind(geometry, pin.GeometryModel, "geometry of a model")
        document = read_document(mjcf_of(given, geometry), given.name or "pin.Model")
        speeds = {n: float(given.velocityLimit[j.idx_v]) for n, j in hinges(given)}
        document.velocity = {n: speed for n, speed in speeds.items() if 0.0 < speed < NO_LIMIT}
        return document
    kind = type(given).__name__
    if kind in ("MjModel", "MjSpec") and type(given).__module__.startswith("mujoco"):
        return read_document(mjcf_of(given), kind)
    raise RobotError("this is no robot", got=given, wanted=WANTED)


def _package_of(given: RobotInput) -> tuple[Path, ...]:
    package = getattr(given, "PACKAGE_PATH", None)
    return (Path(package).parent, Path(package)) if isinstance(package, str | os.PathLike) else ()


def _expanded(path: Path) -> str:
    """URDF or MJCF text of a xacro file, with packages found above it and beside its own."""
    what = f"Reading {path.name}, which is xacro,"
    xacro = import_extra("xacro", "xacro", what, package="xacrodoc")
    packages = import_extra("xacrodoc.packages", "xacro", what)
    path = path.resolve()
    own = next((p for p in path.parents if (p / "package.xml").is_file()), path.parent)
    packages.look_in([str(own.parent)])
    packages.walk_up_from(path)
    with captured():
        try:
            return xacro.process_file(str(path)).toxml()
        # Expressions in a file raise anything.
        except Exception as error:
            reason = str(error).strip() or type(error).__name__
    raise RobotError(
        f"{path.name} cannot be expanded by xacro: {reason}",
        got=str(path),
        wanted="a file that needs no arguments and whose packages are above it or beside its own, "
        "or the URDF that xacro makes of it",
    )


def description_of(path: Path) -> Path:
    """The description beside a model file."""
    name = path.name.removesuffix(XACRO)
    stem = Path(name).stem if Path(name).suffix in (".urdf", ".xml", ".mjcf") else name
    return path.with_name((stem if name != path.name else path.stem) + ".poise.yaml")


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
