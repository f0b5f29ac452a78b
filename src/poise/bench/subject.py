"""`Subject`: one of Poise's own controllers under the clock."""

from time import perf_counter

import numpy as np

from poise.bench.methods import Method
from poise.bench.recording import Recording
from poise.bench.result import PHASES, TickTimes
from poise.bench.stances import bench_stack
from poise.control import make_controller
from poise.control.resolver import PHYSICS_LEVELS

RELAXED = 1e-8
"""Relative residual from which a level counts as not met in full."""


class Subject:
    """A controller with its own stack, its times and what its solver left over.

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
        self.solver, self.name = method.name, method.controller
        self.controller = make_controller(recording.robot, stack, method.plan())
        recording.prepare(stack)
        self._recording, self._stack = recording, stack
        ticks = len(recording.states)
        self._total = np.zeros(ticks)
        self._phases = np.zeros((ticks, len(PHASES)))
        self._residual = np.zeros(ticks)
        self._relaxed = np.zeros(ticks, dtype=np.bool_)
        self._missed = np.zeros(ticks, dtype=np.bool_)

    def tick(self, index: int) -> None:
        """Times one tick: from the recorded state to the command, targets set beforehand."""
        self._recording.aim(self._stack, index)
        controller, state = self.controller, self._recording.states[index]
        begin = perf_counter()
        command = controller.step(state)
        self._total[index] = perf_counter() - begin
        timings, residuals = controller.timings, command.residuals
        self._phases[index] = [timings[phase] for phase in PHASES]
        self._missed[index] = not command.status.ok
        if residuals:
            self._residual[index] = max(residuals[:PHYSICS_LEVELS])
            self._relaxed[index] = max(residuals) > RELAXED

    def run(self, first: int, count: int) -> None:
        """Times a batch of ticks in a row.

        Args:
            first: index of the first state.
            count: how many states.
        """
        for index in range(first, first + count):
            self.tick(index)

    def times(self, warm_up: int) -> TickTimes:
        """Times after the warm-up."""
        return TickTimes(total=self._total[warm_up:], phases=self._phases[warm_up:])

    def size(self) -> tuple[int, int]:
        """Number of variables and of rows, finite bounds on single variables among them."""
        return self.controller.size

    def accuracy(self, warm_up: int) -> tuple[float | None, int | None, int]:
        """Largest relative residual of the physics levels, relaxed ticks, missed ticks."""
        return (
            float(self._residual[warm_up:].max()),
            int(self._relaxed[warm_up:].sum()),
            int(self._missed[warm_up:].sum()),
        )
