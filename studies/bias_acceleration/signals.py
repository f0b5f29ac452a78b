"""What the figures of the simulated studies share."""

from typing import Any

import numpy as np
from jaxtyping import Float64

from benchmarks.drawing import PALETTE, decimate

COLOURS = {
    "original": PALETTE[0],
    "proposed": PALETTE[1],
    "numerical": PALETTE[2],
    "fused": PALETTE[3],
}
"""A formula has the same colour in every figure."""

DASHES = {
    "original": "-",
    "proposed": (0, (4, 2)),
    "numerical": "-",
    "fused": (0, (1, 1.5)),
}
"""Lines that lie on one another stay apart by their dashes."""

_LEAST = 1e-17
"""Zero on a logarithmic axis: below rounding."""


def draw_signal(
    panel: Any,
    time: Float64[np.ndarray, " T"],
    values: Float64[np.ndarray, " T"],
    formula: str,
    *,
    log: bool = False,
    label: str = "",
    **style: Any,
) -> None:
    """Draws a signal in its formula's colour, with no more points than one can see.

    Args:
        panel: the axes.
        time: [s].
        values: one a tick.
        formula: whose signal.
        log: whether the axis of the values is logarithmic.
        label: for the legend; the formula when empty.
        style: more for `Axes.plot`, or other than the formula's.
    """
    shown = np.maximum(np.abs(values), _LEAST) if log else values
    kept = decimate(time, shown)
    look: dict[str, Any] = {"color": COLOURS[formula], "linestyle": DASHES[formula]} | style
    panel.plot(*kept, label=label or formula, **look)


def degrees_most(values: Float64[np.ndarray, " T"]) -> float:
    """Largest value of a signal, in degrees for radians."""
    return float(np.degrees(np.abs(values).max()))
