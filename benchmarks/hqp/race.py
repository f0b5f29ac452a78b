"""`race_sequence`: every method solves every problem of a sequence, in turn, under the clock."""

import gc
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from time import perf_counter

import numpy as np
from jaxtyping import Bool, Float64

from benchmarks.clocked import batches, in_turn
from benchmarks.hqp.judge import Verdict, best_known, judge_point, measure_point
from benchmarks.hqp.methods import Contestant
from benchmarks.hqp.problem_set import ProblemSequence
from poise.hqp import HierarchicalProblem

COLD, WARM = "cold", "warm"
"""Starts: forgotten before every solve, or as the method left it after the problem before."""

BATCH = 20
"""Problems that the quick methods go through before the slow ones do."""

PATIENCE = 3
"""Solves over the cap on time after which a method is out for the rest of a sequence."""

LATE, GIVEN_UP = "time_limit", "given up"
"""Status of a solve over the cap, and of one that did not take place."""


class Runner:
    """A contestant on one sequence, with its times and points."""

    def __init__(
        self,
        method: str,  # its name
        start: str,  # `COLD` or `WARM`
        contestant: Contestant,  # with a workspace of its own
        problems: Sequence[HierarchicalProblem],  # of the sequence
        cap: float,  # on a solve [s]
        *,
        quick: bool,  # whether it takes turns with the quick ones
    ) -> None:
        self.method, self.start, self.quick = method, start, quick
        self.seconds = np.full(len(problems), np.nan)
        self.claimed = np.zeros(len(problems), dtype=np.bool_)
        self.statuses = [GIVEN_UP] * len(problems)
        self.points: list[Float64[np.ndarray, " n"] | None] = [None] * len(problems)
        self._contestant, self._problems, self._cap = contestant, problems, cap
        self._late = 0

    def rouse(self, first: int) -> None:
        """Solves once without counting, so that a batch finds the caches as the method has them."""
        if self._late < PATIENCE:
            self._run(first if self.start == COLD else max(first - 1, 0))

    def tick(self, index: int) -> None:
        """Times one problem."""
        if self._late >= PATIENCE:
            return
        spent = self._run(index)
        answer = self._contestant.answer()
        late = spent > self._cap
        self._late += late
        self.seconds[index] = spent
        self.statuses[index] = LATE if late else answer.status
        self.claimed[index] = answer.claimed and not late
        if np.isfinite(answer.x).all():
            self.points[index] = answer.x

    def _run(self, index: int) -> float:
        contestant = self._contestant
        if self.start == COLD:
            contestant.forget()
        contestant.take(self._problems[index])
        begin = perf_counter()
        contestant.solve()
        return perf_counter() - begin


@dataclass(frozen=True, kw_only=True, eq=False)
class Lap:
    """One method on one sequence, judged."""

    sequence: str  # name of the sequence
    family: str  # of the sequence
    method: str  # name of the method
    start: str  # `COLD` or `WARM`
    # Of each solve that counts [s]; NaN where there was none
    seconds: Float64[np.ndarray, " count"]
    claimed: Bool[np.ndarray, " count"]  # whether the method said that it had the answer
    right: Bool[np.ndarray, " count"]  # whether its point is as good as the best known
    gaps: Float64[np.ndarray, " count"]  # see `Verdict`; NaN where there is no point
    cost_gaps: Float64[np.ndarray, " count"]  # the same of the cost; NaN where a level differs
    statuses: tuple[str, ...]  # how each solve ended

    @property
    def solved(self) -> Bool[np.ndarray, " count"]:
        """Which were claimed to be solved, and are."""
        return self.claimed & self.right

    @property
    def silent(self) -> Bool[np.ndarray, " count"]:
        """Which were claimed to be solved, and are not."""
        return self.claimed & ~self.right


def take_turns(runners: Sequence[Runner], count: int) -> Generator[int]:
    """Times all problems on all runners; the garbage collector waits between batches.

    In every batch of `BATCH` problems the quick runners take turns problem by problem (A B C,
    B C A, ...); then the slow ones do the same batch in the same way.

    Yields:
        The number of problems done, a batch at a time.
    """
    groups = [[one for one in runners if one.quick is quick] for quick in (True, False)]
    groups = [group for group in groups if group]
    for batch in batches(count, BATCH):
        for group in groups:
            for one in group:
                one.rouse(batch.start)
            for index in batch:
                for one in in_turn(group, index):
                    one.tick(index)
            gc.collect()
        yield batch.stop


def judge_runners(sequence: ProblemSequence, runners: Sequence[Runner]) -> list[Lap]:
    """Judges every point beside the best that any runner found.

    The first problem does not count for a warm runner: it was solved twice, and cold.
    """
    verdicts: list[list[Verdict | None]] = [[] for _ in runners]
    for index, problem in enumerate(sequence.problems):
        points = [one.points[index] for one in runners]
        measured = [None if x is None else measure_point(problem, x) for x in points]
        known = [one for one in measured if one is not None]
        best = best_known(known) if known else None
        for one, found in zip(verdicts, measured, strict=True):
            one.append(None if found is None or best is None else judge_point(found, best))
    return [_lap(sequence, one, found) for one, found in zip(runners, verdicts, strict=True)]


def _lap(sequence: ProblemSequence, runner: Runner, verdicts: list[Verdict | None]) -> Lap:
    counted = slice(1 if runner.start == WARM else 0, None)
    found = verdicts[counted]
    return Lap(
        sequence=sequence.name,
        family=sequence.family,
        method=runner.method,
        start=runner.start,
        seconds=runner.seconds[counted],
        claimed=runner.claimed[counted],
        right=np.array([one is not None and one.right for one in found], dtype=np.bool_),
        gaps=np.array([np.nan if one is None else one.gap for one in found]),
        cost_gaps=np.array(
            [np.nan if one is None or one.cost_gap is None else one.cost_gap for one in found]
        ),
        statuses=tuple(runner.statuses[counted]),
    )
