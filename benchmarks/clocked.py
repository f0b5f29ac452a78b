"""`Clocked`: a controller under the clock, tick by tick over the states of a recording.

`take_turns`: quick methods tick by tick in turn, slow ones in between on some of the ticks.
"""

import gc
from collections.abc import Callable, Generator, Iterable, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter, thread_time
from typing import Protocol, TypeVar, runtime_checkable

import numpy as np
from jaxtyping import Int64

from benchmarks.methods import Method
from benchmarks.recording import Recording, bench_stack
from benchmarks.result import PHASES, Ticks, TickTimes
from poise.control import Command, Controller, make_controller
from poise.dynamics import RobotState

Item = TypeVar("Item")

RELAXED = 1e-8
"""Relative residual from which a level counts as not met in full."""


class Clocked:
    """A controller with its times and what its solver left over."""

    def __init__(
        self,
        method: Method,
        controller: Controller,
        states: Sequence[RobotState],
        aim: Callable[[int], None],
    ) -> None:
        # solver: name of the method
        # name: of the controller
        # controller: the controller
        self.solver, self.name, self.controller = method.name, method.controller, controller
        self.command: Command | None = None  # of the last tick, None before
        self._states, self._aim = states, aim
        ticks = len(states)
        self._total, self._cpu = np.full(ticks, np.nan), np.full(ticks, np.nan)
        self._phases = np.full((ticks, len(PHASES)), np.nan)
        self._residual = np.zeros(ticks)
        self._relaxed = np.zeros(ticks, dtype=np.bool_)
        self._missed = np.zeros(ticks, dtype=np.bool_)

    def tick(self, index: int) -> None:
        """Times one tick: from the recorded state to the command, targets set beforehand."""
        self._aim(index)
        controller, state = self.controller, self._states[index]
        cpu, begin = thread_time(), perf_counter()
        command = controller.step(state)
        self._total[index] = perf_counter() - begin
        self._cpu[index] = thread_time() - cpu
        timings, residuals = controller.timings, command.residuals
        self._phases[index] = [timings[phase] for phase in PHASES]
        self._missed[index] = not command.status.ok
        if residuals:
            self._residual[index] = max(residuals[: len(residuals) - len(controller.stack.levels)])
            self._relaxed[index] = max(residuals) > RELAXED
        self.command = command

    def skip(self, index: int) -> None:
        """Leaves one tick out; where targets have no memory there is nothing to do."""

    def run(self, first: int, count: int) -> None:
        """Times a batch of ticks in a row."""
        for index in range(first, first + count):
            self.tick(index)

    def times(self, counted: Ticks) -> TickTimes:
        """Times of the ticks that count."""
        return TickTimes(
            total=self._total[counted], cpu=self._cpu[counted], phases=self._phases[counted]
        )

    def size(self) -> tuple[int, int]:
        """Number of variables and of rows, finite bounds on single variables among them."""
        return self.controller.size

    def accuracy(self, counted: Ticks) -> tuple[float | None, int | None, int]:
        """Largest relative residual of the physics levels, relaxed ticks, missed ticks."""
        return (
            float(self._residual[counted].max()),
            int(self._relaxed[counted].sum()),
            int(self._missed[counted].sum()),
        )


@contextmanager
def collector_paused() -> Generator[None]:
    """Within, the garbage collector runs only when it is called."""
    was_on = gc.isenabled()
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def batches(count: int, size: int) -> Generator[range]:
    """Ticks, a batch at a time; the garbage collector runs between batches, never within one."""
    with collector_paused():
        for first in range(0, count, size):
            yield range(first, min(first + size, count))
            gc.collect()


def in_turn(items: Sequence[Item], turn: int) -> Sequence[Item]:
    """A B C, then B C A, ...: so that none always comes after the same other one."""
    first = turn % len(items) if items else 0
    return [*items[first:], *items[:first]]


class Subject(Clocked):
    """A controller with a stack of its own, with the targets of a recording."""

    def __init__(self, recording: Recording, kind: str, method: Method) -> None:
        stack = bench_stack(recording.robot, kind, recording.stance)
        controller = make_controller(recording.robot, stack, method.plan())
        recording.prepare(stack)
        super().__init__(
            method, controller, recording.states, lambda tick: recording.aim(stack, tick)
        )


@runtime_checkable
class Timed(Protocol):
    """What takes turns."""

    def tick(self, index: int) -> None:
        """Times one tick."""
        ...

    def skip(self, index: int) -> None:
        """Leaves one tick out."""
        ...


@dataclass(frozen=True, kw_only=True)
class Turns:
    """Who is timed when.

    In every batch of ticks the quick methods take turns tick by tick, the order reversed from one
    tick to the next, so that each follows itself as often as another. Then the slow ones do the
    first few ticks of the batch. Whoever begins finds the caches as somebody else left them, and a
    slow one a state far from its last: the first tick of a batch does not count, nor does the
    first batch.
    """

    ticks: int  # of the recording
    batch: int = 50  # ticks in a batch
    slow: int = 5  # ticks of a batch that slow methods do, the uncounted first one not included

    def quick_counted(self) -> Int64[np.ndarray, " n"]:
        """Ticks that count for quick methods."""
        every = np.arange(self.batch, self.ticks, dtype=np.int64)
        return every[every % self.batch != 0]

    def slow_counted(self) -> Int64[np.ndarray, " n"]:
        """Ticks that count for slow methods."""
        every = self.quick_counted()
        return every[every % self.batch <= self.slow]

    def counted(self, solver: str) -> Int64[np.ndarray, " n"]:
        """Ticks that count for a method by its name."""
        return self.quick_counted() if is_quick(solver) else self.slow_counted()


def is_quick(solver: str) -> bool:
    """Whether a method is timed on every tick: one of Poise's own, which has no backend."""
    return "/" not in solver


def time_all(subjects: Iterable[Clocked], turns: Turns) -> Generator[int]:
    """Times controllers in turn, quick or slow by the names of their methods; see `take_turns`."""
    groups: dict[bool, list[Clocked]] = {True: [], False: []}
    for one in subjects:
        groups[is_quick(one.solver)].append(one)
    yield from take_turns(groups[True], groups[False], turns)


def take_turns(quick: Sequence[Timed], slow: Sequence[Timed], turns: Turns) -> Generator[int]:
    """Times everything, the garbage collector waiting between batches."""
    for batch in batches(turns.ticks, turns.batch):
        for index in batch:
            for one in quick if index % 2 else quick[::-1]:
                one.tick(index)
        timed, left_out = batch[: turns.slow + 1], batch[turns.slow + 1 :]
        for index in timed:
            for one in slow if index % 2 else slow[::-1]:
                one.tick(index)
        for index in left_out:
            for one in slow:
                one.skip(index)
        yield batch.stop
