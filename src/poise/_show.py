"""What objects look like when somebody looks at them: numbers, names, tables, figures."""

from collections.abc import Iterable, Sequence
from html import escape
from importlib import import_module
from typing import Any

import numpy as np

from poise._checks import Numbers
from poise.errors import MissingExtraError

_FEW = 4
"""Whoever reads a sentence wants to see what kind of names it is about, not all of a long list."""


def brief(value: Numbers) -> str:
    """Numbers in as few letters as say enough: one where all are equal, in a list elsewhere."""
    numbers = np.atleast_1d(np.asarray(value, dtype=np.float64)).ravel()
    if len(numbers) and np.all(numbers == numbers[0]):
        numbers = numbers[:1]
    said = [f"{number:.4g}" for number in numbers.tolist()]
    return said[0] if len(said) == 1 else "[" + ", ".join(said) + "]"


def few(names: Sequence[str]) -> str:
    """Names in a sentence: the first ones, and how many more there are."""
    more = len(names) - _FEW
    return ", ".join(names[:_FEW]) + (f" and {more} more" if more > 0 else "")


def html_table(title: str, head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A small table, as notebooks show it."""
    names = "".join(f"<th>{escape(name)}</th>" for name in head)
    lines = "".join(
        "<tr>" + "".join(f"<td>{escape(str(cell))}</td>" for cell in row) + "</tr>" for row in rows
    )
    return (
        f"<table><caption>{escape(title)}</caption><thead><tr>{names}</tr></thead>"
        f"<tbody>{lines}</tbody></table>"
    )


def new_figure(width: float, height: float) -> Any:
    """An empty `matplotlib.figure.Figure`, which a notebook shows where it is a cell's result."""
    try:
        plt: Any = import_module("matplotlib.pyplot")
    except ModuleNotFoundError as error:
        raise MissingExtraError("matplotlib", "sim", "A figure") from error
    figure = plt.figure(figsize=(width, height), layout="constrained")
    # Made by pyplot a notebook knows how to show it; closed there, it is not shown twice.
    plt.close(figure)
    return figure
