"""`bench_run`: the processor time of whole recorded runs, where it goes, and their collections."""

import gc
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from benchmarks.recording import Progress
from benchmarks.result import Figure, Result, text_table
from poise.apps.scenarios import Run, Scenario, load_scenario, run_scenario, stage_scenario
from poise.sim import Recorder, rollout

REAL_TIME = {"walk": 2.0, "over_an_obstacle_velocity": 5.0}
"""How many seconds of a scenario a second of processor time simulates at least."""

LONGEST_COLLECTION_MS = 1.0
"""How long a loop stands still at most while Python looks for garbage [ms]."""

PARTS = ("physics", "sensors", "estimator", "leader", "control", "recording", "log", "rest")
"""Of a loop, in the order of a table: `log` is the thread that writes, `rest` what is left."""


@dataclass(frozen=True, kw_only=True)
class RunBench:
    """Settings of the benchmark."""

    scenario: str = "walk"  # a shipped scenario or a file
    robot: str | None = None  # another robot than the scenario's; the scenario's own when None


@dataclass(frozen=True, kw_only=True)
class RunResult(Result):
    """Times of a run."""

    scenario: str  # that ran
    robot: str  # on this one
    simulated_s: float  # time that passed for the robot [s]
    ticks: int  # of the controller
    start_s: float  # processor time of the process before the run: Python and its packages [s]
    processor_s: float  # of the run, from the scenario to its checks, all threads [s]
    real_time: float  # `simulated_s` over `processor_s`
    # Processor time of each part of a tick, see `PARTS`, in a second run that is watched [us]
    parts_us: dict[str, float]
    collections: int  # how often Python looked for garbage inside the loop
    collection_ms: float  # processor time of the longest of those [ms]


def bench_run(plan: RunBench, progress: Progress | None = None) -> list[RunResult]:
    """Runs a scenario as `poise run` does, recorded and logged, without its report and video."""
    start = time.process_time()
    scenario = load_scenario(plan.scenario)
    scenario = replace(scenario, robot=scenario.robot if plan.robot is None else plan.robot)
    with tempfile.TemporaryDirectory() as folder, watched_collections() as found:
        begin = time.process_time()
        run = run_scenario(scenario, log=Path(folder) / "log.mcap", progress=progress or False)
        processor = time.process_time() - begin
        parts = _parts(scenario, Path(folder) / "again.mcap")
    return [_result(run, start, processor, parts, found)]


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


def _parts(scenario: Scenario, log: Path) -> dict[str, float]:
    """Processor time of the parts of a run's loop, a tick [us]."""
    stage, clock = stage_scenario(scenario), _Clock()
    recorder = Recorder(log)
    watched: list[tuple[Any, str, str]] = [
        (stage.plant, "step", "physics"),
        (stage.plant, "state", "sensors"),
        (stage.plant, "true_state", "sensors"),
        (stage.leader, "lead", "leader"),
        (stage.controller, "step", "control"),
        (recorder, "observe", "recording"),
    ]
    if stage.estimator is not None:
        watched.append((stage.estimator, "update", "estimator"))
    for owner, method, part in watched:
        clock.watch(owner, method, part)
    ticks, begin, all_threads = 0, 0.0, 0.0
    for ticks, _ in enumerate(
        rollout(
            stage.plant,
            stage.controller,
            stage.leader,
            [recorder],
            estimator=stage.estimator,
            duration=scenario.duration,
        )
    ):
        if ticks == 0:
            # The first tick is not counted: what comes before it is no part of a tick.
            clock.seconds.clear()
            begin, all_threads = time.thread_time(), time.process_time()
    loop = time.thread_time() - begin
    seconds = clock.seconds | {"log": time.process_time() - all_threads - loop}
    seconds["rest"] = loop - sum(clock.seconds.values())
    return {part: round(1e6 * seconds.get(part, 0.0) / max(ticks, 1), 1) for part in PARTS}


def _result(
    run: Run, start: float, processor: float, parts: dict[str, float], found: Sequence[float]
) -> RunResult:
    return RunResult(
        scenario=run.scenario.name,
        robot=run.robot.name,
        simulated_s=round(run.plant.time, 3),
        ticks=len(run.signals.time),
        start_s=round(start, 2),
        processor_s=round(processor, 2),
        real_time=round(run.plant.time / processor, 2),
        parts_us=parts,
        collections=len(found),
        collection_ms=round(max(found, default=0.0), 3),
    )


def run_figures(results: Sequence[RunResult]) -> list[Figure]:
    """What must hold of runs."""
    figures: list[Figure] = []
    for result in results:
        name = f"{result.scenario} on {result.robot}"
        least, longest = REAL_TIME.get(result.scenario), result.collection_ms
        if least is not None:
            ours, what = result.real_time, "seconds simulated in one of the processor"
            figures.append(Figure(name=f"{name}: {what}", bound=least, ours=ours, ok=ours >= least))
        figures.append(
            Figure(
                name=f"{name}: longest garbage collection inside the loop [ms]",
                bound=LONGEST_COLLECTION_MS,
                ours=longest,
                ok=longest <= LONGEST_COLLECTION_MS,
            )
        )
    return figures


def format_run_table(results: Sequence[RunResult]) -> str:
    """The parts of a tick, and the figures, for a terminal."""
    rows = [
        (f"{r.scenario} on {r.robot}", [f"{r.parts_us[part]:.0f}" for part in PARTS], "")
        for r in results
    ]
    lines = ["processor time of a tick [us]:", *text_table(PARTS, rows)]
    lines += [
        f"{result.simulated_s:g} s simulated in {result.processor_s:g} s of the processor, "
        f"after {result.start_s:g} s to start; {result.collections} collections"
        for result in results
    ]
    lines += [figure.words() for figure in run_figures(results)]
    return "\n".join(lines)
