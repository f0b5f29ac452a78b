"""`EncoderRuns`: the first study's runs behind encoders.

Figure 6: bias accelerations behind encoders, and what they do to the task.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.drawing import power_of_ten
from benchmarks.encoder import Encoder
from studies.bias_acceleration.cup import FORMULAS, KP, CupRun, CupTrace, carry_cup
from studies.bias_acceleration.side_by_side import PAPER_FORMULAS, SideBySide, compare_along
from studies.bias_acceleration.signals import draw_signal
from studies.figure import Figure, draw
from studies.plan import Progress, Steps

ENCODER = Encoder(bits=17, gear=100.0)
"""The paper's."""

GAINS = (25.0, KP, 400.0, 900.0)
"""Stiffnesses that are tried [1/s^2]: a task's error dies away at 5 to 30 rad/s."""


@dataclass(frozen=True, kw_only=True, eq=False)
class EncoderRuns:
    """All runs of this part.

    Attributes:
        by_formula: at the usual gain, with numerical derivatives.
        exact: "original" and "proposed" with exact derivatives.
        by_gain: "original" and "numerical" by stiffness.
        along_original: all formulas on the states of the original's run.
        along_exact: the same with exact derivatives.
        along_numerical: all formulas on the states of the numerical one's run.
    """

    by_formula: dict[str, CupTrace]
    exact: dict[str, CupTrace]
    by_gain: dict[float, dict[str, CupTrace]]
    along_original: SideBySide
    along_exact: SideBySide
    along_numerical: SideBySide

    def sigma_ratio(self, kp: float) -> float:
        """Greatest sigma, numerical to original."""
        pair = self.by_gain[kp]
        return float(pair["numerical"].sigma.max() / pair["original"].sigma.max())

    def tilt_ratio(self, kp: float) -> float:
        """Greatest tilt, numerical to original."""
        pair = self.by_gain[kp]
        return float(pair["numerical"].tilt.max() / pair["original"].tilt.max())


def run_all(share: float, progress: Progress) -> EncoderRuns:
    """Simulates everything.

    Args:
        share: share of the motion.
        progress: of the part.
    """
    others = [kp for kp in GAINS if kp != KP]
    steps = Steps(progress, len(FORMULAS) + 2 + 2 * len(others) + 3)

    def carry(formula: str, derivative: str = "numerical", kp: float = KP) -> CupTrace:
        run = CupRun(formula=formula, derivative=derivative, kp=kp, encoder=ENCODER, share=share)
        return carry_cup(run, steps.next())

    by_formula = {name: carry(name) for name in FORMULAS}
    exact = {name: carry(name, "exact") for name in ("original", "proposed")}
    by_gain = {KP: by_formula} | {
        kp: {name: carry(name, kp=kp) for name in ("original", "numerical")} for kp in others
    }
    along = [
        compare_along(by_formula[name], KP, derivative=derivative, progress=steps.next())
        for name, derivative in (
            ("original", "numerical"),
            ("original", "exact"),
            ("numerical", "numerical"),
        )
    ]
    steps.finish()
    return EncoderRuns(
        by_formula=by_formula,
        exact=exact,
        by_gain={kp: by_gain[kp] for kp in GAINS},
        along_original=along[0],
        along_exact=along[1],
        along_numerical=along[2],
    )


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
