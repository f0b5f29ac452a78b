"""Colours, lines and numbers of the laboratory's figures, which are drawn in the report's style."""

from collections.abc import Generator
from contextlib import contextmanager
from math import isfinite, isnan, log10
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from poise.apps.pages import house_style

# Okabe and Ito's colours, which stay apart for colour-blind readers.
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#7A5C3E")
COM, ZMP, SUPPORT = PALETTE[:3]
REFERENCE, EVENT, INK = "#52606D", "#7B8794", "#1F2933"

_DASHES = ("-", (0, (5, 1.5)), (0, (1, 1)), (0, (6, 1.5, 1, 1.5)))
"""Line styles: the palette comes round with the next one."""


def line_style(index: int) -> dict[str, Any]:
    """Colour and dashes of the line with this number, for `Axes.plot`."""
    dashes = _DASHES[(index // len(PALETTE)) % len(_DASHES)]
    return {"color": PALETTE[index % len(PALETTE)], "linestyle": dashes}


def number(value: float) -> str:
    """A number with three or four figures, powers of ten only where needed."""
    if not isfinite(value):
        return "–" if isnan(value) else "∞" if value > 0 else "−∞"
    size = abs(value)
    if size and (size >= 1e5 or size < 1e-3):
        mantissa, exponent = f"{value:.2e}".split("e")
        text = f"{float(mantissa):g}e{int(exponent)}"
    else:
        text = f"{value:.0f}" if size >= 100 else f"{value:.3g}"
    return text.replace("-", "−")


def plain_number(value: float, _position: int = 0) -> str:
    """Label of a tick as a plain number."""
    return number(value)


def power_of_ten(value: float, _position: int = 0) -> str:
    """Label of a decade on a logarithmic axis."""
    return "10" + str(round(log10(value))).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def decimate(
    time: Float64[np.ndarray, " T"], values: Float64[np.ndarray, " T"], buckets: int = 500
) -> tuple[Float64[np.ndarray, " n"], Float64[np.ndarray, " n"]]:
    """The least and the greatest value of every bucket, at their own times."""
    if len(time) <= 2 * buckets:
        return time, values
    width = -(-len(values) // buckets)
    starts = range(0, len(values), width)
    gaps = np.isnan(values)
    lows, highs = np.where(gaps, np.inf, values), np.where(gaps, -np.inf, values)
    index = {s + int(lows[s : s + width].argmin()) for s in starts}
    index |= {s + int(highs[s : s + width].argmax()) for s in starts}
    kept = np.array(sorted(index))
    return time[kept], values[kept]


@contextmanager
def picture(path: Path, width: float, height: float, dpi: int) -> Generator[Any]:
    """A `matplotlib.figure.Figure` to draw on, which is written in the end."""
    with house_style():
        from matplotlib.figure import Figure

        figure = Figure(figsize=(width, height), layout="constrained")
        yield figure
        figure.savefig(path, facecolor="white", dpi=dpi)
