"""Figure 6: bias accelerations behind encoders, and what they do to the task."""

from typing import Any

import numpy as np

from benchmarks.drawing import power_of_ten
from studies.bias_acceleration.cup import CupTrace
from studies.bias_acceleration.side_by_side import PAPER_FORMULAS, SideBySide
from studies.bias_acceleration.signals import draw_signal
from studies.figure import Figure, draw

_BACK_TO_FRONT = ("numerical", "original", "proposed", "fused")


def figure_6(by_formula: dict[str, CupTrace], along: SideBySide) -> Figure:
    """The paper's Figure 6, with `fused`.

    Args:
        by_formula: one run each.
        along: all formulas on the states of the original's run.
    """
    return draw(
        name="figure-6",
        title="Figure 6: behind encoders of 17 bit",
        caption="Left: bias acceleration of the second task by world axis, all formulas on the "
        "states of one run; original and proposed lie on one another. Right: difference from the "
        "original formula (on the same states), departure from the desired dynamics and tilt of "
        "the cup (one run a formula); original, proposed and fused lie on one another. What is "
        "exactly zero is drawn at the bottom.",
        height=6.6,
        paint=lambda canvas: _paint(canvas, by_formula, along),
    )


def _paint(canvas: Any, by_formula: dict[str, CupTrace], along: SideBySide) -> None:
    panels = canvas.subplots(3, 2, sharex=True)
    time = by_formula["original"].time
    for axis, panel in enumerate(panels[:, 0]):
        for name in _BACK_TO_FRONT:
            if name in PAPER_FORMULAS:
                look: dict[str, Any] = {"linewidth": 0.6} if name == "numerical" else {}
                draw_signal(panel, time, np.degrees(along.bias[name][:, axis]), name, **look)
        panel.set_ylabel(f"bias {'xyz'[axis]} [°/s²]")
    differences, sigma, tilt = panels[:, 1]
    for name in ("numerical", "proposed"):
        values = np.degrees(along.bias_difference(name))
        draw_signal(differences, time, values, name, log=True, linewidth=0.8, linestyle="-")
    differences.set_ylabel("d_N, d_P [°/s²]")
    for name in _BACK_TO_FRONT:
        trace = by_formula[name]
        look: dict[str, Any] = {"linewidth": 0.8} if name == "numerical" else {}
        draw_signal(sigma, time, np.degrees(trace.sigma), name, log=True, **look)
        draw_signal(tilt, time, 1e3 * np.degrees(trace.tilt), name, **look)
    sigma.set_ylabel("σ [°/s²]")
    tilt.set_ylabel("tilt [0.001°]")
    for panel in (differences, sigma):
        panel.set_yscale("log")
        panel.yaxis.set_major_formatter(power_of_ten)
        panel.yaxis.minorticks_off()
    for panel in panels[-1]:
        panel.set_xlabel("time [s]")
    handles, labels = sigma.get_legend_handles_labels()
    canvas.legend(handles, labels, loc="outside upper left", ncols=4)
    canvas.align_ylabels()
