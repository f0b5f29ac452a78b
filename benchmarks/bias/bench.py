"""`bench_bias`: times the formulas of the bias acceleration, interleaved in one run."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from fractions import Fraction
from time import perf_counter
from typing import Any

import numpy as np

from benchmarks.bias import formulas
from benchmarks.bias.formulas import FORMULAS, BiasTick
from benchmarks.bias.recording import BiasInputs, record_motion
from benchmarks.clocked import batches, in_turn
from benchmarks.flops import FlopCounter
from benchmarks.recording import Progress
from benchmarks.result import Result, spread_us, text_table
from poise.errors import ConfigurationError
from poise.robots import load_robot

WARM_UP = 30
"""Ticks before those that count."""

REFERENCE = "original"
"""What every other formula is compared with."""

_HEADS = ("mean", "std", "p50", "p99", "max", "x original", "FLOP")


@dataclass(frozen=True, kw_only=True)
class BiasBench:
    """What to time; checked when made.

    Attributes:
        robot: name or path of a robot on a fixed base, with hands.
        ticks: timed ticks of each formula; the motion is gone through as often as it takes.
    """

    robot: str = "upper17"
    ticks: int = 1100

    def __post_init__(self) -> None:
        if self.ticks < 1:
            raise ConfigurationError("nothing to time", got=self.ticks, wanted="at least one tick")


@dataclass(frozen=True, kw_only=True)
class BiasResult(Result):
    """One formula. Times are those of all bias accelerations of a tick.

    Attributes:
        robot: name of the robot.
        joints: its joints.
        tasks: number of tasks; all but the first have a bias acceleration.
        formula: "original", "original_plain", "proposed", "numerical" or "fused", see
            `formulas`.
        mean_us: mean [us].
        std_us: standard deviation [us].
        p50_us: median [us].
        p99_us: 99th percentile [us].
        max_us: longest [us].
        ratio_to_original: median, over the ticks, of this formula's time by that of the original
            on the same state.
        flops: floating point operations of a tick, as the code does them [FLOP].
        ticks: timed ticks.
    """

    robot: str
    joints: int
    tasks: int
    formula: str
    mean_us: float
    std_us: float
    p50_us: float
    p99_us: float
    max_us: float
    ratio_to_original: float
    flops: int
    ticks: int


def bench_bias(plan: BiasBench, progress: Progress | None = None) -> list[BiasResult]:
    """Records a moving run, then times every formula on its states, tick by tick in turn.

    The order rotates from tick to tick. What all formulas share is computed before the clock
    starts, see `formulas`; the garbage collector never runs inside a timed tick.

    Args:
        plan: what to time.
        progress: told how many of all ticks are done.

    Returns:
        One result a formula, the original first.

    Raises:
        PoiseError: the robot cannot do the motion.
    """
    robot = load_robot(plan.robot)
    states = record_motion(robot)
    inputs = BiasInputs(robot)
    names = list(FORMULAS)
    total = WARM_UP + plan.ticks
    seconds = np.zeros((total, len(names)))
    for batch in batches(total, 50):
        for i in batch:
            tick = inputs.of(states[i % len(states)])
            for j in in_turn(range(len(names)), i):
                seconds[i, j] = _timed(FORMULAS[names[j]], tick)
        if progress is not None:
            progress(float(batch.stop), float(total))
    tick = inputs.of(states[-1])
    counts = count_operations(tick)
    times = seconds[WARM_UP:]
    ratios = np.median(times / times[:, [names.index(REFERENCE)]], axis=0)
    return [
        BiasResult(
            robot=robot.name,
            joints=robot.nj,
            tasks=len(tick.tasks),
            formula=name,
            mean_us=round(1e6 * float(times[:, j].mean()), 2),
            std_us=round(1e6 * float(times[:, j].std()), 2),
            ratio_to_original=round(float(ratios[j]), 4),
            flops=round(counts[name]),
            ticks=plan.ticks,
            **spread_us(times[:, j], 2),
        )
        for j, name in enumerate(names)
    ]


def format_bias_table(results: Sequence[BiasResult]) -> str:
    """One line a formula; times in microseconds."""
    first = results[0]
    rows: list[tuple[str, list[str], str]] = []
    for r in results:
        times = (r.mean_us, r.std_us, r.p50_us, r.p99_us, r.max_us)
        cells = [*(f"{t:.2f}" for t in times), f"{r.ratio_to_original:.3f}", str(r.flops)]
        rows.append((r.formula, cells, ""))
    title = (
        f"{first.robot}, {first.joints} joints, {first.tasks} tasks: all bias accelerations of a "
        f"tick; {first.ticks} ticks, times in us"
    )
    return "\n".join([title, *text_table(_HEADS, rows, 10)])


def count_operations(tick: BiasTick) -> dict[str, Fraction]:
    """Floating point operations of each formula on one tick, as its code does them [FLOP].

    Args:
        tick: what the formulas start from.
    """
    counts: dict[str, Fraction] = {}
    for name, formula in FORMULAS.items():
        counter = FlopCounter()
        with counter.solvers_of(formulas):
            formula(_counted(tick, counter))
        counts[name] = counter.total
    return counts


def _timed(formula: Callable[[BiasTick], object], tick: BiasTick) -> float:
    begin = perf_counter()
    formula(tick)
    return perf_counter() - begin


def _counted(tick: BiasTick, counter: FlopCounter) -> BiasTick:
    def each(values: list[Any]) -> list[Any]:
        return [counter.array(value) for value in values]

    def all_of(holder: Any) -> Any:
        """The same dataclass with its arrays counted, one by one or in lists."""
        return replace(
            holder,
            **{
                f.name: each(value) if isinstance(value, list) else counter.array(value)
                for f in fields(holder)
                if (value := getattr(holder, f.name)) is not None and f.name != "tasks"
            },
        )

    return replace(all_of(tick), tasks=[all_of(task) for task in tick.tasks])
