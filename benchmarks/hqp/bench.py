"""`bench_hqp`: races methods on sequences of hierarchical problems."""

from collections.abc import Sequence
from dataclasses import dataclass

from benchmarks.hqp.methods import checked_methods, is_quick, make_contestant
from benchmarks.hqp.problem_set import ProblemSequence
from benchmarks.hqp.race import COLD, WARM, Lap, Runner, judge_runners, take_turns
from benchmarks.hqp.result import HqpResult, hqp_results
from benchmarks.recording import Progress
from poise.errors import ConfigurationError


@dataclass(frozen=True, kw_only=True)
class HqpBench:
    """What to race; checked when made.

    Attributes:
        methods: of `METHODS`, all usual ones that are installed when None; `lexls` is always
            raced, because the others are compared with it.
        cap: on a solve [s]; what takes longer counts as not solved.

    Raises:
        UnknownNameError: no such method.
        MissingExtraError: a method that is not installed.
        ConfigurationError: a cap that is not positive.
    """

    methods: tuple[str, ...] | None = None
    cap: float = 1.0

    def __post_init__(self) -> None:
        checked_methods(self.methods)
        if not self.cap > 0.0:
            raise ConfigurationError("not a cap on time", got=self.cap, wanted="cap > 0 [s]")


@dataclass(frozen=True, kw_only=True, eq=False)
class HqpRace:
    """What came out.

    Attributes:
        sequences: what was raced.
        laps: one a sequence, method and start.
        results: the same as figures.
    """

    sequences: tuple[ProblemSequence, ...]
    laps: tuple[Lap, ...]
    results: tuple[HqpResult, ...]


def bench_hqp(
    sequences: Sequence[ProblemSequence],
    plan: HqpBench | None = None,
    progress: Progress | None = None,
) -> HqpRace:
    """Races all methods on all sequences, in turn and in one process, and judges their points.

    Every method starts cold on every problem; where neighbours are one tick apart, a second
    workspace of each goes through them warm, beside the first.

    Args:
        sequences: what to race on.
        plan: methods and cap.
        progress: told how many problems are done, of how many.

    Raises:
        ConfigurationError: no sequences, or warm ones of a single problem.
    """
    plan = HqpBench() if plan is None else plan
    if not sequences:
        raise ConfigurationError("nothing to race on", got=0, wanted="at least one sequence")
    for one in sequences:
        if one.consecutive and len(one.problems) < 2:
            raise ConfigurationError(
                f"the first problem of {one.name!r} does not count for a warm start",
                got=len(one.problems),
                wanted="at least two problems",
            )
    methods = checked_methods(plan.methods)
    total, done = sum(len(one.problems) for one in sequences), 0
    laps: list[Lap] = []
    for sequence in sequences:
        runners = _runners(sequence, methods, plan.cap)
        count = len(sequence.problems)
        for reached in take_turns(runners, count):
            if progress is not None:
                progress(float(done + reached), float(total))
        laps += judge_runners(sequence, runners)
        done += count
    return HqpRace(
        sequences=tuple(sequences),
        laps=tuple(laps),
        results=tuple(hqp_results(sequences, laps)),
    )


def _runners(sequence: ProblemSequence, methods: Sequence[str], cap: float) -> list[Runner]:
    starts = (COLD, WARM) if sequence.consecutive else (COLD,)
    return [
        Runner(
            method,
            start,
            make_contestant(method, cap),
            sequence.problems,
            cap,
            quick=is_quick(method),
        )
        for start in starts
        for method in methods
    ]
