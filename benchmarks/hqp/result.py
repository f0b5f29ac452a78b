"""`HqpResult`: one method on one sequence, as the command line prints it."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from jaxtyping import Float64

from benchmarks.hqp.methods import REFERENCE
from benchmarks.hqp.problem_set import ProblemSequence
from benchmarks.hqp.race import Lap


@dataclass(frozen=True, kw_only=True)
class HqpResult:
    """One method on one sequence, cold or warm.

    Attributes:
        sequence: name of the sequence.
        family: of the sequence.
        n: most variables of its problems.
        rows: most two-sided rows, finite bounds on single variables among them.
        levels: most levels.
        count: solves that count; one less than there are problems where it is warm.
        method: "direct", "cascade/osqp", ...
        start: "cold" or "warm".
        p50_us: median solve, right or wrong [us]; None where none took place.
        p99_us: 99th percentile [us]; likewise.
        max_us: longest [us]; likewise.
        solved: share of the problems that the method says it solved, and did.
        silent: number of problems that it says it solved, and did not.
        gap: by how much, relative to its scale, a level was worse than the best known at most,
            where the method says it solved the problem; None where it never does.
        cost_gap: likewise of the final cost, where all levels are as good; None likewise.
        ratio_to_direct: median by that of `direct` on the same sequence from the same start; None
            where no solve took place.
        statuses: how often solves ended in which way.
    """

    sequence: str
    family: str
    n: int
    rows: int
    levels: int
    count: int
    method: str
    start: str
    p50_us: float | None
    p99_us: float | None
    max_us: float | None
    solved: float
    silent: int
    gap: float | None
    cost_gap: float | None
    ratio_to_direct: float | None
    statuses: dict[str, int]

    def to_json(self) -> dict[str, Any]:
        """The result as JSON holds it."""
        return asdict(self)


def hqp_results(sequences: Sequence[ProblemSequence], laps: Sequence[Lap]) -> list[HqpResult]:
    """Figures of every lap.

    Args:
        sequences: what was raced.
        laps: one a sequence, method and start; those of `direct` among them.
    """
    by_name = {one.name: one for one in sequences}
    reference = {(lap.sequence, lap.start): lap for lap in laps if lap.method == REFERENCE}
    results: list[HqpResult] = []
    for lap in laps:
        problems = by_name[lap.sequence].problems
        sizes = [problem.size for problem in problems]
        results.append(
            HqpResult(
                sequence=lap.sequence,
                family=lap.family,
                n=max(n for n, _ in sizes),
                rows=max(rows for _, rows in sizes),
                levels=max(len(problem.levels) for problem in problems),
                count=len(lap.seconds),
                method=lap.method,
                start=lap.start,
                statuses=dict(Counter(lap.statuses)),
                **lap_figures([lap], [reference[lap.sequence, lap.start]]),
            )
        )
    return results


def lap_figures(laps: Sequence[Lap], reference: Sequence[Lap]) -> dict[str, Any]:
    """The fields of a result that follow from laps of one method, all solves taken together.

    Args:
        laps: on one sequence or several.
        reference: of `direct`, on the same.
    """
    seconds = np.concatenate([lap.seconds for lap in laps])
    seconds = seconds[~np.isnan(seconds)]
    median = _percentile(seconds, 50.0)
    base = _percentile(np.concatenate([lap.seconds for lap in reference]), 50.0)
    claimed = np.concatenate([lap.claimed for lap in laps])
    return {
        "p50_us": _short(median),
        "p99_us": _short(_percentile(seconds, 99.0)),
        "max_us": _short(_percentile(seconds, 100.0)),
        "solved": round(float(np.concatenate([lap.solved for lap in laps]).mean()), 4),
        "silent": sum(int(lap.silent.sum()) for lap in laps),
        "gap": _largest(np.concatenate([lap.gaps for lap in laps])[claimed]),
        "cost_gap": _largest(np.concatenate([lap.cost_gaps for lap in laps])[claimed]),
        "ratio_to_direct": None if median is None or not base else round(median / base, 3),
    }


def _percentile(seconds: Float64[np.ndarray, " count"], percent: float) -> float | None:
    seconds = seconds[~np.isnan(seconds)]
    return None if len(seconds) == 0 else float(np.percentile(seconds, percent))


def _largest(gaps: Float64[np.ndarray, " count"]) -> float | None:
    known = gaps[~np.isnan(gaps)]
    return None if len(known) == 0 else float(f"{known.max():.3g}")


def _short(seconds: float | None) -> float | None:
    # A clock call takes some 50 ns: further digits say nothing.
    return None if seconds is None else round(1e6 * seconds, 1)
