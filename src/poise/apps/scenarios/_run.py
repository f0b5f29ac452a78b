"""Running a scenario: its cast and its plant in a rollout, with everything recorded."""

import signal
import threading
import time as clock
from collections.abc import Callable, Generator, Mapping
from contextlib import closing, contextmanager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

from poise._progress import Bar
from poise._show import html_table, new_figure
from poise.apps.report import Check
from poise.apps.scenarios._checks import evaluate_checks
from poise.apps.scenarios._reader import load_scenario
from poise.apps.scenarios._scenario import Scenario
from poise.apps.scenarios._signals import RunSignals, collect_signals
from poise.apps.scenarios._stage import describe, stage_scenario
from poise.control import Controller
from poise.robots import Robot
from poise.sim import Plant, Recorder, RunRecord, Tick, Viewer, open_viewer, rollout

INTERRUPTED = "interrupted by the user"
"""The reason of an early end by Ctrl-C."""

Progress = Callable[[float, float], None]
"""Called with the seconds done and the seconds in all."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """A finished run.

    Attributes:
        scenario: what was run.
        robot: on which robot.
        plant: the plant, as it was left.
        controller: the controller, as it was left.
        record: of the run.
        signals: what was recorded, tick by tick.
        checks: what held and what did not.
        fell: whether the robot fell.
        ended_early: why the run stopped before its end, "" where it did not.
        wall_seconds: time that the loop took [s].
    """

    scenario: Scenario
    robot: Robot
    plant: Plant = field(repr=False)
    controller: Controller = field(repr=False)
    record: RunRecord = field(repr=False)
    signals: RunSignals = field(repr=False)
    checks: tuple[Check, ...]
    fell: bool
    ended_early: str
    wall_seconds: float

    def _repr_html_(self) -> str:
        rows = [
            (
                "holds" if c.ok else "failed",
                c.name,
                f"{c.value:.3g} {c.unit}",
                f"{c.relation} {c.bound:g} {c.unit}",
                "" if c.time is None else f"{c.time:.2f} s",
                c.mechanism,
            )
            for c in sorted(self.checks, key=lambda c: c.ok)
        ]
        title = f"{self.scenario.name} on {self.robot.name}: " + (
            "all checks hold" if self.ok else "failed"
        )
        return html_table(title, ("", "check", "value", "bound", "worst at", "what happened"), rows)

    def plot(self) -> Any:
        """COM and task errors, ZMP margin, torques, loads and the estimate's drift over time.

        The worst moments of failed checks are dashed lines.

        Returns:
            A `matplotlib.figure.Figure`, which a notebook shows and `savefig` writes.

        Raises:
            MissingExtraError: matplotlib is not installed.
        """
        signals = self.signals
        com_error = np.linalg.norm(signals.com_reference - signals.com, axis=1)
        ratio = np.abs(signals.torque) / signals.torque_max
        panels: list[tuple[str, dict[str, np.ndarray]]] = [
            ("COM error [m]", {"": com_error}),
            ("task errors [m, rad]", dict(signals.task_errors)),
            ("ZMP margin [m]", {"": signals.zmp_margin}),
            ("torque / limit", {"": np.max(ratio, axis=1, initial=0.0)}),
            ("sole loads [N]", dict(signals.sole_forces)),
        ]
        if signals.base_errors is not None:
            panels.append(("drift of the estimate [m]", {"": signals.base_errors.drift}))
        panels = [(title, lines) for title, lines in panels if _has_numbers(lines)]
        figure = new_figure(8.0, 1.0 + 1.6 * len(panels))
        axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
        for ax, (title, lines) in zip(axes, panels, strict=True):
            for name, values in lines.items():
                ax.plot(signals.time, values, label=name or None, linewidth=1.0)
            if any(lines):
                ax.legend(fontsize=6, loc="upper right")
            if title.startswith("task"):
                # A hand is off by millimetres, a posture by tenths of a radian.
                ax.set_yscale("log")
            for check in self.checks:
                if not check.ok and check.time is not None:
                    ax.axvline(check.time, color="tab:red", linestyle="--", linewidth=0.8)
            ax.set_ylabel(title, fontsize=8)
            ax.grid(visible=True, alpha=0.3)
        axes[-1].set_xlabel("time [s]")
        return figure

    @property
    def ok(self) -> bool:
        """Whether the robot stayed up and every check held."""
        return not self.fell and all(check.ok for check in self.checks)


def _has_numbers(lines: Mapping[str, np.ndarray]) -> bool:
    return any(np.isfinite(values).any() for values in lines.values())


def run_scenario(
    scenario: Scenario | str | Path,
    *,
    robot: Robot | None = None,
    log: str | Path | None = None,
    view: bool = False,
    progress: Progress | bool = False,
) -> Run:
    """Runs a scenario on its plant.

    Everything that can be wrong with the scenario on its robot is found before the first tick. A
    fall, a diverged simulation or Ctrl-C end the run early; what was recorded stays.

    Args:
        scenario: what to run; or the name of a shipped one, or a file.
        robot: what to run it on; the scenario's own when None.
        log: MCAP file to write while it runs; none when None.
        view: whether to show the plant in a window, in real time.
        progress: told how far the run is; True shows it, in a terminal, a notebook or a log.

    Returns:
        The run with its signals and checks.

    Raises:
        PoiseError: there is no such scenario, or it does not fit its robot.
    """
    if not isinstance(scenario, Scenario):
        scenario = load_scenario(scenario)
    if isinstance(progress, bool):
        with Bar("simulating", "s") if progress else nullcontext() as bar:
            return _run(scenario, robot, log, view, bar)
    return _run(scenario, robot, log, view, progress)


def _run(
    scenario: Scenario,
    robot: Robot | None,
    log: str | Path | None,
    view: bool,
    progress: Progress | None,
) -> Run:
    stage = stage_scenario(scenario, robot)
    scenario, plant = stage.scenario, stage.plant
    recorder = Recorder(log, metadata=describe(scenario, stage.pushes))
    begin = clock.perf_counter()
    with (
        open_viewer(plant) if view else nullcontext() as viewer,
        _until_interrupted() as interruption,
        closing(
            rollout(
                plant,
                stage.controller,
                stage.leader,
                [recorder, *([] if progress is None else [_Progress(progress, scenario.duration)])],
                estimator=stage.estimator,
                duration=scenario.duration,
            )
        ) as ticks,
    ):
        for _ in ticks:
            if viewer is not None:
                viewer.sync()
            if interruption.reason or (viewer is not None and not viewer.open):
                break
    wall = clock.perf_counter() - begin
    record = recorder.record
    signals = collect_signals(record, stage.robot)
    ended_early = interruption.reason or _reason(plant, viewer, scenario)
    checks = evaluate_checks(scenario, signals, stage.robot, plant.fallen, ended_early)
    return Run(
        scenario=scenario,
        robot=stage.robot,
        plant=plant,
        controller=stage.controller,
        record=record,
        signals=signals,
        checks=checks,
        fell=plant.fallen,
        ended_early=ended_early,
        wall_seconds=wall,
    )


class _Progress:
    """Tells how far a run is, twenty times a second of it."""

    def __init__(self, progress: Progress, duration: float) -> None:
        self._progress, self._duration, self._shown = progress, duration, 0.0

    def begin(self, plant: Plant, controller: object, leader: object) -> None:
        """Nothing to tell yet."""

    def observe(self, tick: Tick) -> None:
        """Tells."""
        time = tick.truth.time
        if time >= self._shown:
            self._progress(time, self._duration)
            self._shown = time + 0.05

    def end(self) -> None:
        """Nothing more to tell."""


@dataclass
class _Interruption:
    reason: str = ""


@contextmanager
def _until_interrupted() -> Generator[_Interruption]:
    """Notes Ctrl-C, so that the run ends after a whole tick and the report is still written.

    A second Ctrl-C interrupts at once. Outside the main thread Python lets nobody listen, and a
    process that ignores Ctrl-C, as workers do, goes on ignoring it.
    """
    interruption = _Interruption()
    before = signal.getsignal(signal.SIGINT)
    ignored = before in (None, signal.SIG_IGN)
    if threading.current_thread() is not threading.main_thread() or ignored:
        yield interruption
        return

    def note(_number: int, _frame: FrameType | None) -> None:
        interruption.reason = INTERRUPTED
        signal.signal(signal.SIGINT, before)

    signal.signal(signal.SIGINT, note)
    try:
        yield interruption
    finally:
        signal.signal(signal.SIGINT, before)


def _reason(plant: Plant, viewer: Viewer | None, scenario: Scenario) -> str:
    if plant.diverged:
        return "the simulation diverged"
    if plant.fallen:
        return f"the robot fell at {plant.time:.3f} s"
    if viewer is not None and plant.time < scenario.duration - scenario.plant.control_dt:
        return "the viewer was closed"
    return ""
