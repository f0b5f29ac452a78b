"""A robot's document, read into the form that the rest of Poise relies on.

In that form a floating base has no joint in the document (building a model adds one to the root
link), a fixed base hangs on a link called `world`, every URDF hinge has limits, and an MJCF
document includes no other file and names all its bodies and joints.
"""

import xml.etree.ElementTree as ET
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, NamedTuple

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.errors import RobotError
from poise.robots._robot import ModelSource

Base = Literal["floating", "fixed"]

WORLD = "world"
"""The link that a fixed base hangs on."""

INERTIA = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
"""Attributes of a URDF's <inertia>."""

BLANK = "\ufeff \t\r\n"  # Before the first sign of XML, with the mark of a file's byte order

_ROUNDING = 1e-6
"""Inertias are written with about so many digits, by which a computed one may be off."""


class Coupling(NamedTuple):
    """A joint that follows another one: q_follower = offset + ratio q_leader."""

    follower: str
    leader: str
    offset: float = 0.0
    ratio: float = 1.0


class JointLimits(NamedTuple):
    """Limits by joint that stand in place of a document's own."""

    position: Mapping[str, tuple[float, float]] = MappingProxyType({})  # [rad, m]
    velocity: Mapping[str, float] = MappingProxyType({})  # [rad/s, m/s]
    torque: Mapping[str, float] = MappingProxyType({})  # [N m, N]


@dataclass(frozen=True, kw_only=True)
class Facts:
    """Facts about a robot in sections of a document that its own form lacks."""

    fixed: bool  # the document hangs its root on the world
    free: bool = False  # it has a floating joint before its root
    # world_R_base of the root link where the document puts it
    upright: Float64[np.ndarray, "3 3"] = field(default_factory=lambda: np.eye(3))
    # joint positions by keyframe [rad, m]
    poses: Mapping[str, dict[str, float]] = field(default_factory=dict[str, dict[str, float]])
    # largest torque or force by joint, from actuators [N m, N]
    torque: Mapping[str, float] = field(default_factory=dict[str, float])
    couplings: tuple[Coupling, ...] = ()  # joints that follow others
    remarks: tuple[str, ...] = ()  # parts of the document that are left out, as sentences


class Document(ABC):
    """A parsed document, changed in place by its methods."""

    kind: Literal["urdf", "mjcf"]
    link_tag: str

    def __init__(
        self,
        root: ET.Element,
        where: str,
        name: str,
        directory: Path | None = None,
        packages: Sequence[Path] = (),
    ) -> None:
        self.root, self.where, self.name = root, where, name
        self.directory = None if directory is None else directory.resolve()
        self.package_dirs: tuple[Path, ...] = tuple(packages)
        self.remarks: list[str] = []
        """Faults of the document that were repaired, as sentences."""
        self.velocity: dict[str, float] = {}
        """Largest speeds by joint that the document's format cannot hold [rad/s, m/s]."""
        self._tidy()
        if not self.links():
            raise RobotError(f"{where} has no links", got=f"<{root.tag}>", wanted="a robot")
        for tag, names in (("link", self.links()), ("joint", self.joints())):
            if "" in names:
                raise RobotError(f"{where} has a {tag} without a name", wanted="names for all")
            if twice := sorted({n for n in names if names.count(n) > 1}):
                raise RobotError(f"{where} has two {tag}s of one name", got=twice)
        self._check()
        self._check_inertias()

    @property
    def text(self) -> str:
        """The document as text."""
        return ET.tostring(self.root, encoding="unicode")

    @property
    def has_shapes(self) -> bool:
        """True where there is anything to see or to touch."""
        shapes = ("link/visual", "link/collision", ".//geom")
        return any(self.root.find(path) is not None for path in shapes)

    def source(self, locked: Iterable[str] = ()) -> ModelSource:
        """The document as a robot keeps it, with the joints that are welded at zero."""
        return ModelSource(
            kind=self.kind,
            text=self.text,
            directory=self.directory,
            package_dirs=self.package_dirs,
            locked_joints=tuple(locked),
        )

    def links(self) -> tuple[str, ...]:
        """Names of the links or bodies."""
        return tuple(e.get("name", "") for e in self.root.iter(self.link_tag))

    @abstractmethod
    def joints(self) -> tuple[str, ...]:
        """Names of the joints that move, without a floating base."""

    @cached_property
    def facts(self) -> Facts:
        """Facts in sections that `settle` takes out."""
        return self._read_facts()

    @abstractmethod
    def _read_facts(self) -> Facts:
        """Read them."""

    @abstractmethod
    def settle(self, base: Base) -> str:
        """Give the document its final form, and return its root link."""

    @abstractmethod
    def build(self, *, floating: bool) -> pin.Model:
        """Build Pinocchio's model of the settled document, with all its joints."""

    @abstractmethod
    def meshes(self) -> dict[str, Path | None]:
        """Mesh files by the name that the document has for them; None where there is no file."""

    @abstractmethod
    def drop_meshes(self, names: set[str]) -> list[str]:
        """Take meshes out, and return bodies whose mass comes from one of them."""

    def free_names(self, taken: set[str]) -> None:
        """Rename frames that have the name of a role, which means the role."""
        del taken

    def write_limits(self, limits: JointLimits) -> None:
        """Write limits into a document that keeps some."""
        del limits

    def mend_inertias(self) -> list[str]:
        """Make rotational inertias possible, and return the links whose inertia was changed."""
        mended: list[str] = []
        for link in self.root.iter(self.link_tag):
            inertial = link.find("inertial")
            given = None if inertial is None else inertial_numbers(inertial)[1]
            possible = None if given is None else possible_inertia(given)
            if inertial is not None and given is not None and possible is not None:
                self._write_inertia(inertial, possible)
                if np.abs(possible - given).max() > _ROUNDING * np.abs(given).max():
                    mended.append(link.get("name", ""))
        return mended

    @abstractmethod
    def _write_inertia(self, inertial: ET.Element, inertia: Float64[np.ndarray, "3 3"]) -> None:
        """Write it [kg m^2]."""

    def endless(self) -> list[str]:
        """Joints without position limits."""
        return []

    @abstractmethod
    def _tidy(self) -> None:
        """Repair faults that published models have, and take out other programs' elements."""

    @abstractmethod
    def _check(self) -> None:
        """Refuse faults that cannot be repaired."""

    def _check_inertias(self) -> None:
        """Refuse masses and inertias below zero; zero is checked where it matters."""
        for element in self.root.iter(self.link_tag):
            inertial = element.find("inertial")
            if inertial is None:
                continue
            mass, inertia = inertial_numbers(inertial)
            values = np.linalg.eigvalsh(inertia)
            if mass < 0.0 or values[0] < -_ROUNDING * max(abs(values)) - 1e-12:
                found = ", ".join(f"{v:.4g}" for v in values)
                raise RobotError(
                    f"{self.where}: {self.link_tag} {element.get('name')!r} has a negative mass "
                    "or inertia",
                    got=f"mass {mass:g} kg, principal inertias {found} kg m^2",
                    wanted="an <inertial> with a mass and principal inertias above zero",
                )


def possible_inertia(inertia: Float64[np.ndarray, "3 3"]) -> Float64[np.ndarray, "3 3"] | None:
    """An inertia whose largest principal moment is the others' sum; None for one that needs none.

    No body has a larger one, and MuJoCo refuses it.
    """
    values, axes = np.linalg.eigh(inertia)
    # MuJoCo's principal moments are off by up to 1e-12 of the largest.
    most = (values[0] + values[1]) * (1.0 - 1e-9)
    if values[2] <= most or most <= 0.0:
        return None
    values[2] = most
    return axes * values @ axes.T


def inertial_numbers(inertial: ET.Element) -> tuple[float, Float64[np.ndarray, "3 3"]]:
    """The mass [kg] and the inertia [kg m^2] of an element; what it lacks is zero."""
    parts = {part.tag: part for part in inertial}
    if parts:
        entries = parts.get("inertia", ET.Element("inertia"))
        xx, xy, xz, yy, yz, zz = (float(entries.get(k, "0")) for k in INERTIA)
        mass = float(parts.get("mass", ET.Element("mass")).get("value", "0"))
    else:
        (mass,) = _floats(inertial.get("mass", "0"))
        xx, yy, zz = _floats(inertial.get("diaginertia", "0 0 0"), 3)
        full = inertial.get("fullinertia")
        xy = xz = yz = 0.0
        if full is not None:
            xx, yy, zz, xy, xz, yz = _floats(full, 6)
    return mass, np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _floats(text: str, count: int = 1) -> list[float]:
    """The numbers of an attribute; zeros where there are not so many: MuJoCo names the fault."""
    words = text.split()
    if len(words) != count or not all(is_number(w) for w in words):
        return [0.0] * count
    return [float(w) for w in words]


def is_number(word: str) -> bool:
    """True for a word that is a finite number."""
    try:
        return "_" not in word and bool(np.isfinite(float(word)))
    except ValueError:
        return False


def free_name(name: str, taken: Iterable[str]) -> str:
    """The name, followed by underscores where it is taken."""
    others = set(taken)
    while name in others:
        name += "_"
    return name


def read_document(
    text: str,
    where: str,
    directory: Path | None = None,
    packages: Sequence[Path] = (),
    name: str = "",
) -> Document:
    """Parse URDF or MJCF text; a robot has the document's own name, or else the stem of `where`."""
    from poise.robots._mjcf import MjcfDocument
    from poise.robots._urdf import UrdfDocument

    try:
        root = ET.fromstring(text.lstrip(BLANK))
    except ET.ParseError as error:
        raise RobotError(f"{where} is not valid XML: {error}") from None
    readers: dict[str, Any] = {"robot": (UrdfDocument, "name"), "mujoco": (MjcfDocument, "model")}
    if root.tag not in readers:
        raise RobotError(
            f"{where} is neither URDF nor MJCF",
            got=f"<{root.tag}>",
            wanted="<robot> (URDF) or <mujoco> (MJCF) as the root element",
        )
    reader, key = readers[root.tag]
    own = _plain(root.get(key, ""))
    return reader(root, where, name or own or _plain(Path(where).stem), directory, packages)


_UNNAMED = "MuJoCo_Model"  # The name that MuJoCo gives to a model without one


def _plain(name: str) -> str:
    """Return a name as it may name a folder; "" for MuJoCo's default."""
    letters = "".join(c if c.isalnum() or c in "_+-." else "_" for c in name).strip("._")
    return "" if letters == _UNNAMED else letters
