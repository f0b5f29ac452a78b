"""Reading a scenario file into a `Scenario`, strictly."""

from dataclasses import replace
from pathlib import Path

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
    shipped = SHIPPED / f"{name_or_path}.yaml"
    if str(name_or_path) in shipped_scenarios():
        return parse_scenario(read_text(shipped, error=ConfigurationError), shipped.name)
    path = Path(name_or_path)
    if not path.is_file():
        raise UnknownNameError(
            "neither a shipped scenario nor a file",
            got=str(name_or_path),
            choices=shipped_scenarios(),
        )
    return parse_scenario(read_text(path, error=ConfigurationError), path.name)


def parse_scenario(text: str, where: str) -> Scenario:
    """A scenario from YAML text.

    Args:
        text: the file's text.
        where: what messages call it.

    Raises:
        ConfigurationError: an unknown key, a missing key, or a value of the wrong kind.
        ConfigurationError: values that cannot be right.
    """
    data = read_yaml(text, where, error=ConfigurationError)
    scenario = read(Scenario, data, where, error=ConfigurationError)
    return replace(scenario, actuation_given="actuation" in data.get("plant", {}))
