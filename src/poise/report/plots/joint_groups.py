"""Which joints belong together: given by the record, or guessed from their names."""

import re
from collections.abc import Sequence

from poise.report.plots.style import plain

_PARTS = (
    ("leg", ("hip", "knee", "ankle", "leg", "thigh", "foot", "toe")),
    ("arm", ("shoulder", "elbow", "wrist", "arm", "hand", "grip", "finger", "thumb")),
    ("head", ("head", "neck", "eye")),
    ("waist", ("waist", "torso", "chest", "spine", "back", "trunk", "lumbar", "abdomen")),
)
_SIDES = (
    ("left", re.compile(r"(^|_|\b)(left|l)(_|\d|\b)|^[lL](?=[A-Z][a-z])|Left", re.ASCII)),
    ("right", re.compile(r"(^|_|\b)(right|r)(_|\d|\b)|^[rR](?=[A-Z][a-z])|Right", re.ASCII)),
)


def grouped_order(
    names: Sequence[str], groups: Sequence[str] = ()
) -> tuple[list[int], list[tuple[str, int]]]:
    """Order joints so that those of one group stand together.

    Args:
        names: the joints.
        groups: group of each joint; empty to guess it from the name.

    Returns:
        Indices of the joints in their new order, and each group's name with its number of joints.
    """
    of_joint = list(groups) or [guess_group(name) for name in names]
    order: list[int] = []
    counts: list[tuple[str, int]] = []
    for group in dict.fromkeys(of_joint):
        members = [i for i, g in enumerate(of_joint) if g == group]
        order.extend(members)
        counts.append((group, len(members)))
    return order, counts


def guess_group(name: str) -> str:
    """Group of a joint by what its name says, "other" where it says nothing."""
    lower = name.lower()
    part = next((part for part, words in _PARTS if any(w in lower for w in words)), "other")
    if part in ("leg", "arm"):
        side = next((side for side, pattern in _SIDES if pattern.search(name)), "")
        return f"{side} {part}".strip()
    return part


def short_names(names: Sequence[str]) -> list[str]:
    """Names as labels, without the ending "_joint" that says nothing where all joints have it."""
    ending = "_joint"
    if all(name.endswith(ending) for name in names):
        names = [name.removesuffix(ending) for name in names]
    return [plain(name, 21) for name in names]
