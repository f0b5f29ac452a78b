"""`bench_bias`: times the formulas of the bias acceleration, interleaved in one run."""

import gc
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields
from fractions import Fraction
from time import perf_counter
from typing import Any

import numpy as np
from jaxtyping import Float64

from benchmarks.bias import formulas
from benchmarks.bias.formulas import FORMULAS, BiasTick, PrioritisedTask
from benchmarks.bias.recording import BiasInputs, record_motion
from benchmarks.clocked import collector_paused
from benchmarks.flops import FlopCounter
from benchmarks.recording import Progress
from poise.errors import ConfigurationError
from poise.robots import Robot, load_robot

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
class BiasResult:
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

    def to_json(self) -> dict[str, Any]:
        """The result as JSON holds it."""
        return asdict(self)


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
    with collector_paused():
        for i in range(total):
            tick = inputs.of(states[i % len(states)])
            for turn in range(len(names)):
                j = (i + turn) % len(names)
                seconds[i, j] = _timed(FORMULAS[names[j]], tick)
            if i % 50 == 0:
                gc.collect()
                if progress is not None:
                    progress(float(i), float(total))
    tick = inputs.of(states[-1])
    counts = count_operations(tick)
    times = 1e6 * seconds[WARM_UP:]
    ratios = np.median(times / times[:, [names.index(REFERENCE)]], axis=0)
    return [
        _result(robot, len(tick.tasks), name, times[:, j], float(ratios[j]), counts[name])
        for j, name in enumerate(names)
    ]


def format_bias_table(results: Sequence[BiasResult]) -> str:
    """One line a formula; times in microseconds.

    Args:
        results: of one benchmark.
    """
    first = results[0]
    width = max(len(r.formula) for r in results)
    lines = [
        f"{first.robot}, {first.joints} joints, {first.tasks} tasks: all bias accelerations of a "
        f"tick; {first.ticks} ticks, times in us",
        "  ".join([" " * width, *(f"{head:>10}" for head in _HEADS)]),
    ]
    for r in results:
        times = (r.mean_us, r.std_us, r.p50_us, r.p99_us, r.max_us)
        cells = [*(f"{t:.2f}" for t in times), f"{r.ratio_to_original:.3f}", str(r.flops)]
        lines.append("  ".join([f"{r.formula:{width}}", *(f"{cell:>10}" for cell in cells)]))
    return "\n".join(lines)


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

    return BiasTick(
        tasks=[
            PrioritisedTask(
                **{f.name: counter.array(getattr(task, f.name)) for f in fields(PrioritisedTask)}
            )
            for task in tick.tasks
        ],
        references=each(tick.references),
        references_p=each(tick.references_p),
        torques_above=each(tick.torques_above),
        M_inverse=counter.array(tick.M_inverse),
        h=counter.array(tick.h),
        v=counter.array(tick.v),
        before=each(tick.before),
    )


def _result(
    robot: Robot,
    tasks: int,
    formula: str,
    times: Float64[np.ndarray, " ticks"],
    ratio: float,
    flops: Fraction,
) -> BiasResult:
    return BiasResult(
        robot=robot.name,
        joints=robot.nj,
        tasks=tasks,
        formula=formula,
        mean_us=_short(float(times.mean())),
        std_us=_short(float(times.std())),
        p50_us=_short(float(np.median(times))),
        p99_us=_short(float(np.percentile(times, 99))),
        max_us=_short(float(times.max())),
        ratio_to_original=round(ratio, 4),
        flops=round(flops),
        ticks=len(times),
    )


def _short(microseconds: float) -> float:
    # A clock call takes some 50 ns: further digits say nothing.
    return round(microseconds, 2)
