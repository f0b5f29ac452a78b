"""Reading the plant's section of a scenario file into a `PlantConfig`."""

from dataclasses import MISSING
from dataclasses import fields as dataclass_fields
from typing import Any, get_args

import numpy as np

from poise.errors import ScenarioError, UnknownNameError
from poise.fields import Fields
from poise.sim.config import Actuation, PlantConfig, ServoConfig
from poise.sim.disturbances import Block, LinkError, Payload
from poise.sim.sensors import SensorConfig

_VECTORS = {"floor_slope": 2, "offset": 3, "com_offset": 3, "center": 2, "size": 3}
_FARTHEST = 1e2
"""No place or angle in a plant is farther than this [m, rad]: MuJoCo loses its accuracy there."""

_LARGEST = 1e6
"""No other number of a plant is larger, whatever its unit."""

_TEXTS = ("actuation", "frame", "link")
_SECTIONS: dict[str, type] = {"servo": ServoConfig, "sensors": SensorConfig}
_LISTS: dict[str, type] = {"blocks": Block, "link_errors": LinkError, "payloads": Payload}


def read_plant(data: object, where: str) -> PlantConfig:
    """The plant's configuration; the keys are `PlantConfig`'s own.

    Args:
        data: the section of the file.
        where: the file and the key, for messages.

    Raises:
        ScenarioError: an unknown key, a missing key, or a value of the wrong kind.
        ConfigurationError: values that cannot be right.
    """
    return _read(PlantConfig, data, where)


def _read(kind: type, data: object, where: str) -> Any:
    names = tuple(f.name for f in dataclass_fields(kind))
    fields = Fields(data, where, names, error=ScenarioError)
    values: dict[str, Any] = {}
    for name in fields:
        if name in _SECTIONS:
            values[name] = _read(_SECTIONS[name], fields.raw(name), f"{where}.{name}")
        elif name in _LISTS:
            values[name] = _read_list(_LISTS[name], fields.raw(name), f"{where}.{name}")
        elif name in _TEXTS:
            values[name] = fields.text(name)
            if name == "actuation" and values[name] not in get_args(Actuation):
                raise UnknownNameError(
                    f"unknown actuation in {where}", got=values[name], choices=get_args(Actuation)
                )
        elif name in _VECTORS:
            numbers = fields.numbers(name, _VECTORS[name])
            _check_size(fields, name, float(np.abs(numbers).max()), _FARTHEST)
            values[name] = tuple(numbers.tolist())
        else:
            values[name] = fields.number(name)
            _check_size(fields, name, abs(values[name]), _LARGEST)
    needed = [
        f.name
        for f in dataclass_fields(kind)
        if f.default is MISSING and f.default_factory is MISSING and f.name not in values
    ]
    if needed:
        raise ScenarioError(f"{where} lacks keys", got=sorted(values), choices=needed)
    return kind(**values)


def _check_size(fields: Fields, key: str, size: float, largest: float) -> None:
    if size > largest:
        raise ScenarioError(
            f"{fields.where}: {key} is out of range", got=size, wanted=f"at most {largest:g}"
        )


def _read_list(kind: type, items: object, where: str) -> tuple[Any, ...]:
    if not isinstance(items, list):
        raise ScenarioError(f"{where} has the wrong kind", got=items, wanted="a list")
    return tuple(_read(kind, item, f"{where}, entry {i + 1}") for i, item in enumerate(items))
