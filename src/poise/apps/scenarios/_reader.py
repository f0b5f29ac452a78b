"""Reading a scenario file into a `Scenario`, strictly."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from jaxtyping import Float64

from poise._fields import Fields, read_text, read_yaml
from poise.apps.scenarios._metrics import METRICS
from poise.apps.scenarios._scenario import (
    CheckPlan,
    ContactChange,
    Motion,
    MotionKind,
    PushPlan,
    Scenario,
)
from poise.apps.scenarios._sections import read_hands, read_plant, read_walk
from poise.apps.scenarios._stack_plan import StackPlan
from poise.control import ControllerPlan
from poise.errors import ScenarioError, UnknownNameError

SHIPPED = Path(__file__).parent / "shipped"
"""Folder of the scenarios that come with Poise."""

_AXES = ("x", "y", "z")
_GOALS: tuple[MotionKind, ...] = ("to", "by", "above", "reach", "turn", "joints")
_KEYS = (
    "name",
    "description",
    "robot",
    "controller",
    "duration",
    "seed",
    "plant",
    "stack",
    "hands",
    "walk",
    "motions",
    "contacts",
    "pushes",
    "checks",
)

_LARGEST = 1e3
"""No point, shift or angle of a motion is larger than this [m, rad]."""

_NAME = re.compile(r"[\w .+()-]*\w[\w .+()-]*")
"""A scenario's name becomes the name of a folder."""

T = TypeVar("T")


def shipped_scenarios() -> tuple[str, ...]:
    """Names of the scenarios that come with Poise."""
    return tuple(sorted(path.stem for path in SHIPPED.glob("*.yaml")))


def load_scenario(name_or_path: str | Path) -> Scenario:
    """A scenario by its shipped name or from a file.

    Args:
        name_or_path: one of `shipped_scenarios()`, or the path of a YAML file.

    Raises:
        UnknownNameError: neither a shipped scenario nor a file.
        ScenarioError: an unknown key, a missing key, or a value of the wrong kind.
        ConfigurationError: values that cannot be right.
    """
    shipped = SHIPPED / f"{name_or_path}.yaml"
    if str(name_or_path) in shipped_scenarios():
        return parse_scenario(read_text(shipped, error=ScenarioError), shipped.name)
    path = Path(name_or_path)
    if not path.is_file():
        raise UnknownNameError(
            "neither a shipped scenario nor a file",
            got=str(name_or_path),
            choices=shipped_scenarios(),
        )
    return parse_scenario(read_text(path, error=ScenarioError), path.name)


def parse_scenario(text: str, where: str) -> Scenario:
    """A scenario from YAML text.

    Args:
        text: the file's text.
        where: what messages call it.

    Raises:
        ScenarioError: an unknown key, a missing key, or a value of the wrong kind.
        ConfigurationError: values that cannot be right.
    """
    data = read_yaml(text, where, error=ScenarioError)
    fields = Fields(data, where, _KEYS, error=ScenarioError)
    duration = fields.number("duration", positive=True)
    plant = fields.raw("plant") if "plant" in fields else {}
    return Scenario(
        name=_file_name(fields, "name"),
        description=fields.text("description") if "description" in fields else "",
        robot=fields.text("robot") if "robot" in fields else "humanoid33",
        controller=_controller(fields),
        duration=duration,
        seed=_whole(fields, "seed") if "seed" in fields else 0,
        plant=read_plant(plant, f"{where}: plant"),
        actuation_given="actuation" in plant,
        stack=StackPlan(fields.raw("stack"), f"{where}: stack") if "stack" in fields else None,
        hands=read_hands(fields.raw("hands"), f"{where}: hands") if "hands" in fields else None,
        walk=read_walk(fields.raw("walk"), f"{where}: walk") if "walk" in fields else None,
        motions=_entries(fields, "motions", _motion),
        contact_changes=_entries(fields, "contacts", _contact_change),
        pushes=_entries(fields, "pushes", _push),
        checks=_entries(fields, "checks", _check),
    )


def _controller(fields: Fields) -> ControllerPlan:
    data = fields.raw("controller") if "controller" in fields else {}
    if isinstance(data, str):
        return ControllerPlan(name=data)
    keys = ("name", "strategy", "backend", "time_limit")
    section = fields.section("controller", keys)
    texts: dict[str, Any] = {k: section.text(k) for k in keys[:3] if k in section}
    limit = section.number("time_limit", positive=True) if "time_limit" in section else None
    return ControllerPlan(**texts, time_limit=limit)


def _file_name(fields: Fields, key: str) -> str:
    name = fields.text(key)
    if _NAME.fullmatch(name) is None:
        raise ScenarioError(
            f"{fields.where}: {key} cannot name a folder",
            got=name,
            wanted="letters, digits, spaces and any of _ - . + ( )",
        )
    return name


def _whole(fields: Fields, key: str) -> int:
    number = fields.number(key, minimum=0.0)
    if number != int(number):
        raise ScenarioError(
            f"{fields.where}: {key} is not whole", got=number, wanted="0, 1, 2, ..."
        )
    return int(number)


def _entries(fields: Fields, key: str, read: Callable[[Fields], T]) -> tuple[T, ...]:
    """Reads a list of mappings."""
    items = fields.raw(key) if key in fields else []
    where = f"{fields.where}: {key}"
    if not isinstance(items, list):
        raise ScenarioError(f"{where} has the wrong kind", got=items, wanted="a list")
    return tuple(
        read(Fields(item, f"{where}, entry {i + 1}", error=ScenarioError))
        for i, item in enumerate(items)
    )


def _known(fields: Fields, keys: tuple[str, ...]) -> None:
    for key in fields:
        if key not in keys:
            raise ScenarioError(f"unknown key in {fields.where}", got=key, choices=keys)


def _one_key(fields: Fields, keys: tuple[Any, ...]) -> Any:
    """Which one of several keys is there."""
    found = [key for key in keys if key in fields]
    if len(found) != 1:
        raise ScenarioError(f"{fields.where} must have one of these keys", got=found, choices=keys)
    return found[0]


def _motion(fields: Fields) -> Motion:
    _known(fields, ("task", "at", "over", *_GOALS))
    kind: MotionKind = _one_key(fields, _GOALS)
    goal: dict[str, Any] = {}
    if kind in ("to", "by", "turn"):
        goal["vector"] = _vector(fields, kind)
    elif kind == "above":
        value = fields.raw("above")
        goal["soles"] = (fields.text("above"),) if isinstance(value, str) else fields.texts("above")
        if not goal["soles"]:
            raise ScenarioError(f"{fields.where}: above is empty", wanted="a sole or several")
    elif kind == "reach":
        section = fields.section("reach", ("direction", "share"))
        direction = _vector(section, "direction")
        norm = float(np.linalg.norm(direction))
        if norm == 0.0:
            raise ScenarioError(
                f"{section.where}: direction is zero", got=direction.tolist(), wanted="a direction"
            )
        goal["vector"] = direction / norm
        goal["share"] = section.number("share", positive=True)
        if goal["share"] > _LARGEST:
            raise ScenarioError(
                f"{section.where}: share is out of range",
                got=goal["share"],
                wanted="a share of the arm's length, such as 0.9",
            )
    else:
        section = fields.section("joints")
        goal["joints"] = {joint: section.number(joint) for joint in section}
    return Motion(
        task=fields.text("task"),
        at=fields.number("at", minimum=0.0),
        over=fields.number("over", minimum=0.0),
        kind=kind,
        **goal,
    )


def _vector(fields: Fields, key: str) -> Float64[np.ndarray, "3"]:
    vector = fields.numbers(key, 3)
    if np.abs(vector).max() > _LARGEST:
        raise ScenarioError(
            f"{fields.where}: {key} is out of range",
            got=vector.tolist(),
            wanted=f"at most {_LARGEST:g} m or rad",
        )
    return vector


def _contact_change(fields: Fields) -> ContactChange:
    _known(fields, ("at", "over", "touchdown", "load", "unload"))
    key = _one_key(fields, ("load", "unload"))
    if key == "unload" and "touchdown" in fields:
        raise ScenarioError(f"{fields.where}: touchdown goes with load", got="unload")
    return ContactChange(
        contact=fields.text(key),
        at=fields.number("at", minimum=0.0),
        load=key == "load",
        over=fields.number("over", minimum=0.0) if "over" in fields else 0.2,
        touchdown=fields.number("touchdown", positive=True) if "touchdown" in fields else 0.0,
    )


def _push(fields: Fields) -> PushPlan:
    kinds = ("force", "velocity_change")
    _known(fields, ("body", "at", "duration", *kinds))
    kind = _one_key(fields, kinds)
    x, y, z = fields.numbers(kind, 3).tolist()
    return PushPlan(
        body=fields.text("body"),
        at=fields.number("at", minimum=0.0),
        duration=fields.number("duration", positive=True),
        **{kind: (x, y, z)},
    )


def _check(fields: Fields) -> CheckPlan:
    relations = ("at_most", "at_least")
    _known(fields, ("metric", "task", "sole", "level", "axis", "from", "until", *relations))
    name = fields.text("metric")
    if name not in METRICS:
        raise UnknownNameError(f"unknown metric in {fields.where}", got=name, choices=METRICS)
    metric = METRICS[name]
    given = [key for key in ("task", "sole", "level") if key in fields]
    if given != ([metric.subject] if metric.subject else []):
        raise ScenarioError(
            f"{fields.where}: metric {name!r} is measured on something else",
            got=given,
            wanted=f"the key {metric.subject!r}" if metric.subject else "no task, sole or level",
        )
    subject = ""
    if metric.subject == "level":
        subject = str(_whole(fields, "level"))
    elif metric.subject:
        subject = fields.text(metric.subject)
    relation = _one_key(fields, relations)
    begin = fields.number("from", minimum=0.0) if "from" in fields else 0.0
    end = fields.number("until", positive=True) if "until" in fields else float("inf")
    if begin >= end:
        raise ScenarioError(
            f"{fields.where}: the window is empty", got=(begin, end), wanted="from < until"
        )
    return CheckPlan(
        metric=name,
        relation="<=" if relation == "at_most" else ">=",
        bound=fields.number(relation),
        subject=subject,
        axis=_axis(fields, metric.takes_axis),
        begin=begin,
        end=end,
    )


def _axis(fields: Fields, allowed: bool) -> int | None:
    if "axis" not in fields:
        return None
    axis = fields.raw("axis")
    # YAML reads a bare y as text, but some editors quote it: both arrive as text here.
    if not allowed or axis not in _AXES:
        raise ScenarioError(
            f"{fields.where}: axis",
            got=axis,
            wanted="an axis" if allowed else "no axis with this metric",
            choices=_AXES,
        )
    return _AXES.index(axis)
