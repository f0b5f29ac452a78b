"""Strict reading of a YAML mapping: every value has a kind, and no key goes unread."""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import yaml
from jaxtyping import Float64

from poise.errors import PoiseError

_LONGEST = 3000
"""No name, number or description is longer [letters]; Python prints no longer whole numbers."""

T = TypeVar("T")

LARGEST = 1e9
"""No number in a file is larger, whatever its unit: no robot needs it, and its powers overflow."""


class Fields:
    """The keys of one mapping, taken out one by one with their kinds checked.

    Args:
        data: the mapping as the YAML parser gave it.
        where: the file and the keys that lead here, for messages.
        keys: the keys that may stand here; None where they are names that the user chooses.
        error: the class of what is raised.

    Raises:
        PoiseError: `data` is no mapping, or has an unknown key or one that is no text.
    """

    def __init__(
        self,
        data: object,
        where: str,
        keys: Iterable[str] | None = None,
        *,
        error: type[PoiseError],
    ) -> None:
        self._error = error
        if not isinstance(data, dict):
            raise self._error(f"{where} has the wrong kind", got=data, wanted="keys with values")
        self.where = where
        self._data: dict[str, Any] = {}
        for key, value in data.items():
            if not isinstance(key, str):
                raise self._error(f"a key of {where} is not text", got=key, wanted="a name")
            self._data[key] = value
        allowed = None if keys is None else tuple(keys)
        for key in self._data:
            if allowed is not None and key not in allowed:
                raise self._error(f"unknown key in {where}", got=key, choices=allowed)

    def __contains__(self, key: str) -> bool:
        """Whether the key is there."""
        return key in self._data

    def __iter__(self) -> Iterator[str]:
        """The keys, in the order of the file."""
        return iter(self._data)

    def raw(self, key: str) -> Any:
        """The value as it stands.

        Raises:
            PoiseError: the key is missing.
        """
        if key not in self._data:
            raise self._error(f"{self.where} lacks the key {key!r}", got=sorted(self._data))
        return self._data[key]

    def text(self, key: str) -> str:
        """A text that is not empty."""
        value = self.raw(key)
        if not isinstance(value, str) or not value.strip():
            raise self._error(f"{self._name(key)} has the wrong kind", got=value, wanted="a text")
        return value.strip()

    def number(self, key: str, *, positive: bool = False, minimum: float | None = None) -> float:
        """A number up to `LARGEST`, above zero or at least `minimum` if asked for."""
        value = self.raw(key)
        wanted = "a positive number" if positive else "a number"
        wanted += f" of at least {minimum}" if minimum is not None else ""
        if not isinstance(value, int | float) or isinstance(value, bool):
            raise self._error(f"{self._name(key)} has the wrong kind", got=value, wanted=wanted)
        # NaN fails the comparison, which whole numbers too large for a float survive.
        if not -LARGEST <= value <= LARGEST:
            wanted += f", finite and at most {LARGEST:g} in size"
            raise self._error(f"{self._name(key)} is out of range", got=value, wanted=wanted)
        if (positive and value <= 0.0) or (minimum is not None and value < minimum):
            raise self._error(f"{self._name(key)} is out of range", got=value, wanted=wanted)
        return float(value)

    def numbers(self, key: str, count: int) -> Float64[np.ndarray, " n"]:
        """A list of `count` numbers."""
        value = self.raw(key)
        if not isinstance(value, list) or len(value) != count:
            raise self._error(
                f"{self._name(key)} has the wrong kind", got=value, wanted=f"{count} numbers"
            )
        items = Fields({str(i): v for i, v in enumerate(value)}, self._name(key), error=self._error)
        return np.array([items.number(str(i)) for i in range(count)])

    def texts(self, key: str) -> tuple[str, ...]:
        """A list of texts."""
        value = self.raw(key)
        if not isinstance(value, list):
            raise self._error(
                f"{self._name(key)} has the wrong kind", got=value, wanted="a list of texts"
            )
        items = Fields({str(i): v for i, v in enumerate(value)}, self._name(key), error=self._error)
        return tuple(items.text(str(i)) for i in range(len(value)))

    def section(self, key: str, keys: Iterable[str] | None = None) -> "Fields":
        """The mapping under a key; an empty one where the key is missing."""
        return Fields(self._data.get(key, {}), self._name(key), keys, error=self._error)

    def each(self, read: Callable[["Fields", str], T]) -> dict[str, T]:
        """Read every key in the same way."""
        return {key: read(self, key) for key in self._data}

    def _name(self, key: str) -> str:
        return f"{self.where}: {key}" if ": " not in self.where else f"{self.where}.{key}"


def read_yaml(text: str, where: str, *, error: type[PoiseError]) -> Mapping[Any, Any]:
    """Parse YAML text whose top is a mapping, with no key given twice.

    Raises:
        PoiseError: the text is no YAML, or not a mapping.
    """
    try:
        data = yaml.load(text, Loader=_StrictLoader)
    # A date that does not exist is a ValueError, and lists may be nested without end.
    except (yaml.YAMLError, ValueError, RecursionError) as problem:
        reason = " ".join(str(problem).split())
        raise error(f"{where} is not valid YAML: {reason}") from None
    if not isinstance(data, dict):
        raise error(f"{where} has the wrong kind", got=data, wanted="keys with values")
    return data


def read_text(path: Path, *, error: type[PoiseError]) -> str:
    """Read a text file.

    Raises:
        PoiseError: there is no such file, or it is not text.
    """
    try:
        return path.read_text(encoding="utf-8")
    except OSError as problem:
        raise error(
            f"cannot read a file ({problem.strerror})", got=str(path), wanted="a readable file"
        ) from None
    except UnicodeDecodeError:
        raise error("file is not text", got=str(path), wanted="UTF-8 text") from None


class _StrictLoader(yaml.SafeLoader):
    """The safe loader, which refuses tags and keys that stand twice, and knows 1e-3 as a number."""

    def compose_node(self, parent: Any, index: Any) -> Any:
        event = self.peek_event()
        # With a tag a text can claim to be a number, which the safe loader does not check.
        if getattr(event, "tag", None) is not None:
            raise yaml.YAMLError(f"the tag {event.tag!r} is not allowed, {event.start_mark}")
        if isinstance(event, yaml.ScalarEvent) and len(event.value) > _LONGEST:
            raise yaml.YAMLError(f"a text is longer than {_LONGEST} letters, {event.start_mark}")
        return super().compose_node(parent, index)

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


_StrictLoader.add_implicit_resolver(
    "tag:yaml.org,2002:float", re.compile(r"[-+]?[0-9]+[eE][-+]?[0-9]+$"), list("-+0123456789")
)
