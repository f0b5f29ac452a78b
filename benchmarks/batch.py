"""`bench_batch`: many states at once beside single ticks, on one thread and on two."""

import gc
import multiprocessing
from collections.abc import Sequence
from dataclasses import dataclass
from multiprocessing.queues import Queue
from multiprocessing.synchronize import Barrier
from time import perf_counter, thread_time

import numpy as np

from benchmarks.commands import Bench
from benchmarks.recording import STACKS, Progress, Recording, bench_stack, record_run
from benchmarks.result import Figure, Result
from poise.control import WholeBodyController
from poise.dynamics import RobotState
from poise.errors import ConfigurationError, UnknownNameError
from poise.robots import load_robot

DEAREST = 1.2
"""What a state of a batch may take of a single tick, by processor time."""

THROUGHPUT = 1.8
"""How many times as many states two threads do as one, at least."""

ROUNDS = 10
"""Batches of each kind, in turn."""

_STATES, _SECONDS = 256, 1.5
"""Processes solve batches of so many states for so long [s]."""


@dataclass(frozen=True, kw_only=True)
class BatchBench(Bench):
    """Time many states in one call beside single ticks, on one thread and on two.

    example: python -m benchmarks batch --robot g1
    """

    robot: str = "g1"  # a biped
    stack: str = "default"  # "table1" or "default"
    ticks: int = 4096  # states of a batch

    def __post_init__(self) -> None:
        if self.stack not in STACKS:
            raise UnknownNameError("no such stack", got=self.stack, choices=STACKS)

    def act(self) -> int:
        """Time and print."""
        return self.show(bench_batch, batch_figures)


@dataclass(frozen=True, kw_only=True)
class BatchResult(Result):
    """Times of a state."""

    robot: str  # name of the robot
    stack: str  # what was solved
    states: int  # of a batch
    single_us: float  # processor time of a single tick, median of the rounds' means [us]
    batch_us: float  # processor time of a state of a batch on one thread, the same [us]
    batch_over_single: float  # median over the rounds of the ratio
    first_us: float  # processor time of a state of the first batch, whose searches begin cold [us]
    threads: float  # median over the rounds of what two threads do in a second by what one does
    processes: float  # the same of two processes of one thread each: what the machine gives
    difference: float  # largest difference of a torque to that of the single tick [N m]


def bench_batch(plan: BatchBench, progress: Progress | None = None) -> list[BatchResult]:
    """Times batches and single ticks of the same states in turn."""
    if plan.ticks < 1:
        raise ConfigurationError("a batch needs states", got=plan.ticks, wanted=">= 1")
    recording = _record(plan)
    single, batch, states = *(_controller(plan, recording) for _ in range(2)), recording.states
    begin = thread_time()
    commands = batch.solve_batch(states, threads=1)
    first = thread_time() - begin
    ticks = [single.step(state) for state in states]
    difference = np.abs(commands.torque - np.array([tick.torque for tick in ticks])).max()
    times: list[tuple[float, float]] = []
    ratios: list[float] = []
    for i in range(ROUNDS):
        gc.collect()
        times.append((_single(single, states), _batch(batch, states)))
        one, two = (_elapsed(batch, states, threads) for threads in (1, 2))
        ratios.append(one / two)
        if progress is not None:
            progress(float(i + 1), float(ROUNDS))
    seconds = np.array(times)
    return [
        BatchResult(
            robot=plan.robot,
            stack=plan.stack,
            states=len(states),
            single_us=_us(np.median(seconds[:, 0]), len(states)),
            batch_us=_us(np.median(seconds[:, 1]), len(states)),
            batch_over_single=round(float(np.median(seconds[:, 1] / seconds[:, 0])), 3),
            first_us=_us(first, len(states)),
            threads=round(float(np.median(ratios)), 2),
            processes=_processes(plan, states),
            difference=float(difference),
        )
    ]


def _record(plan: BatchBench) -> Recording:
    return record_run(load_robot(plan.robot), "double", plan.ticks)


def _controller(plan: BatchBench, recording: Recording) -> WholeBodyController:
    """A controller whose targets are those in the middle of a recording."""
    stack = bench_stack(recording.robot, plan.stack, recording.stance)
    controller = WholeBodyController(recording.robot, stack)
    recording.prepare(stack)
    recording.aim(stack, len(recording.states) // 2)
    controller.step(recording.states[0])
    return controller


def _single(controller: WholeBodyController, states: Sequence[RobotState]) -> float:
    begin = thread_time()
    for state in states:
        controller.step(state)
    return thread_time() - begin


def _batch(controller: WholeBodyController, states: Sequence[RobotState]) -> float:
    begin = thread_time()
    controller.solve_batch(states, threads=1)
    return thread_time() - begin


def _elapsed(controller: WholeBodyController, states: Sequence[RobotState], threads: int) -> float:
    begin = perf_counter()
    controller.solve_batch(states, threads=threads)
    return perf_counter() - begin


def _us(seconds: float, states: int) -> float:
    return round(1e6 * float(seconds) / states, 1)


def _processes(plan: BatchBench, states: Sequence[RobotState]) -> float:
    """What two processes do in a second by what one of them does alone."""
    spawn = multiprocessing.get_context("spawn")
    ready, rates = spawn.Barrier(2), spawn.Queue()
    few = list(states[:_STATES])
    workers = [
        spawn.Process(target=_work, args=(plan, few, first, ready, rates), daemon=True)
        for first in (True, False)
    ]
    for worker in workers:
        worker.start()
    alone, *together = (rates.get() for _ in range(3))
    for worker in workers:
        worker.join()
    return round(sum(together) / alone, 2)


def _work(
    plan: BatchBench,
    states: Sequence[RobotState],
    first: bool,
    ready: Barrier,
    rates: "Queue[float]",
) -> None:
    """One of two processes: the first one works alone, then both do."""
    robot = load_robot(plan.robot)
    controller = WholeBodyController(robot, bench_stack(robot, plan.stack, "double"))
    _elapsed(controller, states, 1)
    for both in (False, True):
        ready.wait()
        if first or both:
            rates.put(_rate(controller, states))


def _rate(controller: WholeBodyController, states: Sequence[RobotState]) -> float:
    """States in a second."""
    begin, done = perf_counter(), 0
    while perf_counter() < begin + _SECONDS:
        controller.solve_batch(states, threads=1)
        done += len(states)
    return done / (perf_counter() - begin)


def batch_figures(results: Sequence[BatchResult]) -> list[Figure]:
    """What must hold of batches."""
    figures: list[Figure] = []
    for r in results:
        name = f"{r.states} states of {r.robot}, {r.stack}"
        figures += [
            Figure.at_most(
                f"{name}: a state of a batch over a single tick", r.batch_over_single, DEAREST
            ),
            Figure.at_least(f"{name}: throughput of two threads over one", r.threads, THROUGHPUT),
        ]
    return figures
