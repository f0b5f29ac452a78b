"""The file of a recording: a header of one line of JSON, and rows of numbers.

The header is padded with spaces to `HEADER_BYTES` and a new line, and behind it are rows of `ROW`,
little-endian, without gaps. It is written while the run goes on and read through a memory map, so
its length does not matter.
"""

import json
from enum import IntEnum
from pathlib import Path
from typing import Any

import numpy as np

from poise.errors import ConfigurationError, PoiseError

FORMAT, VERSION = "poise teleoperation", 1
HEADER_BYTES = 16384
"""Length of the header with its new line: room for a world of some fifty blocks."""

UNFINISHED = -1
"""Number of rows in the header of a file that was not closed."""


class RowKind(IntEnum):
    """What a row holds."""

    SAMPLE = 0
    """What the device sent: time, left, right, upright."""
    PUSH = 1
    """A push on the torso: left is the force [N], right[0] how long [s]."""


ROW = np.dtype(
    [
        ("tick", "<i8"),
        ("kind", "<u1"),
        ("upright", "<u1"),
        ("time", "<f8"),
        ("left", "<f8", (3,)),
        ("right", "<f8", (3,)),
    ]
)
"""A row: the tick before which it came, counted from zero, and what came."""


class RecordingError(PoiseError):
    """A recording that cannot be read or does not belong to this robot."""


def header_text(header: dict[str, Any]) -> bytes:
    """A header as it stands in the file.

    Args:
        header: as JSON.

    Raises:
        ConfigurationError: it is too long or no JSON.
    """
    try:
        text = json.dumps(header, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise ConfigurationError(f"the set-up of a recording is no JSON: {error}") from None
    encoded = text.encode()
    if len(encoded) >= HEADER_BYTES:
        raise ConfigurationError(
            "the set-up of a recording is too long",
            got=f"{len(encoded)} bytes",
            wanted=f"less than {HEADER_BYTES}",
        )
    return encoded.ljust(HEADER_BYTES - 1) + b"\n"


def read_header(path: Path) -> dict[str, Any]:
    """The header of a file, checked.

    Args:
        path: the file.

    Raises:
        RecordingError: no recording, another version, or a header that is broken.
    """
    try:
        with path.open("rb") as file:
            head = file.read(HEADER_BYTES)
    except OSError as error:
        raise RecordingError(f"the recording {path} cannot be read: {error.strerror}") from None
    wanted = f"a file that a {FORMAT} run has left"
    try:
        header = json.loads(head)
    except (UnicodeDecodeError, json.JSONDecodeError):
        raise RecordingError(f"{path.name} is no recording", wanted=wanted) from None
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise RecordingError(f"{path.name} is no recording", wanted=wanted)
    if header.get("version") != VERSION:
        raise RecordingError(
            f"the recording {path.name} is of another version",
            got=header.get("version"),
            wanted=str(VERSION),
        )
    kinds = {"robot": str, "dt": float, "rows": int, "setup": dict}
    for key, kind in kinds.items():
        if not isinstance(header.get(key), kind):
            raise RecordingError(
                f"the header of the recording {path.name} is broken",
                got=header.get(key),
                wanted=f"{key} as {kind.__name__}",
            )
    if not header["dt"] > 0.0:
        raise RecordingError(
            f"the header of the recording {path.name} is broken", got=header["dt"], wanted="dt > 0"
        )
    return header
