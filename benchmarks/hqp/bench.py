"""`bench_hqp`: races methods on sequences of hierarchical problems.

Results as JSON, and as tables: Markdown, which a terminal shows as well as a page does.
"""

import json
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from benchmarks.commands import Bench, MaybeWords
from benchmarks.hqp.methods import (
    REFERENCE,
    checked_methods,
    is_quick,
    make_contestant,
    what_is_missing,
)
from benchmarks.hqp.problem_set import FAMILIES, ProblemSequence
from benchmarks.hqp.race import COLD, WARM, Lap, Runner, judge_runners, take_turns
from benchmarks.recording import Progress
from benchmarks.result import Result, or_dash, spread_us
from poise.cli import Bar
from poise.errors import ConfigurationError, MissingExtraError, UnknownNameError


@dataclass(frozen=True, kw_only=True)
class HqpResult(Result):
    """One method on one sequence, cold or warm."""

    sequence: str  # name of the sequence
    family: str  # of the sequence
    n: int  # most variables of its problems
    rows: int  # most two-sided rows, finite bounds on single variables among them
    levels: int  # most levels
    count: int  # solves that count; one less than there are problems where it is warm
    method: str  # "direct", "cascade/osqp",
    start: str  # "cold" or "warm"
    p50_us: float | None  # median solve, right or wrong [us]; None where none took place
    p99_us: float | None  # 99th percentile [us]; None where p50_us is
    max_us: float | None  # longest [us]; None where p50_us is
    solved: float  # share of the problems that the method says it solved, and did
    silent: int  # number of problems that it says it solved, and did not
    # By how much, relative to its scale, a level was worse than the best known at most, where the
    # method says it solved the problem; None where it never does
    gap: float | None
    # The same of the final cost, where all levels are as good; None where that is
    cost_gap: float | None
    # Median by that of `direct` on the same sequence from the same start; None where no solve took
    # place
    ratio_to_direct: float | None
    statuses: dict[str, int]  # how often solves ended in which way


def hqp_results(sequences: Sequence[ProblemSequence], laps: Sequence[Lap]) -> list[HqpResult]:
    """Figures of every lap."""
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
    """The fields of a result that follow from laps of one method, all solves taken together."""
    seconds, base = (_solved_in(own) for own in (laps, reference))
    claimed = np.concatenate([lap.claimed for lap in laps])
    ratio = None
    if len(seconds) and len(base) and np.median(base) > 0.0:
        ratio = round(float(np.median(seconds) / np.median(base)), 3)
    return {
        **spread_us(seconds),
        "solved": round(float(np.concatenate([lap.solved for lap in laps]).mean()), 4),
        "silent": sum(int(lap.silent.sum()) for lap in laps),
        "gap": _largest(np.concatenate([lap.gaps for lap in laps])[claimed]),
        "cost_gap": _largest(np.concatenate([lap.cost_gaps for lap in laps])[claimed]),
        "ratio_to_direct": ratio,
    }


def _solved_in(laps: Sequence[Lap]) -> Float64[np.ndarray, " count"]:
    """Times of the solves that took place [s]."""
    seconds = np.concatenate([lap.seconds for lap in laps])
    return seconds[~np.isnan(seconds)]


def _largest(gaps: Float64[np.ndarray, " count"]) -> float | None:
    known = gaps[~np.isnan(gaps)]
    return None if len(known) == 0 else float(f"{known.max():.3g}")


@dataclass(frozen=True, kw_only=True)
class HqpBench(Bench):
    """Race solvers on hierarchical problems of robots, and judge their answers.

    example: python -m benchmarks hqp --methods daqp-hierarchical,cascade/osqp --out bench
    """

    # Such as cascade/osqp, daqp-hard, daqp-hierarchical, direct/solve; all usual ones that are
    # installed when None. `direct` is always raced: the others are compared with it
    methods: MaybeWords = None
    cap: float = 1.0  # on a solve [s]; what takes longer counts as not solved
    problems: str | None = None  # folder of the sequences to race on; new ones are made without
    # Names of sequences: all of a folder, or some that are quickly made, when None; "all" for every
    # one that can be made
    sequences: MaybeWords = None
    count: int | None = None  # most problems of a sequence; 31 of one that is made when None
    save: str | None = None  # make all sequences and save them in this folder, race nothing

    def __post_init__(self) -> None:
        checked_methods(self.methods)
        if not self.cap > 0.0:
            raise ConfigurationError("not a cap on time", got=self.cap, wanted="cap > 0 [s]")
        if self.count is not None and self.count < 2:
            raise ConfigurationError("too few problems", got=self.count, wanted="--count 2 or more")

    def act(self) -> int:
        """Make and save problems, or race on them."""
        if self.save is None:
            _race(self)
        else:
            _save(self, Path(self.save))
        return 0


@dataclass(frozen=True, kw_only=True, eq=False)
class HqpRace:
    """Results of all methods."""

    sequences: tuple[ProblemSequence, ...]  # what was raced
    laps: tuple[Lap, ...]  # one a sequence, method and start
    results: tuple[HqpResult, ...]  # the same as figures


def bench_hqp(
    sequences: Sequence[ProblemSequence],  # what to race on
    plan: HqpBench | None = None,  # methods and cap
    progress: Progress | None = None,  # told how many problems are done, of how many
) -> HqpRace:
    """Races all methods on all sequences, in turn and in one process, and judges their points.

    Every method starts cold on every problem; where neighbours are one tick apart, a second
    workspace of each goes through them warm, beside the first.
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


FAMILY_HEADS = ("p50", "p99", "x direct", "solved", "silent", "gap")
"""Columns of a method in the table of a family, once for a cold start and once for a warm one."""

SEQUENCE_HEADS = ("sequence", "start", "n", "rows", "levels", "count")
"""Columns of the table by sequence before those of the methods."""


def format_hqp_table(race: HqpRace) -> str:
    """A table a family, a line a method; then one with a line for every sequence and start."""
    raced = {one.family for one in race.sequences}
    families = [family for family in FAMILIES if family in raced]
    parts = [_family(race, family) for family in families]
    return "\n\n".join([*parts, _by_sequence(race)])


def _family(race: HqpRace, family: str) -> str:
    own = [lap for lap in race.laps if lap.family == family]
    starts = [start for start in (COLD, WARM) if any(lap.start == start for lap in own)]
    heads = ["method", *(f"{start} {head}" for start in starts for head in FAMILY_HEADS)]
    rows: list[list[str]] = []
    for method in dict.fromkeys(lap.method for lap in own):
        cells = [method]
        for start in starts:
            cells += _family_cells([lap for lap in own if lap.start == start], method)
        rows.append(cells)
    return f"{_family_title(own, family, starts)}\n\n{_markdown(heads, rows)}"


def _family_title(own: Sequence[Lap], family: str, starts: Sequence[str]) -> str:
    counts: list[str] = []
    for start in starts:
        laps = [lap for lap in own if lap.start == start and lap.method == REFERENCE]
        counts.append(f"{sum(len(lap.seconds) for lap in laps)} solves {start}")
    sequences = len({lap.sequence for lap in own})
    plural = "" if sequences == 1 else "s"
    return f"**{family}**: {sequences} sequence{plural}, {', '.join(counts)}; times in us"


def _family_cells(laps: Sequence[Lap], method: str) -> list[str]:
    figures: dict[str, Any] = lap_figures(
        [lap for lap in laps if lap.method == method],
        [lap for lap in laps if lap.method == REFERENCE],
    )
    return [
        or_dash(figures["p50_us"], ".0f"),
        or_dash(figures["p99_us"], ".0f"),
        _ratio(figures["ratio_to_direct"]),
        _share(figures["solved"]),
        str(figures["silent"]),
        "-" if figures["gap"] is None else f"{figures['gap']:.0e}",
    ]


def _by_sequence(race: HqpRace) -> str:
    methods = list(dict.fromkeys(result.method for result in race.results))
    others = [method for method in methods if method != REFERENCE]
    keys = dict.fromkeys((result.sequence, result.start) for result in race.results)
    rows: list[list[str]] = []
    for key in keys:
        found = {r.method: r for r in race.results if (r.sequence, r.start) == key}
        own = found[REFERENCE]
        cells = [*key, *(str(number) for number in (own.n, own.rows, own.levels, own.count))]
        cells.append(f"{or_dash(own.p50_us, '.0f')}{_unsolved(own)}")
        cells += [_sequence_cell(found[method]) for method in others]
        rows.append(cells)
    title = (
        "**by sequence**: median of `direct` in us, of the others in multiples of it; in brackets "
        "the share solved, where it is not all"
    )
    return f"{title}\n\n{_markdown([*SEQUENCE_HEADS, REFERENCE, *others], rows)}"


def _sequence_cell(result: HqpResult) -> str:
    return f"{_ratio(result.ratio_to_direct)}{_unsolved(result)}"


def _unsolved(result: HqpResult) -> str:
    return "" if result.solved == 1.0 else f" ({_share(result.solved)})"


def _ratio(ratio: float | None) -> str:
    if ratio is None:
        return "-"
    return f"{ratio:.2f}" if ratio < 9.995 else f"{ratio:.0f}"


def _share(share: float) -> str:
    # All means all: 99.96% is not 100%.
    percent = 100.0 * share
    return f"{percent:.0f}%" if share in (0.0, 1.0) else f"{min(max(percent, 0.1), 99.9):.1f}%"


def _markdown(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    widths = [max(len(line[i]) for line in (heads, *rows)) for i in range(len(heads))]
    lines = [heads, ["-" * width for width in widths], *rows]
    return "\n".join(
        "| "
        + " | ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True))
        + " |"
        for line in lines
    )


def _save(plan: HqpBench, folder: Path) -> None:
    from benchmarks.hqp.problem_sources import save_all

    for name in ("problems", "sequences", "methods", "out", "json"):
        if getattr(plan, name):
            raise ConfigurationError(
                "--save makes problems and races nothing", got=f"--{name}", wanted="--count"
            )
    folder.mkdir(parents=True, exist_ok=True)
    with Bar("making problems", "") as bar:
        paths = save_all(folder, plan.count or 31, bar)
    print(f"{len(paths)} sequences in {folder}")


def _race(plan: HqpBench) -> None:
    from benchmarks.hqp.figure import write_profile_figure

    folder = plan.folder()
    sequences = _loaded(plan, Path(plan.problems)) if plan.problems else _made(plan)
    with Bar("racing", " problems") as bar:
        race = bench_hqp(sequences, plan, bar)
    lines = "".join(json.dumps(result.to_json()) + "\n" for result in race.results)
    print(lines if plan.json else format_hqp_table(race), end="" if plan.json else "\n")
    if folder is not None:
        (folder / "hqp.json").write_text(lines, encoding="utf-8")
        write_profile_figure(race.laps, folder / "hqp.png")
    if plan.methods is None:
        for reason in what_is_missing():
            print(f"left out: {reason}", file=sys.stderr)


def _loaded(plan: HqpBench, folder: Path) -> list[Any]:
    """Sequences of a folder, as many of their problems as are wanted."""
    from benchmarks.hqp.problem_set import load_folder

    sequences = {one.name: one for one in load_folder(folder)}
    wanted = _names(plan.sequences, tuple(sequences), tuple(sequences))
    return [
        replace(sequences[name], problems=sequences[name].problems[: plan.count]) for name in wanted
    ]


def _made(plan: HqpBench) -> list[Any]:
    """New sequences; of the usual ones those for which all is installed."""
    from benchmarks.hqp.problem_sources import USUAL_SEQUENCES, make_sequence, sequence_names

    wanted = _names(plan.sequences, sequence_names(), USUAL_SEQUENCES)
    made: list[Any] = []
    with Bar("making problems", " sequences") as bar:
        for i, name in enumerate(wanted):
            bar(float(i), float(len(wanted)))
            try:
                made.append(make_sequence(name, plan.count or 31))
            except MissingExtraError as reason:
                if plan.sequences is not None:
                    raise
                print(f"left out {name}: {reason}", file=sys.stderr)
    return made


def _names(
    names: tuple[str, ...] | None, choices: tuple[str, ...], usual: tuple[str, ...]
) -> tuple[str, ...]:
    if names is None:
        return usual
    names = choices if names == ("all",) else names
    for name in names:
        if name not in choices:
            raise UnknownNameError(
                "unknown sequence of problems", got=name, choices=(*choices, "all")
            )
    return tuple(dict.fromkeys(names))
