"""`TickResult`: what one method needed, as JSON and as a table for a terminal."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from jaxtyping import Float64, Int64

from poise.control import CONTROLLERS

PHASES = ("dynamics", "assembly", "solve", "command")
"""Parts of a tick, in the order in which they happen."""

Ticks = slice | Int64[np.ndarray, " counted"]
"""Which of the ticks of a recording count."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TickTimes:
    """Times of the ticks of one method."""

    total: Float64[np.ndarray, " ticks"]  # from state to command [s]
    # Processor time of the same [s]; NaN where a peer does not tell it
    cpu: Float64[np.ndarray, " ticks"]
    # Its parts, in the order of `PHASES` [s]; NaN where a peer does not tell them apart
    phases: Float64[np.ndarray, "ticks 4"]


@dataclass(frozen=True, kw_only=True)
class Result:
    """Figures of one benchmark, a field each."""

    def to_json(self) -> dict[str, Any]:
        """The figures as JSON holds them."""
        return asdict(self)


@dataclass(frozen=True, kw_only=True)
class Figure(Result):
    """A figure and what it has to be."""

    name: str  # of the figure
    bound: float  # for it
    ours: float  # as measured
    ok: bool  # whether it holds

    @classmethod
    def at_most(cls, name: str, ours: float, bound: float) -> "Figure":
        """A figure with an upper bound."""
        return cls(name=name, bound=bound, ours=ours, ok=ours <= bound)

    @classmethod
    def at_least(cls, name: str, ours: float, bound: float) -> "Figure":
        """A figure with a lower bound."""
        return cls(name=name, bound=bound, ours=ours, ok=ours >= bound)

    def words(self) -> str:
        """A line for a terminal."""
        return f"{'ok  ' if self.ok else 'FAIL'}  {self.name}: {self.ours:g} ({self.bound:g})"


@dataclass(frozen=True, kw_only=True)
class TickResult(Result):
    """One method on one stack."""

    robot: str  # name of the robot
    joints: int  # its actuated joints
    controller: str  # "whole_body", "reduced", ..., or the peer's name
    solver: str  # "direct", "cascade/osqp", ..., or what the peer solves with
    stack: str  # "table1" or "default"; for a peer, the stack it comes nearest to
    contacts: str  # "double" or "single"
    # "tick" where methods take turns tick by tick, which leaves each a cold cache; "batch" where
    # they take turns every `BATCH` ticks, as peers in other processes must
    schedule: str
    variables: int  # unknowns of the problem
    # two-sided rows, finite bounds on single unknowns among them; None where a peer does not tell
    rows: int | None
    p50_us: float  # median tick from state to command [us]
    p99_us: float  # 99th percentile [us]
    max_us: float  # longest tick [us]
    # Least processor time of a tick, without the times at which another process had the core [us];
    # None where a peer does not tell it
    cpu_min_us: float | None
    # 10th percentile of the same, which other processes hardly change [us]
    cpu_p10_us: float | None
    cpu_p50_us: float | None  # median [us]
    cpu_p99_us: float | None  # 99th percentile [us]
    # Median of each phase [us]; None where a peer does not tell phases apart
    phases_us: dict[str, float | None]
    ticks: int  # timed ticks
    # Largest relative residual of the physics levels (dynamics with torque limits, contacts with
    # joint limits); for a peer, of the base's equation of motion or of the held contacts; None
    # where it cannot be told
    residual_max: float | None
    # Median over the ticks of this method's time by that of `direct` on the same state, stack and
    # schedule
    ratio_to_direct: float
    # The same by that of the whole-body controller's method of the same name; None where that was
    # not timed
    ratio_to_whole: float | None
    relaxed_ticks: int | None  # ticks on which some level could not be met in full
    missed_ticks: int  # ticks that fell back to a safe command


def time_statistics(
    times: TickTimes, direct: TickTimes, whole: TickTimes | None = None
) -> dict[str, Any]:
    """The fields of a result that follow from the times."""
    medians = 1e6 * np.median(times.phases, axis=0)
    return {
        **spread_us(times.total),
        **_processor_us(times.cpu),
        "phases_us": {
            name: None if np.isnan(value) else round(float(value), 1)
            for name, value in zip(PHASES, medians, strict=True)
        },
        "ticks": len(times.total),
        "ratio_to_direct": median_ratio(times, direct),
        "ratio_to_whole": None if whole is None else median_ratio(times, whole),
    }


def _processor_us(seconds: Float64[np.ndarray, " ticks"]) -> dict[str, float | None]:
    """The fields of processor time [us]; None where a peer does not tell it."""
    percents = {"min": 0.0, "p10": 10.0, "p50": 50.0, "p99": 99.0}
    told = not np.isnan(seconds).any()
    return {
        f"cpu_{name}_us": round(1e6 * float(np.percentile(seconds, percent)), 1) if told else None
        for name, percent in percents.items()
    }


def median_ratio(times: TickTimes, reference: TickTimes) -> float:
    """Median, over the ticks, of one method's time by another's on the same states."""
    return round(float(np.median(times.total / reference.total)), 3)


def spread_us(seconds: Float64[np.ndarray, " ticks"], digits: int = 1) -> dict[str, Any]:
    """Median, 99th percentile and greatest of times [us]; None where there are none."""
    percents = {"p50_us": 50.0, "p99_us": 99.0, "max_us": 100.0}
    if not len(seconds):
        return dict.fromkeys(percents)
    return {k: round(1e6 * float(np.percentile(seconds, p)), digits) for k, p in percents.items()}


def result_table(results: Sequence[Result]) -> str:
    """A row a figure and a column a result, for a terminal."""
    columns = [_flat(result.to_json()) for result in results]
    rows = [(key, [column[key] for column in columns], "") for key in columns[0]]
    width = max(len(cell) for _, cells, _ in rows for cell in cells)
    return "\n".join(text_table([""] * len(columns), rows, width)[1:])


def _flat(figures: Mapping[str, Any]) -> dict[str, str]:
    """Figures as words, those of a part under its name."""
    found: dict[str, str] = {}
    for key, value in figures.items():
        if isinstance(value, Mapping):
            found |= {f"{key} {part}": text for part, text in _flat(value).items()}
        else:
            found[key] = f"{value:.4g}" if isinstance(value, float) else str(value)
    return found


def text_table(
    heads: Sequence[str], rows: Sequence[tuple[str, Sequence[str], str]], width: int = 9
) -> list[str]:
    """Lines of a table for a terminal."""
    longest = max((len(name) for name, _, _ in rows), default=0)
    return [
        "  ".join(([f"{name:{longest}}"] if longest else []) + [f"{c:>{width}}" for c in cells])
        + remark
        for name, cells, remark in [("", heads, ""), *rows]
    ]


def time_cells(row: "TickResult") -> list[str]:
    """Times of a result as a table has them: `TIME_HEADS`."""
    times = (row.p50_us, row.p99_us, row.max_us, row.cpu_p10_us, row.cpu_p99_us)
    return [or_dash(t, ".0f") for t in (*times, *(row.phases_us[phase] for phase in PHASES))]


def or_dash(value: int | float | None, form: str) -> str:
    """A number by a format; a dash for None."""
    return "-" if value is None else format(value, form)


TIME_HEADS = ("p50", "p99", "max", "cpu p10", "cpu p99", *PHASES)
_HEADS = (*TIME_HEADS, "x direct", "x whole", "variables", "rows", "residual")


def format_table(results: Sequence[TickResult]) -> str:
    """One block a stack, one line a method; times in microseconds."""
    blocks: list[str] = []
    longest = max(len(method_name(r)) for r in results)
    for stack in dict.fromkeys(r.stack for r in results):
        rows = [r for r in results if r.stack == stack]
        first = rows[0]
        lines = [(f"{method_name(r):{longest}}", *_cells(r)) for r in rows]
        blocks.append(
            f"{first.robot}, {first.joints} joints, {first.contacts} support, stack {stack!r}: "
            f"{first.ticks} ticks, times in us\n" + "\n".join(text_table(_HEADS, lines))
        )
    return "\n\n".join(blocks)


def _cells(row: TickResult) -> tuple[list[str], str]:
    cells = [*time_cells(row), f"{row.ratio_to_direct:.2f}", or_dash(row.ratio_to_whole, ".2f")]
    cells += [str(row.variables), or_dash(row.rows, "d"), or_dash(row.residual_max, ".0e")]
    missed = f"  {row.missed_ticks} of {row.ticks} ticks FAILED" if row.missed_ticks else ""
    return cells, missed


def method_name(row: TickResult) -> str:
    """Which controller, how it solves, and on what schedule it was timed."""
    own = row.controller in CONTROLLERS
    name = f"{row.controller} {row.solver}" if own else row.solver
    return name if row.schedule == "tick" else f"{name}, in batches"
