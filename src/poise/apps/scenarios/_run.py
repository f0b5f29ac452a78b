"""Running a scenario: the loop from state to command to plant, with everything recorded."""

import signal
import threading
import time as clock
from collections.abc import Callable, Generator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import FrameType

import numpy as np

from poise.apps.scenarios._by_hand import ByHand
from poise.apps.scenarios._checks import CheckResult, evaluate_checks, validate_checks
from poise.apps.scenarios._controllers import controller_of, is_by_hand, with_actuation
from poise.apps.scenarios._director import Director
from poise.apps.scenarios._scenario import Scenario
from poise.apps.scenarios._signals import RunSignals, collect_signals
from poise.control import PHYSICS_LEVELS, Command, Controller
from poise.robots import Robot, load_robot
from poise.sim import BlockWatch, Plant, Push, Recorder, Value, Viewer, open_viewer
from poise.stack import ComTask, FrameTask

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
        pushes: the pushes that the plant was given.
        signals: what was recorded.
        checks: what held and what did not.
        fell: whether the robot fell.
        ended_early: why the run stopped before its end, "" where it did not.
        wall_seconds: time that the loop took [s].
    """

    scenario: Scenario
    robot: Robot
    plant: Plant = field(repr=False)
    controller: Controller | ByHand = field(repr=False)
    pushes: tuple[Push, ...]
    signals: RunSignals = field(repr=False)
    checks: tuple[CheckResult, ...]
    fell: bool
    ended_early: str
    wall_seconds: float

    @property
    def ok(self) -> bool:
        """Whether the robot stayed up and every check held."""
        return not self.fell and all(check.ok for check in self.checks)


def run_scenario(
    scenario: Scenario,
    *,
    log: Path | None = None,
    view: bool = False,
    progress: Progress | None = None,
) -> Run:
    """Runs a scenario on its plant.

    Everything that can be wrong with the scenario on its robot is found before the first tick. A
    fall, a diverged simulation or Ctrl-C end the run early; what was recorded stays.

    Args:
        scenario: what to run.
        log: MCAP file to write while it runs; none when None.
        view: whether to show the plant in a window, in real time.
        progress: told how far the run is.

    Returns:
        The run with its signals and checks.

    Raises:
        PoiseError: the scenario does not fit its robot.
    """
    scenario = with_actuation(scenario)
    robot = load_robot(scenario.robot)
    controller = controller_of(scenario, robot)
    director = Director(scenario, controller.stack, robot)
    validate_checks(scenario.checks, controller.stack, robot)
    if isinstance(controller, ByHand):
        blocks = scenario.plant.blocks + controller.blocks
        scenario = replace(scenario, plant=replace(scenario.plant, blocks=blocks))
    plant = Plant(robot, scenario.plant, seed=scenario.seed)
    if isinstance(controller, ByHand):
        plant.reset(controller.q_start)
    pushes = tuple(
        plant.push(push.body, push.force_on(robot.mass), push.duration, push.at)
        for push in scenario.pushes
    )
    metadata = {
        "scenario": scenario.name,
        "controller": scenario.controller.name,
        "seed": str(scenario.seed),
    }
    begin = clock.perf_counter()
    with (
        Recorder(plant, log, metadata=metadata) as recorder,
        open_viewer(plant) if view else nullcontext() as viewer,
        _until_interrupted() as interruption,
    ):
        for _ in _loop(scenario, controller, director, plant, recorder, progress):
            if viewer is not None:
                viewer.sync()
            if interruption.reason or (viewer is not None and not viewer.open):
                break
    wall = clock.perf_counter() - begin
    stack, by_hand = controller.stack, is_by_hand(scenario.controller)
    levels = PHYSICS_LEVELS + len(stack.levels)
    signals = collect_signals(recorder, robot, stack, levels, scenario.plant.blocks)
    ended_early = interruption.reason or _reason(plant, viewer, scenario)
    checks = evaluate_checks(
        scenario.checks, signals, stack, plant.fallen, ended_early, physics=not by_hand
    )
    return Run(
        scenario=scenario,
        robot=robot,
        plant=plant,
        controller=controller,
        pushes=pushes,
        signals=signals,
        checks=checks,
        fell=plant.fallen,
        ended_early=ended_early,
        wall_seconds=wall,
    )


def _loop(
    scenario: Scenario,
    controller: Controller | ByHand,
    director: Director,
    plant: Plant,
    recorder: Recorder,
    progress: Progress | None,
) -> Generator[None]:
    """One pass a tick: state, references, command, plant, record; at least one."""
    watch = BlockWatch(plant) if plant.config.blocks else None
    shown = 0.0
    # Half a period of slack: times are multiples of the period, up to rounding.
    end = scenario.duration - 0.5 * scenario.plant.control_dt
    while plant.time < end and not plant.fallen:
        state = plant.state()
        director.lead(state)
        command = controller.step(state)
        plant.step(command)
        _record(recorder, controller, command, watch, director)
        if progress is not None and plant.time >= shown:
            progress(plant.time, scenario.duration)
            shown = plant.time + 0.05
        yield


def _record(
    recorder: Recorder,
    controller: Controller | ByHand,
    command: Command,
    watch: BlockWatch | None,
    director: Director,
) -> None:
    stack, suspended = controller.stack, controller.suspended
    extra: dict[str, Value] = {
        f"error/{task.name}": np.nan if task in suspended else float(np.linalg.norm(task.error))
        for _, task in stack.tasks()
    }
    for _, task in stack.tasks():
        if isinstance(task, ComTask) and task.target_position is not None:
            extra["com_reference"] = task.masked_target()
        if isinstance(task, FrameTask) and task.unit != "rad" and task.target_position is not None:
            shown = np.full(3, np.nan) if task in suspended else task.target_position
            extra[f"target/{task.name}"] = shown
    for contact in stack.contacts:
        extra[f"planned/{contact.frame}"] = float(contact.active)
    if isinstance(controller, ByHand):
        extra |= controller.signals()
    if watch is not None:
        extra["clearance"] = watch.clearance()
    if command.status.ok:
        extra |= {f"tick_us/{phase}": 1e6 * s for phase, s in controller.timings.items()}
    else:
        extra |= {f"tick_us/{phase}": np.nan for phase in controller.timings}
    walker = director.walker
    if walker is not None:
        extra["zmp_reference"] = np.array(walker.zmp)
        extra["tick_us/walk"] = 1e6 * director.walk_seconds
    recorder.record(command, **extra)
    if isinstance(controller, ByHand):
        recorder.note("mode", controller.mode)
    if walker is not None:
        recorder.note("mode", f"walk {walker.status.value}")


@dataclass
class _Interruption:
    reason: str = ""


@contextmanager
def _until_interrupted() -> Generator[_Interruption]:
    """Notes Ctrl-C, so that the run ends after a whole tick and the report is still written.

    A second Ctrl-C interrupts at once. Outside the main thread Python lets nobody listen.
    """
    interruption = _Interruption()
    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or before is None:
        yield interruption
        return

    def note(_number: int, _frame: FrameType | None) -> None:
        interruption.reason = "interrupted by the user"
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
