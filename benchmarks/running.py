"""`bench_run`: times of whole runs: real time, parts of a tick, its worst, and collections.

A run is the same each time, so a tick's own time is the least that it took in any of several runs:
what others did to the machine is left out.
"""

import gc
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from benchmarks.commands import Bench, Words
from benchmarks.recording import Progress
from benchmarks.result import Figure, Result, spread_us
from poise.apps.scenarios import Run, Scenario, load_scenario, run_scenario, stage_scenario
from poise.errors import ConfigurationError
from poise.sim import Recorder, rollout

REAL_TIME = {"walk": 2.0, "over_an_obstacle_velocity": 5.0}
"""How many seconds of a scenario a second of processor time simulates at least."""

LONGEST_COLLECTION_MS = 1.0
"""How long a loop stands still at most while Python looks for garbage [ms]."""

WORST = 5.0
"""The controller's worst own tick may take that many medians."""

SHARE = {"over_an_obstacle_velocity": 0.1}
"""Part of the control period that estimator, leader and controller take at most, at the median."""

STEP = ("estimator", "leader", "control")
"""Parts of a control step, from the sensors to the command."""

PARTS = ("physics", "sensors", *STEP, "recording", "log", "rest")
"""Of a loop, in the order of a table: `log` is the thread that writes, `rest` what is left."""


@dataclass(frozen=True, kw_only=True)
class RunBench(Bench):
    """Time whole scenarios, recorded and logged, by parts of a tick, and the worst tick.

    example: python -m benchmarks run --scenarios walk,over_an_obstacle --robot g1 --ticks 50000
    """

    scenarios: Words = ("walk",)  # shipped ones, or files
    robot: str | None = None  # another robot than the scenarios' own
    ticks: int = 1  # of each scenario, in as many watched runs as that takes

    def __post_init__(self) -> None:
        if self.ticks < 1:
            raise ConfigurationError("nothing to time", got=self.ticks, wanted=">= 1 tick")

    def act(self) -> int:
        """Time and print."""
        return self.show(bench_run, run_figures, unit="")


@dataclass(frozen=True, kw_only=True)
class RunResult(Result):
    """Times of one scenario, of the processor."""

    scenario: str
    robot: str
    simulated_s: float
    ticks: int  # of a run
    runs: int  # that were watched
    start_s: float  # before the first run: Python and its packages
    processor_s: float  # of a run that is not watched, from the scenario to its checks, all threads
    real_time: float  # `simulated_s` over `processor_s`
    parts_us: dict[str, float]  # of a tick, see `PARTS`, by mean over the watched runs
    step_us: dict[str, float]  # own times of estimator, leader and controller together
    share_of_period: float  # median of these over the control period
    control_us: dict[str, float]  # own times of the controller
    worst_over_median: float  # of the latter
    worst_at_s: float  # when in the run that is
    slow: int  # ticks above the bound on it
    missed_ticks: int  # without a usable command
    collections: int  # searches for garbage inside loops
    collection_ms: float  # the longest


def bench_run(plan: RunBench, progress: Progress | None = None) -> list[RunResult]:
    """Run scenarios as `poise run` does, recorded and logged, without report and video."""
    start, results = time.process_time(), list[RunResult]()
    stated = [load_scenario(name) for name in plan.scenarios]
    for number, scenario in enumerate(replace(s, robot=plan.robot or s.robot) for s in stated):
        with tempfile.TemporaryDirectory() as folder, watched_collections() as found:
            begin = time.process_time()
            run = run_scenario(scenario, log=Path(folder) / "log.mcap")
            processor = time.process_time() - begin
            watched = [_Watched(scenario, Path(folder) / "again.mcap")]
            while sum(len(each.steps) for each in watched) < plan.ticks:
                if progress is not None:
                    done = sum(len(each.steps) for each in watched) / plan.ticks
                    progress(number + done, float(len(stated)))
                watched.append(_Watched(scenario, Path(folder) / "again.mcap"))
        results.append(_result(run, start, processor, watched, found))
    return results


@contextmanager
def watched_collections() -> Generator[list[float]]:
    """Processor times of the garbage collections inside loops that froze theirs [ms]."""
    found: list[float] = []
    begin = 0.0

    def note(phase: str, _info: dict[str, int]) -> None:
        nonlocal begin
        now = time.thread_time()
        if phase == "start":
            begin = now
        elif gc.get_freeze_count():  # Counts a long list: not to be timed.
            found.append(1e3 * (now - begin))

    gc.callbacks.append(note)
    try:
        yield found
    finally:
        gc.callbacks.remove(note)


class _Clock:
    """Processor time of the calling thread, by what is called."""

    def __init__(self) -> None:
        self.seconds: defaultdict[str, float] = defaultdict(float)

    def watch(self, owner: Any, method: str, part: str) -> None:
        """Times a method of one object from now on."""
        inner: Callable[..., Any] = getattr(owner, method)

        def timed(*values: Any) -> Any:
            begin = time.thread_time()
            try:
                return inner(*values)
            finally:
                self.seconds[part] += time.thread_time() - begin

        setattr(owner, method, timed)


class _Watched:
    """A run of a scenario with times of the parts of its ticks; the first tick does not count."""

    def __init__(self, scenario: Scenario, log: Path) -> None:
        stage, clock, recorder = stage_scenario(scenario), _Clock(), Recorder(log)
        calls: list[tuple[Any, str, str]] = [
            (stage.plant, "step", "physics"),
            (stage.plant, "state", "sensors"),
            (stage.plant, "true_state", "sensors"),
            (stage.leader, "lead", "leader"),
            (stage.controller, "step", "control"),
            (recorder, "observe", "recording"),
        ]
        if stage.estimator is not None:
            calls.append((stage.estimator, "update", "estimator"))
        for owner, method, part in calls:
            clock.watch(owner, method, part)
        self.missed, rows, begin, all_threads = 0, list[list[float]](), 0.0, 0.0
        for tick in rollout(
            stage.plant,
            stage.controller,
            stage.leader,
            [recorder],
            estimator=stage.estimator,
            duration=scenario.duration,
        ):
            self.missed += not tick.command.status.ok
            if not rows:
                # What comes before the first tick is no part of one.
                clock.seconds.clear()
                begin, all_threads = time.thread_time(), time.process_time()
            rows.append([clock.seconds[part] for part in STEP])
        loop = time.thread_time() - begin
        seconds = clock.seconds | {"log": time.process_time() - all_threads - loop}
        seconds["rest"] = loop - sum(clock.seconds.values())
        # Seconds of a control step, tick by tick, part by part.
        self.steps: Float64[np.ndarray, "n 3"] = np.diff(np.array(rows), axis=0)
        self.parts = {part: seconds.get(part, 0.0) / max(len(self.steps), 1) for part in PARTS}


def _result(
    run: Run, start: float, processor: float, watched: Sequence[_Watched], found: Sequence[float]
) -> RunResult:
    steps = np.array([each.steps for each in watched])
    own, control = steps.sum(axis=2).min(axis=0), steps[:, :, -1].min(axis=0)
    median, worst = float(np.median(control)), int(np.argmax(control))
    period, ticks = run.scenario.plant.control_dt, len(run.signals.time)
    parts = {p: np.mean([each.parts[p] for each in watched]) for p in PARTS}
    return RunResult(
        scenario=run.scenario.name,
        robot=run.robot.name,
        simulated_s=round(run.plant.time, 3),
        ticks=ticks,
        runs=len(watched),
        start_s=round(start, 2),
        processor_s=round(processor, 2),
        real_time=round(run.plant.time / processor, 2),
        parts_us={part: round(1e6 * float(value), 1) for part, value in parts.items()},
        step_us=spread_us(own),
        share_of_period=round(float(np.median(own)) / period, 4),
        control_us=spread_us(control),
        worst_over_median=round(float(control[worst]) / median, 2),
        worst_at_s=round((worst + 1) * period, 3),
        slow=int(np.count_nonzero(control > WORST * median)),
        missed_ticks=max(each.missed for each in watched),
        collections=len(found),
        collection_ms=round(max(found, default=0.0), 3),
    )


def run_figures(results: Sequence[RunResult]) -> list[Figure]:
    """Bounds of runs; own times, and so the worst, say something of three runs and more."""
    figures: list[Figure] = []
    for r in results:
        name = f"{r.scenario} on {r.robot}"
        least, share = REAL_TIME.get(r.scenario), SHARE.get(r.scenario)
        if least is not None:
            what = f"{name}: seconds simulated in one of the processor"
            figures.append(Figure.at_least(what, r.real_time, least))
        what = f"{name}: longest garbage collection inside the loop [ms]"
        figures.append(Figure.at_most(what, r.collection_ms, LONGEST_COLLECTION_MS))
        if share is not None:
            what = f"{name}: median control step over the period"
            figures.append(Figure.at_most(what, r.share_of_period, share))
        if r.runs >= 3:
            what = f"{name}: worst own tick of the controller over the median"
            figures.append(Figure.at_most(what, r.worst_over_median, WORST))
    return figures
