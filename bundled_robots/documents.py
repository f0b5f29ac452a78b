"""The archive of all bundled robots: made, read and compared."""

import math
import re
import zipfile
from pathlib import Path

from bundled_robots.humanoid import TELEOPERATED_BIPED, TOCABI_CLASS, humanoid
from bundled_robots.manipulators import arm6, upper17
from bundled_robots.proportions import JOINTS

ARCHIVE = Path(__file__).parents[1] / "src/poise/robots/models/bundled.zip"

_NUMBER = re.compile(r"-?\d+\.\d+(?:e-?\d+)?")
_ROUNDING = 1e-12
"""Numbers closer than this agree: last digits depend on the machine's linear algebra."""


def make_documents() -> dict[str, str]:
    """URDF text of every bundled robot by its file's name, sorted."""
    trees = [humanoid(f"humanoid{n}", n, TOCABI_CLASS) for n in JOINTS]
    trees += [humanoid("biped20", 20, TELEOPERATED_BIPED), arm6(), upper17()]
    return {f"{t.name}.urdf": t.urdf() for t in sorted(trees, key=lambda t: t.name)}


def write_archive(documents: dict[str, str], path: Path = ARCHIVE) -> None:
    """Write a zip archive whose bytes depend on the documents and the compressor alone."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(path, "w") as archive:
        for name, text in documents.items():
            # A `ZipInfo` without a date has that of 1980.
            info = zipfile.ZipInfo(name)
            info.create_system, info.external_attr = 3, 0o644 << 16
            archive.writestr(info, text, zipfile.ZIP_DEFLATED, compresslevel=9)


def read_archive(path: Path = ARCHIVE) -> dict[str, str]:
    """URDF text by file name; empty where there is no archive."""
    if not path.is_file():
        return {}
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name).decode() for name in archive.namelist()}


def differences(made: dict[str, str], shipped: dict[str, str]) -> list[str]:
    """Names of the documents that stand on one side alone or differ by more than rounding."""
    names = sorted(made.keys() | shipped.keys())
    return [n for n in names if not _agree(made.get(n, ""), shipped.get(n, ""))]


def _agree(made: str, shipped: str) -> bool:
    if _NUMBER.sub("#", made) != _NUMBER.sub("#", shipped):
        return False
    pairs = zip(_NUMBER.findall(made), _NUMBER.findall(shipped), strict=True)
    return all(
        math.isclose(float(a), float(b), rel_tol=_ROUNDING, abs_tol=_ROUNDING) for a, b in pairs
    )
