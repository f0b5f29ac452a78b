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
_EACH = "[*]"  # every item of a list
_STEP = re.compile(r"[A-Za-z_]\w*|\d+")

Step = str | int  # a key, or a place in a list


def steps(path: str) -> tuple[Step, ...]:
    """The keys and places of a path."""
    if _PATH.fullmatch(path) is None:
        raise ConfigurationError(
            "not the path of a field", got=path, wanted="one as in pushes[0].velocity_change[1]"
        )
    return tuple(int(s) if s.isdigit() else s for s in _STEP.findall(path))


def spread(data: Mapping[str, Any], path: str) -> list[str]:
    """Paths of a field in every item of the lists that `[*]` stands for; one without any."""
    before, each, after = path.partition(_EACH)
    if not each:
        return [path]
    place: Any = data
    for step in steps(before):
        place = _inside(place, step, path)
    if not isinstance(place, list):
        raise ConfigurationError(
            f"the scenario has no list for {path!r}", got=place, wanted=f"a list {before!r}"
        )
    return [p for i in range(len(place)) for p in spread(data, f"{before}[{i}]{after}")]


def with_fields(data: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """Copy the content of a scenario file with other values in some fields.

    Sections that the file leaves out are made; places in lists have to be there. Fields that do not
    exist are refused by the scenario built from the result.
    """
    changed: dict[str, Any] = copy.deepcopy(dict(data))
    for path, value in values.items():
        *above, last = steps(path)
        place: Any = changed
        for depth, step in enumerate(above):
            inside = _inside(place, step, path)
            if isinstance(inside, str):
                # A controller or a task may be written as its bare name.
                inside = {"name": inside} if depth == 0 else {inside: {}}
            place[step] = place = {} if inside is None else inside
        _inside(place, last, path)
        place[last] = copy.deepcopy(value)
    return changed


def _inside(data: Any, step: Step, path: str) -> Any:
    """The content of a place now; None for a key that is not there yet."""
    if isinstance(step, str) and isinstance(data, dict):
        return data.get(step)
    if isinstance(step, int) and isinstance(data, list) and step < len(data):
        return data[step]
    wanted = (
        f"a list longer than {step}" if isinstance(step, int) else f"keys where it says {step!r}"
    )
    got = f"a list of {len(data)}" if isinstance(data, list) else data
    raise ConfigurationError(
        f"the scenario has no field {path!r}",
        got=sorted(data) if isinstance(data, dict) else got,
        wanted=f"{wanted} in the scenario's file",
    )
