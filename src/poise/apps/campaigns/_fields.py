"""Fields of a scenario file by their paths, such as `pushes[0].velocity_change[1]`.

A path is written as messages about scenario files write it: keys with dots between them, places in
lists in brackets, from zero.
"""

import copy
import re
from collections.abc import Mapping
from typing import Any

from poise.errors import ConfigurationError

_PATH = re.compile(r"[A-Za-z_]\w*(\[\d+\]|\.[A-Za-z_]\w*)*")
_STEP = re.compile(r"[A-Za-z_]\w*|\d+")

Step = str | int
"""A key, or a place in a list."""


def steps(path: str) -> tuple[Step, ...]:
    """The keys and places of a path."""
    if _PATH.fullmatch(path) is None:
        raise ConfigurationError(
            "not the path of a field", got=path, wanted="one as in pushes[0].velocity_change[1]"
        )
    return tuple(int(s) if s.isdigit() else s for s in _STEP.findall(path))


def with_fields(data: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """The content of a scenario file with other values in some fields.

    Sections that the file leaves out are made; places in lists have to be there. Whether a field
    exists is for the scenario to say when it is made of the result.
    """
    changed: dict[str, Any] = copy.deepcopy(dict(data))
    for path, value in values.items():
        _set(changed, steps(path), copy.deepcopy(value), path)
    return changed


def _set(data: Any, way: tuple[Step, ...], value: Any, path: str) -> None:
    *above, last = way
    for depth, step in enumerate(above):
        inside = _inside(data, step, path)
        if isinstance(inside, str):
            # A controller or a task may be written as its bare name.
            inside = {"name": inside} if depth == 0 else {inside: {}}
        elif inside is None:
            inside = {}
        data[step] = data = inside
    _inside(data, last, path)
    data[last] = value


def _inside(data: Any, step: Step, path: str) -> Any:
    """What stands at a place now; None for a key that is not there yet."""
    if isinstance(step, str) and isinstance(data, dict):
        return data.get(step)
    if isinstance(step, int) and isinstance(data, list) and step < len(data):
        return data[step]
    wanted = (
        f"keys where it says {step!r}" if isinstance(step, str) else f"a list longer than {step}"
    )
    got = f"a list of {len(data)}" if isinstance(data, list) else _kind(data)
    raise ConfigurationError(
        f"the scenario has no field {path!r}", got=got, wanted=f"{wanted} in the scenario's file"
    )


def _kind(data: Any) -> object:
    return sorted(data) if isinstance(data, dict) else data
