"""Numbers, names, tables and figures for people to read."""

from collections.abc import Iterable, Sequence
from html import escape
from typing import Any

import numpy as np

from poise._checks import Numbers
from poise.errors import import_extra


def brief(value: Numbers) -> str:
    """Format numbers to four digits: one where all are equal, else a list."""
    numbers = np.atleast_1d(np.asarray(value, dtype=np.float64)).ravel()
    if len(numbers) and np.all(numbers == numbers[0]):
        numbers = numbers[:1]
    said = [f"{number:.4g}" for number in numbers.tolist()]
    return said[0] if len(said) == 1 else "[" + ", ".join(said) + "]"


def few(names: Sequence[str], most: int = 4) -> str:
    """Format names for a sentence: the first ones, and the count of the others."""
    more = len(names) - most
    return ", ".join(names[:most]) + (f" and {more} more" if more > 0 else "")


def html_table(title: str, head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Format a small table for notebooks."""
    names = "".join(f"<th>{escape(name)}</th>" for name in head)
    lines = "".join(
        "<tr>" + "".join(f"<td>{escape(str(cell))}</td>" for cell in row) + "</tr>" for row in rows
    )
    return (
        f"<table><caption>{escape(title)}</caption><thead><tr>{names}</tr></thead>"
        f"<tbody>{lines}</tbody></table>"
    )


def new_figure(width: float, height: float) -> Any:
    """Make an empty `matplotlib.figure.Figure`, which a notebook shows as a cell's result."""
    plt = import_extra("matplotlib.pyplot", "sim", "A figure")
    figure = plt.figure(figsize=(width, height), layout="constrained")
    # A notebook shows figures of pyplot; closed there, it is not shown twice.
    plt.close(figure)
    return figure
