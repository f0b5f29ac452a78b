"""`EncoderRuns`: the first study's runs behind encoders."""

from dataclasses import dataclass

from benchmarks.encoder import Encoder
from studies.bias_acceleration.cup import FORMULAS, KP, CupRun, CupTrace, carry_cup
from studies.bias_acceleration.side_by_side import SideBySide, compare_along
from studies.plan import Progress
from studies.progress import Steps

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
