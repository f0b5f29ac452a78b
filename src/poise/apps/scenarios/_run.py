"""`run_scenario`: a staged scenario in a rollout, with everything recorded."""

import signal
import threading
import time as clock
from collections.abc import Callable, Generator
from contextlib import closing, contextmanager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

from poise._progress import Bar
from poise._show import html_table, new_figure
from poise.apps.report import Check, RunSignals
from poise.apps.scenarios._checks import evaluate_checks
from poise.apps.scenarios._scenario import Scenario, load_scenario
from poise.apps.scenarios._signals import collect_signals
from poise.apps.scenarios._stage import Stage, describe, stage_scenario
from poise.control import Controller
from poise.robots import Robot
from poise.sim import Plant, Recorder, RecorderConfig, RunRecord, open_viewer, rollout

INTERRUPTED = "interrupted by the user"
"""The reason of an early end by Ctrl-C."""

Progress = Callable[[float, float], None]
"""Called with the seconds done and the seconds in all."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """A finished run."""

    scenario: Scenario
    robot: Robot
    plant: Plant = field(repr=False)  # as it was at the end
    controller: Controller = field(repr=False)  # as it was at the end
    record: RunRecord = field(repr=False)
    signals: RunSignals = field(repr=False)  # the record, tick by tick
    checks: tuple[Check, ...]  # results of all
    fell: bool
    ended_early: str  # reason of an end before the scenario's, "" for none
    wall_seconds: float  # time that the loop took [s]

    @property
    def ok(self) -> bool:
        """True where the robot stayed up and every check held."""
        return not self.fell and all(check.ok for check in self.checks)

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
        """CoM and task errors, ZMP margin, torques, loads and the estimate's drift over time.

        The worst moments of failed checks are dashed lines.

        Returns:
            A `matplotlib.figure.Figure`, which a notebook shows and `savefig` writes.

        Raises:
            MissingExtraError: matplotlib is not installed.
        """
        signals, base = self.signals, self.signals.base_errors
        ratio = np.abs(signals.torque) / signals.torque_max
        panels: dict[str, dict[str, np.ndarray]] = {
            "CoM error [m]": {"": np.linalg.norm(signals.com_reference - signals.com, axis=1)},
            "task errors [m, rad]": {task.name: task.error for task in signals.tasks},
            "ZMP margin [m]": {"": signals.zmp_margin},
            "torque / limit": {"": np.max(ratio, axis=1, initial=0.0)},
            "sole loads [N]": {name: sole.force for name, sole in signals.soles.items()},
            "drift of the estimate [m]": {} if base is None else {"": base.drift},
        }
        panels = {t: of for t, of in panels.items() if np.isfinite([*of.values()]).any()}
        figure = new_figure(8.0, 1.0 + 1.6 * len(panels))
        axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
        for ax, (title, lines) in zip(axes, panels.items(), strict=True):
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


def run_scenario(
    scenario: Scenario | str | Path,
    *,
    robot: Robot | None = None,
    log: str | Path | None = None,
    view: bool = False,
    progress: Progress | bool = False,
) -> Run:
    """Run a scenario on its plant.

    Everything that can be wrong with the scenario on its robot is found before the first tick. A
    fall, a diverged simulation or Ctrl-C end the run early; what was recorded stays.

    Args:
        scenario: a scenario, the name of a shipped one, or a file.
        robot: the robot; the scenario's own when None.
        log: MCAP file to write meanwhile; none when None.
        view: show the plant in a window, in real time.
        progress: called with the progress of the run; True shows it, in a terminal, a notebook or
            a log.

    Returns:
        The run with its signals and checks.

    Raises:
        PoiseError: there is no such scenario, or it does not fit its robot.
    """
    if isinstance(progress, bool):
        with Bar("simulating", " s") if progress else nullcontext(lambda *_: None) as bar:
            return run_scenario(scenario, robot=robot, log=log, view=view, progress=bar)
    stated = scenario if isinstance(scenario, Scenario) else load_scenario(scenario)
    return run_stage(stage_scenario(stated, robot), log=log, view=view, progress=progress)


def run_stage(
    stage: Stage,
    *,
    log: str | Path | None = None,
    view: bool = False,
    progress: Progress = lambda *_: None,
    flush_dt: float = RecorderConfig().flush_dt,
    at_end: Callable[[], object] = lambda: None,
    on_interrupt: Callable[[], object] = lambda: None,
) -> Run:
    """Run a staged scenario; as `run_scenario`.

    Args:
        stage: as `stage_scenario` returns it, or on another plant.
        log: MCAP file to write meanwhile; none when None.
        view: show the plant in a window, in real time.
        progress: called with the progress of the run.
        flush_dt: time between two writings of the log [s].
        at_end: called after the last tick, before the run is judged.
        on_interrupt: called on Ctrl-C.

    Returns:
        The run with its signals and checks.
    """
    scenario, plant = stage.scenario, stage.plant
    config = RecorderConfig(flush_dt=flush_dt)
    recorder = Recorder(log, config=config, metadata=describe(scenario, stage.pushes))
    shown, ended_early, begin = 0.0, "", clock.perf_counter()
    with (
        open_viewer(plant) if view else nullcontext() as viewer,
        _until_interrupted(on_interrupt) as interrupted,
        closing(
            rollout(
                plant,
                stage.controller,
                stage.leader,
                [recorder],
                estimator=stage.estimator,
                duration=scenario.duration,
            )
        ) as ticks,
    ):
        for tick in ticks:
            time = tick.truth.time
            if time >= shown:
                progress(time, scenario.duration)
                shown = time + 0.05
            if viewer is not None:
                viewer.sync()
                if not viewer.open and time < scenario.duration - scenario.plant.control_dt:
                    ended_early = "the viewer was closed"
            if interrupted.is_set():
                ended_early = INTERRUPTED
            if ended_early:
                break
        fell, trouble = plant.fallen, plant.trouble
        at_end()
    wall = clock.perf_counter() - begin
    if ended_early != INTERRUPTED:
        ended_early = trouble or ended_early
    record = recorder.record
    signals = collect_signals(record, stage.robot)
    return Run(
        scenario=scenario,
        robot=stage.robot,
        plant=plant,
        controller=stage.controller,
        record=record,
        signals=signals,
        checks=evaluate_checks(scenario, signals, stage.robot, fell, ended_early),
        fell=fell,
        ended_early=ended_early,
        wall_seconds=wall,
    )


@contextmanager
def _until_interrupted(act: Callable[[], object]) -> Generator[threading.Event]:
    """Catch Ctrl-C, so that the run ends after a complete tick and the report is written.

    A second Ctrl-C interrupts as usual. Outside the main thread Python allows no handler, and a
    process that ignores Ctrl-C, as workers do, goes on ignoring it.
    """
    interrupted, before = threading.Event(), signal.getsignal(signal.SIGINT)
    ignored = before in (None, signal.SIG_IGN)
    if threading.current_thread() is not threading.main_thread() or ignored:
        yield interrupted
        return

    def note(_number: int, _frame: FrameType | None) -> None:
        interrupted.set()
        act()
        signal.signal(signal.SIGINT, before)

    signal.signal(signal.SIGINT, note)
    try:
        yield interrupted
    finally:
        signal.signal(signal.SIGINT, before)
