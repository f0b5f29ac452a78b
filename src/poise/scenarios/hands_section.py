"""Reading the hands of a scenario file into a `HandsPlan`."""

from itertools import pairwise
from typing import Any

import numpy as np

from poise.errors import ScenarioError
from poise.fields import Fields
from poise.scenarios.by_hand import HandsPlan
from poise.teleop import WayPoint

_FARTHEST = 10.0
"""No hand goes farther from where it began [m]."""


def read_hands(data: object, where: str) -> HandsPlan:
    """What the operator's hands do.

    Args:
        data: the section of the file: `script`, or `points`.
        where: the file and the key, for messages.

    Raises:
        ScenarioError: an unknown key, a missing key, or a value of the wrong kind.
        UnknownNameError: no such script.
    """
    fields = Fields(data, where, ("script", "points"), error=ScenarioError)
    script = fields.text("script") if "script" in fields else ""
    items = fields.raw("points") if "points" in fields else []
    if not isinstance(items, list):
        raise ScenarioError(f"{where}.points has the wrong kind", got=items, wanted="a list")
    points = [
        _point(
            Fields(item, f"{where}, point {i + 1}", ("at", "left", "right"), error=ScenarioError)
        )
        for i, item in enumerate(items)
    ]
    for before, after in pairwise(points):
        if not after.at > before.at:
            raise ScenarioError(
                f"{where}: points are not in order of time",
                got=(before.at, after.at),
                wanted="times that increase",
            )
    return HandsPlan(script=script, points=tuple(points))


def _point(fields: Fields) -> WayPoint:
    places: dict[str, Any] = {}
    for hand in ("left", "right"):
        if hand in fields:
            place = fields.numbers(hand, 3)
            if np.abs(place).max() > _FARTHEST:
                raise ScenarioError(
                    f"{fields.where}: {hand} is out of range",
                    got=place.tolist(),
                    wanted=f"at most {_FARTHEST:g} m",
                )
            places[hand] = tuple(place.tolist())
    if not places:
        raise ScenarioError(f"{fields.where} moves no hand", wanted="left, right or both")
    return WayPoint(at=fields.number("at", minimum=0.0), **places)
