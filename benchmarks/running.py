"""`bench_run`: where the processor time of a whole recorded run goes, and its longest collection."""

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
from benchmarks.result import Result, text_table
from poise.apps.scenarios import load_scenario
from poise.apps.scenarios._checks import evaluate_checks
from poise.apps.scenarios._signals import collect_signals
from poise.apps.scenarios._stage import describe, stage_scenario
from poise.sim import Recorder, rollout

REAL_TIME = {"walk": 2.0, "over_an_obstacle": 5.0}
"""How many seconds of a scenario a second of processor time simulates at least."""

LONGEST_COLLECTION_MS = 1.0
"""How long the loop stands still at most while Python looks for garbage [ms]."""

PARTS = ("stage", "measuring", "physics", "leader", "control", "recording", "log", "loop", "checks")
"""Of a run, in the order in which a table shows them: the loop is what is left of it."""


@dataclass(frozen=True, kw_only=True)
class RunBench:
    """What to run.

    Attributes:
        scenario: a shipped scenario or a file.
        robot: another robot than the scenario's; the scenario's own when None.
        duration: another one than the scenario's [s]; its own when None.
    """

    scenario: str = "walk"
    robot: str | None = None
    duration: float | None = None


@dataclass(frozen=True, kw_only=True)
class RunResult(Result):
    """Where the time went.

    Attributes:
        scenario: that ran.
        robot: on this one.
        simulated: time that passed for the robot [s].
        ticks: of the controller.
        parts: processor time of each part [s], see `PARTS`; `log` is the thread that writes.
        processor: of the whole process from the scenario's file to its checks [s].
        real_time: `simulated` over `processor`.
        collections: how often Python looked for garbage inside the loop.
        collection_ms: the longest of those [ms].
    """

    scenario: str
    robot: str
    simulated: float
    ticks: int
    parts: dict[str, float]
    processor: float
    real_time: float
    collections: int
    collection_ms: float


@dataclass(frozen=True, kw_only=True)
class Figure(Result):
    """A figure and what it has to be.

    Attributes:
        name: of the figure.
        bound: for it.
        ours: as measured.
        ok: whether it holds.
    """

    name: str
    bound: float
    ours: float
    ok: bool


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

    @contextmanager
    def part(self, name: str) -> Generator[None]:
        """Times a block."""
        begin = time.thread_time()
        yield
        self.seconds[name] += time.thread_time() - begin


@contextmanager
def watched_collections() -> Generator[list[float]]:
    """Durations of the garbage collections inside a block [ms of the processor]."""
    found: list[float] = []
    begin = 0.0

    def note(phase: str, _info: dict[str, int]) -> None:
        nonlocal begin
        if phase == "start":
            begin = time.thread_time()
        else:
            found.append(1e3 * (time.thread_time() - begin))

    gc.callbacks.append(note)
    try:
        yield found
    finally:
        gc.callbacks.remove(note)


def bench_run(plan: RunBench, progress: Progress | None = None) -> list[RunResult]:
    """Runs a scenario as `poise run` does, recorded and logged, without its report and video.

    Args:
        plan: what to run.
        progress: told how many ticks are done.
    """
    begin, clock = time.process_time(), _Clock()
    with clock.part("stage"):
        scenario = load_scenario(plan.scenario)
        robot = scenario.robot if plan.robot is None else plan.robot
        stage = stage_scenario(replace(scenario, robot=robot))
        duration = scenario.duration if plan.duration is None else plan.duration
    with tempfile.TemporaryDirectory() as folder:
        recorder = Recorder(
            Path(folder) / "log.mcap", metadata=describe(stage.scenario, stage.pushes)
        )
        for owner, method, part in (
            (stage.plant, "step", "physics"),
            (stage.plant, "state", "measuring"),
            (stage.plant, "true_state", "measuring"),
            (stage.leader, "lead", "leader"),
            (stage.controller, "step", "control"),
            (recorder, "observe", "recording"),
        ):
            clock.watch(owner, method, part)
        count = round(duration / stage.plant.control_dt)
        collections: list[float] = []
        loop, others = time.thread_time(), time.process_time()
        for tick in rollout(
            stage.plant,
            stage.controller,
            stage.leader,
            [recorder],
            estimator=stage.estimator,
            duration=duration,
        ):
            if tick.index == 0:
                watching = watched_collections()
                collections = watching.__enter__()
            if progress is not None and tick.index % 100 == 0:
                progress(float(tick.index), float(count))
        watching.__exit__(None, None, None)
        loop = time.thread_time() - loop
        clock.seconds["log"] = time.process_time() - others - loop
    clock.seconds["loop"] = loop - sum(
        clock.seconds[part] for part in ("measuring", "physics", "leader", "control", "recording")
    )
    with clock.part("checks"):
        signals = collect_signals(recorder.record, stage.robot)
        evaluate_checks(stage.scenario.checks, signals, stage.plant.fallen, "")
    processor = time.process_time() - begin
    return [
        RunResult(
            scenario=stage.scenario.name,
            robot=stage.robot.name,
            simulated=stage.plant.time,
            ticks=len(signals.time),
            parts={part: round(clock.seconds[part], 3) for part in PARTS},
            processor=round(processor, 3),
            real_time=round(stage.plant.time / processor, 3),
            collections=len(collections),
            collection_ms=round(max(collections, default=0.0), 3),
        )
    ]
