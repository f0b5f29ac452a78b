"""`WalkSubject`: one of Poise's own controllers under the clock on a recorded walk."""

import numpy as np
from jaxtyping import Float64

from benchmarks.clocked import Clocked
from benchmarks.methods import Method
from benchmarks.walk_recording import WalkLead, WalkRecording
from poise.control import ReducedController, WholeBodyController, make_controller


class WalkSubject(Clocked):
    """A controller with a stack and a walker of its own, whose answers are kept.

    Args:
        recording: the walk.
        kind: one of `WALK_STACKS`.
        method: which controller, and how it solves.

    Attributes:
        lead: its walker.
        acceleration: answers at the ticks that were timed, NaN elsewhere [m/s^2, rad/s^2].
        torque: likewise [N m].
        wrench: likewise, of the contacts in the order of the stack, zero of inactive ones [N, N m].
        residuals: what each level could not meet, relative to its scale.
        variables: unknowns of the problem, of LQP 1 and of LQP 2 where that was solved.
        lqp: seconds in the solver, of the full problem or of LQP 1 alone.
        programs: what a tick had to solve: 1 for one problem, which is LQP 1 of the reduced
            controller, 2 for LQP 2 as well, 3 where the whole problem had to be solved after all.

    Raises:
        UnknownNameError: no such stack, controller or backend.
        MissingExtraError: the backend is not installed.
    """

    def __init__(self, recording: WalkRecording, kind: str, method: Method) -> None:
        self.lead: WalkLead = recording.lead(kind)
        robot, stack = recording.robot, self.lead.stack
        controller = make_controller(robot, stack, method.plan())
        super().__init__(method, controller, recording.states, self._aim_at)
        ticks, levels = len(recording.states), 2 + len(stack.levels)
        self.acceleration: Float64[np.ndarray, "ticks nv"] = np.full((ticks, robot.nv), np.nan)
        self.torque: Float64[np.ndarray, "ticks nj"] = np.full((ticks, robot.nj), np.nan)
        width = sum(c.dim for c in stack.contacts)
        self.wrench: Float64[np.ndarray, "ticks nf"] = np.full((ticks, width), np.nan)
        self.residuals: Float64[np.ndarray, "ticks levels"] = np.full((ticks, levels), np.nan)
        self.variables: Float64[np.ndarray, " ticks"] = np.full(ticks, np.nan)
        self.lqp: Float64[np.ndarray, " ticks"] = np.full(ticks, np.nan)
        self.programs: Float64[np.ndarray, " ticks"] = np.full(ticks, np.nan)

    def tick(self, index: int) -> None:
        """Times one tick and keeps its answer."""
        super().tick(index)
        command = self.command
        if command is None or command.acceleration is None or command.torque is None:
            return
        self.acceleration[index] = command.acceleration
        self.torque[index] = command.torque
        self.residuals[index, : len(command.residuals)] = command.residuals
        self.variables[index] = self.controller.size[0]
        first = 0
        for contact in self.lead.stack.contacts:
            place = slice(first, first + contact.dim)
            self.wrench[index, place] = command.wrenches.get(contact.name, 0.0)
            first = place.stop
        self.lqp[index], self.programs[index] = self._solver_time()

    def skip(self, index: int) -> None:
        """Leaves one tick out; the walker goes on."""
        self.lead.pass_by(self._states[index])

    def _aim_at(self, index: int) -> None:
        self.lead.lead(self._states[index])

    def _solver_time(self) -> tuple[float, int]:
        """Seconds in the solver of the full problem or LQP 1, and what had to be solved."""
        controller = self.controller
        if isinstance(controller, WholeBodyController):
            solution = controller.strategy.current.solution
            return (np.nan, 0) if solution is None else (solution.timings["total"], 1)
        if isinstance(controller, ReducedController):
            program = controller.strategy.current
            kind = 1 if program.second_solution is None else 2
            kind = kind if program.whole_solution is None else 3
            if program.first_solution is not None:
                return program.first_solution.timings["total"], kind
            return np.nan, kind
        return np.nan, 0
