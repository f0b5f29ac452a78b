"""Strict reading of a YAML mapping: every value has a kind, and no key goes unread."""

import math
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import yaml
from jaxtyping import Float64

from poise.errors import RobotError

T = TypeVar("T")


class Fields:
    """The keys of one mapping, taken out one by one with their kinds checked.

    Args:
        data: the mapping as the YAML parser gave it.
        where: the file and the keys that lead here, for messages.
        keys: the keys that may stand here; None where they are names that the user chooses.

    Raises:
        RobotError: `data` is no mapping, or has an unknown key or one that is no text.
    """

    def __init__(self, data: object, where: str, keys: Iterable[str] | None = None) -> None:
        if not isinstance(data, dict):
            raise RobotError(f"{where} has the wrong kind", got=data, wanted="keys with values")
        self.where = where
        self._data: dict[str, Any] = {}
        for key, value in data.items():
            if not isinstance(key, str):
                raise RobotError(f"a key of {where} is not text", got=key, wanted="a name")
            self._data[key] = value
        allowed = None if keys is None else tuple(keys)
        for key in self._data:
            if allowed is not None and key not in allowed:
                raise RobotError(f"unknown key in {where}", got=key, choices=allowed)

    def __contains__(self, key: str) -> bool:
        """Whether the key is there."""
        return key in self._data

    def __iter__(self) -> Iterable[str]:
        """The keys, in the order of the file."""
        return iter(self._data)

    def raw(self, key: str) -> Any:
        """The value as it stands.

        Raises:
            RobotError: the key is missing.
        """
        if key not in self._data:
            raise RobotError(f"{self.where} lacks the key {key!r}", got=sorted(self._data))
        return self._data[key]

    def text(self, key: str) -> str:
        """A text that is not empty."""
        value = self.raw(key)
        if not isinstance(value, str) or not value.strip():
            raise RobotError(f"{self._name(key)} has the wrong kind", got=value, wanted="a text")
        return value.strip()

    def number(self, key: str, *, positive: bool = False, minimum: float | None = None) -> float:
        """A finite number, larger than zero or at least `minimum` if asked for."""
        value = self.raw(key)
        wanted = "a positive number" if positive else "a number"
        wanted += f" of at least {minimum}" if minimum is not None else ""
        right = isinstance(value, int | float) and not isinstance(value, bool)
        if not right or not math.isfinite(value):
            raise RobotError(f"{self._name(key)} has the wrong kind", got=value, wanted=wanted)
        if (positive and value <= 0.0) or (minimum is not None and value < minimum):
            raise RobotError(f"{self._name(key)} is out of range", got=value, wanted=wanted)
        return float(value)

    def numbers(self, key: str, count: int) -> Float64[np.ndarray, " n"]:
        """A list of `count` finite numbers."""
        value = self.raw(key)
        if not isinstance(value, list) or len(value) != count:
            raise RobotError(
                f"{self._name(key)} has the wrong kind", got=value, wanted=f"{count} numbers"
            )
        items = Fields({str(i): v for i, v in enumerate(value)}, self._name(key))
        return np.array([items.number(str(i)) for i in range(count)])

    def texts(self, key: str) -> tuple[str, ...]:
        """A list of texts."""
        value = self.raw(key)
        if not isinstance(value, list):
            raise RobotError(
                f"{self._name(key)} has the wrong kind", got=value, wanted="a list of texts"
            )
        items = Fields({str(i): v for i, v in enumerate(value)}, self._name(key))
        return tuple(items.text(str(i)) for i in range(len(value)))

    def section(self, key: str, keys: Iterable[str] | None = None) -> "Fields":
        """The mapping under a key; an empty one where the key is missing."""
        return Fields(self._data.get(key, {}), self._name(key), keys)

    def each(self, read: Callable[["Fields", str], T]) -> dict[str, T]:
        """Read every key in the same way."""
        return {key: read(self, key) for key in self._data}

    def _name(self, key: str) -> str:
        return f"{self.where}: {key}" if ": " not in self.where else f"{self.where}.{key}"


def read_yaml(text: str, where: str) -> Mapping[Any, Any]:
    """Parse YAML text whose top is a mapping, with no key given twice.

    Raises:
        RobotError: the text is no YAML, or not a mapping.
    """
    try:
        data = yaml.load(text, Loader=_UniqueKeyLoader)
    except yaml.YAMLError as error:
        reason = " ".join(str(error).split())
        raise RobotError(f"{where} is not valid YAML: {reason}") from None
    if not isinstance(data, dict):
        raise RobotError(f"{where} has the wrong kind", got=data, wanted="keys with values")
    return data


def read_text(path: Path) -> str:
    """Read a text file.

    Raises:
        RobotError: there is no such file, or it is not text.
    """
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise RobotError(
            f"cannot read a file ({error.strerror})", got=str(path), wanted="a readable file"
        ) from None
    except UnicodeDecodeError:
        raise RobotError("file is not text", got=str(path), wanted="UTF-8 text") from None


class _UniqueKeyLoader(yaml.SafeLoader):
    """The safe loader, which also refuses a key that stands twice in one mapping."""

    def construct_mapping(self, node: Any, deep: bool = False) -> dict[Any, Any]:
        seen: set[object] = set()
        for key_node, _ in node.value:
            key = key_node.value
            if key in seen:
                raise yaml.YAMLError(f"the key {key!r} stands twice, {key_node.start_mark}")
            seen.add(key)
        return super().construct_mapping(node, deep)
