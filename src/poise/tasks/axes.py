"""Axis masks: which components of a task count, written as short words."""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Int64

from poise.checks import checked_kind
from poise.errors import ConfigurationError

_LETTERS = {"x": 0, "y": 1, "z": 2}


Rows = slice | Int64[np.ndarray, " m"]
"""Which rows of a quantity count: a slice where they are neighbours, which copies nothing."""


def as_rows(index: Int64[np.ndarray, " m"]) -> Rows:
    """The quickest selection of rows.

    Args:
        index: row indices, ascending.
    """
    first, last = int(index[0]), int(index[-1])
    return slice(first, last + 1) if last - first + 1 == len(index) else index


def parse_axes(axes: str, groups: Mapping[str, int]) -> Int64[np.ndarray, " m"]:
    """Turns an axis mask into row indices.

    A mask is a group ("position"), a group with letters ("orientation_xy"), or several of these
    joined by "+" ("position_z+orientation"). Where there is one group its name may be left out
    ("xy").

    Args:
        axes: the mask.
        groups: first row of each group of three axes.

    Returns:
        Row indices, ascending.

    Raises:
        ConfigurationError: the mask cannot be read, or names an axis twice.
    """
    rows: list[int] = []
    for term in checked_kind(axes, str, "an axis mask").split("+"):
        group, separator, letters = term.strip().partition("_")
        if not separator:
            if group in groups:
                letters = "xyz"
            elif len(groups) == 1:
                group, letters = next(iter(groups)), group
        if group not in groups or not letters or any(c not in _LETTERS for c in letters):
            raise ConfigurationError(
                "unknown axis mask",
                got=axes,
                wanted='a group, a group with letters such as "_xy", or several joined by "+"',
                choices=groups,
            )
        rows.extend(groups[group] + _LETTERS[c] for c in letters)
    if len(set(rows)) != len(rows):
        raise ConfigurationError("axis named twice in an axis mask", got=axes)
    return np.array(sorted(rows), dtype=np.int64)


def split_rows(index: np.ndarray) -> tuple[int, ...]:
    """Number of position rows and of orientation rows of a pose mask, those that are there.

    Args:
        index: row indices from `parse_axes`, positions from 0 and orientations from 3.
    """
    linear = int(np.count_nonzero(index < 3))
    return tuple(size for size in (linear, len(index) - linear) if size)
