"""Reading a scenario file into a `Scenario`, strictly."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from poise._schema import read
from poise._yaml import read_text, read_yaml
from poise.apps.scenarios._scenario import Scenario
from poise.errors import ConfigurationError, UnknownNameError

SHIPPED = Path(__file__).parent / "shipped"
"""Folder of the scenarios that come with Poise."""


def shipped_scenarios() -> tuple[str, ...]:
    """Names of the scenarios that come with Poise."""
    return tuple(sorted(path.stem for path in SHIPPED.glob("*.yaml")))


def load_scenario(name_or_path: str | Path) -> Scenario:
    """A scenario by its shipped name or from a file.

    Args:
        name_or_path: one of `shipped_scenarios()`, or the path of a YAML file.

    Raises:
        UnknownNameError: neither a shipped scenario nor a file.
        ConfigurationError: an unknown key, a missing key, or a value of the wrong kind.
        ConfigurationError: values that cannot be right.
    """
    return make_scenario(*read_scenario(name_or_path))


def parse_scenario(text: str, where: str) -> Scenario:
    """A scenario from YAML text."""
    return make_scenario(read_yaml(text, where, error=ConfigurationError), where)


def read_scenario(name_or_path: str | Path) -> tuple[dict[Any, Any], str]:
    """The content of a scenario's file, as it is written, and what messages call the file."""
    path = Path(name_or_path)
    if str(name_or_path) in shipped_scenarios():
        path = SHIPPED / f"{name_or_path}.yaml"
    if not path.is_file():
        raise UnknownNameError(
            "neither a shipped scenario nor a file",
            got=str(name_or_path),
            choices=shipped_scenarios(),
        )
    text = read_text(path, error=ConfigurationError)
    return read_yaml(text, path.name, error=ConfigurationError), path.name


def make_scenario(data: Mapping[Any, Any], where: str) -> Scenario:
    """A scenario from the content of a file."""
    scenario = read(Scenario, data, where, error=ConfigurationError)
    return replace(scenario, actuation_given="actuation" in (data.get("plant", {})))
