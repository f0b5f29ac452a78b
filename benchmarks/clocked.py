"""`Clocked`: a controller under the clock, tick by tick over the states of a recording.

`collector_paused`: no garbage collection inside what is timed.

`Subject`: one of Poise's own controllers under the clock on a recorded run.
"""

import gc
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from time import perf_counter, thread_time

import numpy as np

from benchmarks.methods import Method
from benchmarks.recording import Recording
from benchmarks.result import PHASES, Ticks, TickTimes
from benchmarks.stances import bench_stack
from poise.control import Command, Controller, make_controller
from poise.dynamics import RobotState

RELAXED = 1e-8
"""Relative residual from which a level counts as not met in full."""


class Clocked:
    """A controller with its times and what its solver left over.

    Args:
        method: which controller, and how it solves.
        controller: the controller.
        states: what it is told, one a tick.
        aim: sets the targets of a tick before the clock starts.

    Attributes:
        solver: name of the method.
        name: of the controller.
        controller: the controller.
        command: of the last tick, None before.
    """

    def __init__(
        self,
        method: Method,
        controller: Controller,
        states: Sequence[RobotState],
        aim: Callable[[int], None],
    ) -> None:
        self.solver, self.name, self.controller = method.name, method.controller, controller
        self.command: Command | None = None
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
            physics = len(residuals) - len(controller.stack.levels)
            self._residual[index] = max(residuals[:physics])
            self._relaxed[index] = max(residuals) > RELAXED
        self.command = command

    def skip(self, index: int) -> None:
        """Leaves one tick out; where targets have no memory there is nothing to do."""

    def run(self, first: int, count: int) -> None:
        """Times a batch of ticks in a row.

        Args:
            first: index of the first state.
            count: how many states.
        """
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


class Subject(Clocked):
    """A controller with a stack of its own, led by the targets of a recording.

    Args:
        recording: the run it is timed on.
        kind: which stack.
        method: which controller, and how it solves.

    Raises:
        UnknownNameError: no such controller or backend.
        MissingExtraError: the backend is not installed.
    """

    def __init__(self, recording: Recording, kind: str, method: Method) -> None:
        stack = bench_stack(recording.robot, kind, recording.stance)
        controller = make_controller(recording.robot, stack, method.plan())
        recording.prepare(stack)
        super().__init__(
            method, controller, recording.states, lambda tick: recording.aim(stack, tick)
        )
