"""`bench_worst`: the worst tick of a controller over many runs of the same scenario.

A run is the same each time, so a tick's own time is the least that it took in any of them: what is
left out is what others did to the machine.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from time import thread_time

import numpy as np
from jaxtyping import Float64

from benchmarks.recording import Progress
from benchmarks.result import Figure, Result, text_table
from benchmarks.running import LONGEST_COLLECTION_MS, watched_collections
from poise.apps.scenarios import Scenario, load_scenario, stage_scenario
from poise.control import Command
from poise.dynamics import RobotState
from poise.errors import ConfigurationError
from poise.sim import rollout

WORST = 5.0
"""A tick's own time may be that many medians."""

SCENARIOS = ("stand", "squat", "reach", "push", "balance_one_leg", "walk_step", "walk")
"""Shipped scenarios of torque controllers; pushes are in `push` and `walk`."""


@dataclass(frozen=True, kw_only=True)
class WorstBench:
    """Settings of the benchmark."""

    scenarios: Sequence[str] = SCENARIOS  # shipped ones, or files
    robot: str | None = None  # another robot than the scenarios' own
    ticks: int = 100_000  # of each scenario, in as many runs as that takes


@dataclass(frozen=True, kw_only=True)
class WorstResult(Result):
    """The ticks of one scenario."""

    scenario: str  # that ran
    robot: str  # on this one
    runs: int  # how often
    ticks: int  # of one run
    p50_us: float  # median of the ticks' own processor times [us]
    p99_us: float  # 99th percentile of them [us]
    max_us: float  # the greatest [us]
    ratio: float  # greatest over median
    at_s: float  # when in the run that is [s]
    slow: int  # ticks that take more than the bound
    collection_ms: float  # processor time of the longest collection inside a loop [ms]


def bench_worst(plan: WorstBench, progress: Progress | None = None) -> list[WorstResult]:
    """Runs each scenario again and again, and times every tick."""
    if plan.ticks < 1:
        raise ConfigurationError("nothing to time", got=plan.ticks, wanted=">= 1 tick")
    stated = [load_scenario(name) for name in plan.scenarios]
    scenarios = [replace(s, robot=plan.robot or s.robot) for s in stated]
    results: list[WorstResult] = []
    for i, scenario in enumerate(scenarios):
        with watched_collections() as collections:
            runs = [_run(scenario)]
            while sum(map(len, runs)) < plan.ticks:
                if progress is not None:
                    done = min(sum(map(len, runs)) / plan.ticks, 1.0)
                    progress(i + done, float(len(scenarios)))
                runs.append(_run(scenario))
        results.append(_result(scenario, np.array(runs), max(collections, default=0.0)))
    return results


def _run(scenario: Scenario) -> list[float]:
    """Processor time of every tick of one run [s]."""
    stage, seconds = stage_scenario(scenario), list[float]()
    step = stage.controller.step

    def timed(state: RobotState) -> Command:
        begin = thread_time()
        command = step(state)
        seconds.append(thread_time() - begin)
        return command

    # The controller of a stage is what checks look at, too, so that another cannot take its place.
    vars(stage.controller)["step"] = timed
    for _ in rollout(
        stage.plant,
        stage.controller,
        stage.leader,
        estimator=stage.estimator,
        duration=scenario.duration,
    ):
        pass
    return seconds


def _result(
    scenario: Scenario, seconds: Float64[np.ndarray, "runs ticks"], collection: float
) -> WorstResult:
    # The first tick begins without an active set, as every controller once does.
    own = 1e6 * seconds[:, 1:].min(axis=0)
    median, worst = float(np.median(own)), int(np.argmax(own))
    return WorstResult(
        scenario=scenario.name,
        robot=scenario.robot,
        runs=len(seconds),
        ticks=seconds.shape[1],
        p50_us=round(median, 1),
        p99_us=round(float(np.percentile(own, 99.0)), 1),
        max_us=round(float(own[worst]), 1),
        ratio=round(float(own[worst]) / median, 2),
        at_s=round((worst + 1) * scenario.duration / seconds.shape[1], 3),
        slow=int(np.count_nonzero(own > WORST * median)),
        collection_ms=round(collection, 3),
    )


def worst_figures(results: Sequence[WorstResult]) -> list[Figure]:
    """What must hold of the worst ticks."""
    figures: list[Figure] = []
    for r in results:
        name, longest = f"{r.scenario} on {r.robot}", r.collection_ms
        figures += [
            Figure(
                name=f"{name}: worst own tick over the median",
                bound=WORST,
                ours=r.ratio,
                ok=r.ratio <= WORST,
            ),
            Figure(
                name=f"{name}: longest garbage collection inside the loop [ms]",
                bound=LONGEST_COLLECTION_MS,
                ours=longest,
                ok=longest <= LONGEST_COLLECTION_MS,
            ),
        ]
    return figures


def format_worst_table(results: Sequence[WorstResult]) -> str:
    """The ticks of each scenario, and the figures, for a terminal."""
    heads = ("runs", "ticks", "p50", "p99", "max", "ratio", "at [s]", "slow")
    rows = [
        (
            f"{r.scenario} on {r.robot}",
            [
                str(r.runs),
                str(r.ticks),
                f"{r.p50_us:.0f}",
                f"{r.p99_us:.0f}",
                f"{r.max_us:.0f}",
                f"{r.ratio:.1f}",
                f"{r.at_s:.3f}",
                str(r.slow),
            ],
            "",
        )
        for r in results
    ]
    lines = ["own processor time of the ticks [us]:", *text_table(heads, rows)]
    lines += [figure.words() for figure in worst_figures(results)]
    return "\n".join(lines)
