"""Strict reading of YAML text: no tags, no key twice, and a line for every value."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

from poise.errors import PoiseError

_LONGEST = 3000
"""Longest scalar [characters]; Python prints no longer integers."""

_FLOAT = "tag:yaml.org,2002:float"

_OLD_SPELLING = re.compile(r"[-+]?0[0-9_]+|[^:]+(:[^:]+)+")
"""Numbers to the base of 8 or 60 in YAML 1.1, such as 010 or 1:30."""


class LinedDict(dict[Any, Any]):
    """A mapping from a file; `lines` holds the line of each key."""

    lines: dict[object, int]


class LinedList(list[Any]):
    """A list from a file; `lines` holds the line of each entry."""

    lines: list[int]


def read_yaml(text: str, where: str, *, error: type[PoiseError]) -> LinedDict:
    """Parse YAML text whose top is a mapping, with no key given twice."""
    try:
        data = yaml.load(text, Loader=_StrictLoader)
    # A date that does not exist is a ValueError, and lists may be nested without end.
    except (yaml.YAMLError, ValueError, RecursionError) as problem:
        raise error(f"{where} is not valid YAML: {problem}") from None
    if not isinstance(data, LinedDict):
        raise error(f"{where} has the wrong kind", got=data, wanted="keys with values")
    return data


def read_text(path: Path, *, error: type[PoiseError]) -> str:
    """Read a text file."""
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise error("file is not text", got=str(path), wanted="UTF-8 text") from None
    # A ValueError is of a path with a zero byte.
    except (OSError, ValueError) as problem:
        what = f"cannot read a file ({getattr(problem, 'strerror', problem)})"
        raise error(what, got=str(path), wanted="a readable file") from None


class _StrictLoader(yaml.SafeLoader):
    """Safe loader that rejects tags, duplicate keys and numbers to the base of 8 or 60."""

    def compose_node(self, parent: Any, index: Any) -> Any:
        event = self.peek_event()
        # With a tag a text can claim to be a number, which the safe loader does not check.
        if getattr(event, "tag", None) is not None:
            raise yaml.YAMLError(f"the tag {event.tag!r} is not allowed, {event.start_mark}")
        if isinstance(event, yaml.ScalarEvent) and len(event.value) > _LONGEST:
            raise yaml.YAMLError(f"a text is longer than {_LONGEST} letters, {event.start_mark}")
        node: Any = super().compose_node(parent, index)
        if node.tag in (_FLOAT, "tag:yaml.org,2002:int") and _OLD_SPELLING.fullmatch(node.value):
            read = self.construct_object(node)
            raise yaml.YAMLError(
                f"{node.value!r} would be read as {read:g}: write the number that is meant "
                f"without a leading zero or colon, or a text in quotes, {node.start_mark}"
            )
        return node

    def construct_mapping(self, node: Any, deep: bool = False) -> dict[Any, Any]:
        seen: set[object] = set()
        for key_node, _ in node.value:
            key = key_node.value
            if not isinstance(key, str):
                raise yaml.YAMLError(f"a key is not text, {key_node.start_mark}")
            if key in seen:
                raise yaml.YAMLError(f"the key {key!r} stands twice, {key_node.start_mark}")
            seen.add(key)
        return super().construct_mapping(node, deep)

    def lined_mapping(self, node: Any) -> Iterator[LinedDict]:
        """Make a mapping, handed out before it is filled, for files that refer to it."""
        data = LinedDict()
        yield data
        data.update(self.construct_mapping(node))
        data.lines = {key.value: key.start_mark.line + 1 for key, _ in node.value}

    def lined_list(self, node: Any) -> Iterator[LinedList]:
        """Make a list, handed out before it is filled."""
        data = LinedList()
        data.lines = [entry.start_mark.line + 1 for entry in node.value]
        yield data
        data.extend(self.construct_sequence(node))


_StrictLoader.add_constructor("tag:yaml.org,2002:map", _StrictLoader.lined_mapping)
_StrictLoader.add_constructor("tag:yaml.org,2002:seq", _StrictLoader.lined_list)
# 1e-3 and 1.0e9 are numbers, as in YAML 1.2.
_EXPONENT = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)[eE][-+]?[0-9]+$")
_StrictLoader.add_implicit_resolver(_FLOAT, _EXPONENT, list("-+.0123456789"))
