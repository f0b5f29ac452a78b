"""`bench_teleop`: times the control step of the step teleoperator, and its whole simulation.

`record_walk`: a walk by scripted hands, recorded once: what the step teleoperator was told.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from time import process_time, thread_time

import numpy as np
from jaxtyping import Float64

from benchmarks.clocked import collector_paused
from benchmarks.recording import Progress
from benchmarks.result import Result, spread_us, text_table
from poise.apps.teleoperation import (
    SCRIPTS,
    TORQUE_TELEOP_PLANT,
    VELOCITY_TELEOP_PLANT,
    Script,
    TeleopRun,
    run_teleop,
)
from poise.control import Command
from poise.dynamics import RobotState
from poise.errors import ConfigurationError, PoiseError, UnknownNameError
from poise.locomotion import Device, OperatorSample, StepTeleoperator
from poise.robots import Robot, load_robot
from poise.sim import Plant, PlantConfig, rollout

SCENARIO = "over_an_obstacle"
"""The script that is walked: both feet stand, shift, swing and land in it."""

PLANTS = {"torque": TORQUE_TELEOP_PLANT, "velocity": VELOCITY_TELEOP_PLANT}
"""By what is commanded."""

PARTS = ("estimator", "leader", "controller")
"""Of a control step, in their order."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Walk:
    """A scripted scenario on a robot, before anything moves."""

    robot: Robot  # a biped with legs of six joints
    script: Script  # way-points of the hands
    q_start: Float64[np.ndarray, " nq"]  # where the robot starts
    plant: PlantConfig  # with the script's blocks

    @classmethod
    def over_an_obstacle(cls, robot: Robot, actuation: str = "velocity") -> "Walk":
        """Scenario 1 of Zhang and Kikuuwe, scaled to the robot."""
        # Says what is wrong with a robot that is no biped, before a script is made for it.
        StepTeleoperator(robot, actuation=actuation)
        script = SCRIPTS[SCENARIO](robot)
        return cls(
            robot=robot,
            script=script,
            q_start=script.posture(robot),
            plant=replace(PLANTS[actuation], blocks=script.blocks),
        )

    @property
    def ticks(self) -> int:
        """Control periods in the whole script."""
        return round(self.script.duration / self.plant.control_dt)

    def teleoperator(self) -> StepTeleoperator:
        """A teleoperator that has not begun."""
        return StepTeleoperator(self.robot, q_start=self.q_start, actuation=self.plant.actuation)


@dataclass(frozen=True, slots=True, eq=False)
class WalkTick:
    """Input of the teleoperator at a tick."""

    state: RobotState  # as measured, contacts and time included
    sample: OperatorSample | None  # of the operator's devices


def record_walk(walk: Walk, ticks: int, progress: Progress | None = None) -> tuple[WalkTick, ...]:
    """Walks a simulated robot and records the first ticks."""
    teleoperator = walk.teleoperator()
    controller = teleoperator.controller()
    plant = Plant(walk.robot, walk.plant)
    plant.reset(walk.q_start)
    device = walk.script.device(teleoperator)
    teleoperator.device = device
    recorded: list[WalkTick] = []
    ticking = rollout(
        plant,
        controller,
        teleoperator,
        estimator=teleoperator.estimator,
        duration=ticks * plant.control_dt,
    )
    for tick in ticking:
        # The script always says something.
        assert teleoperator.status is not None
        assert teleoperator.status.sample is not None
        recorded.append(WalkTick(tick.state, teleoperator.status.sample))
        if plant.fallen:
            raise PoiseError(f"{walk.robot.name} fell at {plant.time:.3f} s while being recorded")
        if progress is not None and len(recorded) % 50 == 0:
            progress(float(len(recorded)), float(ticks))
    return tuple(recorded)


WARM_UP = 30
"""Ticks before those that count, in every pass: a controller that has just been made."""


@dataclass(frozen=True, kw_only=True)
class TeleopBench:
    """What to time; checked when made."""

    robot: str = "biped20"  # name or path of a biped with legs of six joints
    # Timed ticks; the walk is gone through from its start as often as it takes. All of one pass
    # when None.
    ticks: int | None = None
    actuation: str = "torque"  # what is commanded, one of `PLANTS`

    def __post_init__(self) -> None:
        if self.actuation not in PLANTS:
            raise UnknownNameError("no such actuation", got=self.actuation, choices=PLANTS)
        if self.ticks is not None and self.ticks < 1:
            raise ConfigurationError("nothing to time", got=self.ticks, wanted="at least one tick")


@dataclass(frozen=True, kw_only=True)
class TeleopResult(Result):
    """What the control step of one robot needs."""

    robot: str  # name of the robot
    joints: int  # its actuated joints
    controller: str  # "teleop"
    actuation: str  # what is commanded
    scenario: str  # the script that was walked
    period_us: float  # the control period T [us]
    # Median step, from state and device sample to the command, by processor time of the thread [us]
    p50_us: float
    p99_us: float  # 99th percentile [us]
    max_us: float  # longest step [us]
    # estimator_us, leader_us, controller_us: medians of its parts [us]
    estimator_us: float
    leader_us: float
    controller_us: float
    share_of_period: float  # p50_us by period_us
    ticks: int  # timed steps
    single_support: float  # share of them with one foot in the air
    missed_ticks: int  # steps without a usable command
    simulated_s: float  # length of the simulated walk [s]
    # Simulated over elapsed time of the walk: sensors, hands, controller, physics, log and
    # distances to the blocks; no video
    real_time_factor: float
    # Simulated over processor time of the walk, all threads: about what it would be with nobody
    # else on the machine
    real_time_factor_cpu: float
    simulation_p50_us: float  # median step within the simulation, which leaves it other caches [us]


@dataclass(frozen=True, kw_only=True, eq=False)
class StepTimes:
    """One pass."""

    # Each step, part by part as in `PARTS`, by processor time of the thread [s]
    parts: Float64[np.ndarray, "ticks 3"]
    single: Sequence[bool]  # whether one foot was in the air after it
    commands: Sequence[Command]  # what it commanded

    @property
    def missed(self) -> list[bool]:
        """Whether a step gave no usable command."""
        return [not command.status.ok for command in self.commands]

    @property
    def seconds(self) -> Float64[np.ndarray, " ticks"]:
        """Each step [s]."""
        return self.parts.sum(axis=1)


def bench_teleop(plan: TeleopBench, progress: Progress | None = None) -> list[TeleopResult]:
    """Walks a robot over an obstacle, then times the controller on the same states and samples.

    The controller has a memory (modes, integrators, filters), so every pass goes from the start
    with a new one, and follows the recorded walk: equal inputs give equal commands. The garbage
    collector runs between passes, never inside one.
    """
    robot = load_robot(plan.robot)
    walk = Walk.over_an_obstacle(robot, plan.actuation)
    wanted = walk.ticks - WARM_UP if plan.ticks is None else plan.ticks
    length = min(wanted + WARM_UP, walk.ticks)
    passes = _passes(wanted, length)
    total = length + sum(passes)
    run, processor = _simulate(walk, length)

    def tell(done: float, _: float) -> None:
        if progress is not None:
            progress(done, float(total))

    recorded = record_walk(walk, length, tell)
    timed: list[StepTimes] = []
    done = length
    for count in passes:
        with collector_paused():
            timed.append(time_steps(walk, recorded[:count]))
        done += count
        tell(float(done), float(total))
    return [_result(walk, run, processor, timed)]


def time_steps(walk: Walk, recorded: Sequence[WalkTick]) -> StepTimes:
    """Times a new controller on a recorded walk, from its start."""
    teleoperator = walk.teleoperator()
    controller = teleoperator.controller()
    samples = iter([tick.sample for tick in recorded])
    teleoperator.device = Replayed(samples)
    parts = np.zeros((len(recorded), len(PARTS)))
    single: list[bool] = []
    commands: list[Command] = []
    for i, tick in enumerate(recorded):
        asked = thread_time()
        estimate = teleoperator.estimator.update(tick.state)
        begin = thread_time()
        teleoperator.lead(estimate)
        led = thread_time()
        command = controller.step(estimate)
        parts[i] = begin - asked, led - begin, thread_time() - led
        teleoperator.estimator.command(command.acceleration, tick.state.time)
        single.append(teleoperator.mode.single)
        commands.append(command)
    return StepTimes(parts=parts, single=single, commands=commands)


class Replayed:
    """A device that says again what another said, tick by tick."""

    def __init__(self, samples: Iterator[OperatorSample | None]) -> None:
        self._samples = samples

    def sample(self, time: float) -> OperatorSample | None:
        """The next one, whatever the time."""
        del time
        return next(self._samples)


def _passes(wanted: int, length: int) -> list[int]:
    """Ticks of each pass, its warm-up among them, so that all in all the wanted ones count."""
    whole, rest = divmod(wanted, length - WARM_UP)
    return [length] * whole + ([rest + WARM_UP] if rest else [])


def _simulate(walk: Walk, ticks: int) -> tuple[TeleopRun, float]:
    """The walk as scenarios and studies run it, and its processor time without set-up [s]."""
    begin = process_time()

    def hands(controller: StepTeleoperator) -> Device:
        # Asked for when everything else is made: what follows is the run.
        nonlocal begin
        begin = process_time()
        return walk.script.device(controller)

    duration = ticks * walk.plant.control_dt
    run = run_teleop(walk.robot, hands, walk.plant, duration=duration, q_start=walk.q_start)
    seconds = process_time() - begin
    if run.fell:
        raise PoiseError(f"{walk.robot.name} fell at {run.plant.time:.3f} s of the walk to time")
    return run, seconds


def _result(
    walk: Walk, run: TeleopRun, processor: float, passes: Sequence[StepTimes]
) -> TeleopResult:
    times = np.concatenate([each.seconds[WARM_UP:] for each in passes])
    parts = 1e6 * np.median(np.concatenate([each.parts[WARM_UP:] for each in passes]), axis=0)
    period = walk.plant.control_dt
    return TeleopResult(
        robot=walk.robot.name,
        joints=walk.robot.nj,
        controller="teleop",
        actuation=walk.plant.actuation,
        scenario=SCENARIO,
        period_us=round(1e6 * period, 1),
        share_of_period=round(float(np.median(times)) / period, 4),
        ticks=len(times),
        single_support=round(float(np.mean(_counted([each.single for each in passes]))), 3),
        missed_ticks=sum(_counted([each.missed for each in passes])),
        simulated_s=round(run.plant.time, 3),
        real_time_factor=round(run.real_time_factor, 2),
        real_time_factor_cpu=round(run.plant.time / processor, 2),
        simulation_p50_us=round(run.tick_us, 1),
        **spread_us(times),
        **{f"{name}_us": round(float(part), 1) for name, part in zip(PARTS, parts, strict=True)},
    )


def _counted(columns: Sequence[Sequence[bool]]) -> list[bool]:
    """What counts of every pass, in a row."""
    return [value for column in columns for value in column[WARM_UP:]]


_HEADS = (
    "p50", "p99", "max", "estimator", "leader", "controller", "% of T", "in sim.", "real time",
    "by CPU",
)  # fmt: skip


def format_teleop_table(results: Sequence[TeleopResult]) -> str:
    """One line a robot; times in microseconds."""
    first = results[0]
    rows: list[tuple[str, list[str], str]] = []
    for r in results:
        cells = [
            *(f"{t:.0f}" for t in (r.p50_us, r.p99_us, r.max_us)),
            *(f"{t:.0f}" for t in (r.estimator_us, r.leader_us, r.controller_us)),
            f"{100.0 * r.share_of_period:.1f}",
            f"{r.simulation_p50_us:.0f}",
            f"x {r.real_time_factor:.1f}",
            f"x {r.real_time_factor_cpu:.1f}",
        ]
        words = f"  {r.joints} joints, {r.ticks} ticks, {100.0 * r.single_support:.0f}% on one foot"
        rows.append(
            (r.robot, cells, words + (f", {r.missed_ticks} FAILED" if r.missed_ticks else ""))
        )
    title = f"step teleoperator by {first.actuation}, {first.scenario}, "
    title += f"T = {first.period_us / 1e3:g} ms; times in us"
    return "\n".join([title, *text_table(_HEADS, rows)])
