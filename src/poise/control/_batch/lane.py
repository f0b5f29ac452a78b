"""`Lane`: what one thread of a batch works with."""

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float64, Int64

from poise.control._batch.loop import UNUSABLE, Answers, Program, gather, solve_states
from poise.control._full_problem import FullProblem
from poise.control._softened import SoftenedFull
from poise.control._state_check import is_usable
from poise.control._strategy import UNSOFTENED, USABLE
from poise.dynamics import Dynamics, RobotState
from poise.hqp import LOST, UNSOUND, LexicographicSolver
from poise.robots import Robot
from poise.stack import Contact, Numbers, Owner, Stack, settling_of

CHUNK = 16
"""States that a thread takes at a time: Pinocchio's part of them, which one thread does at a time,
ends soon enough for the others, and their numbers stay in the processor's cache."""


class Lane:
    """Dynamics, rows, problem and workspace of one thread."""

    def __init__(self, robot: Robot, stack: Stack, contacts: tuple[Contact, ...]) -> None:
        self._robot, self._stack = robot, stack
        self.full = full = FullProblem(robot, stack, contacts)
        self._dynamics, self._solver = Dynamics(robot), LexicographicSolver()
        self._torques, joints = np.zeros((2, robot.nj)), np.zeros((2, robot.nj))
        evaluation, own = full.rows.evaluation, self._own_numbers()
        # Where a state's numbers are read when it is taken up, and written when it is solved.
        sources = [*own, *(owner.parameters for owner in evaluation.owners)]
        targets = [*own, *(np.empty_like(owner.parameters) for owner in evaluation.owners)]
        self._sources, self._targets = _places(sources), _places(targets)
        self._places = _addresses(self._sources)
        evaluation.inputs.places[:] = _addresses(self._targets[len(own) :])
        self._packed = np.zeros((CHUNK, sum(map(len, sources))))
        searched, work, changes = self._solver.memory_for(full.problem)
        # Bounds of its own, which no other thread writes.
        self._numbers = full.numbers_with(
            (self._torques[0], self._torques[1]), (joints[0], joints[1])
        )
        self._settling = settling_of(stack.joint_limit.viability, joints[0], joints[1])
        self._program = Program(
            places=_addresses(self._targets),
            state=self._dynamics.numbers.address,
            assembly=evaluation.assembly.address,
            settling=self._settling.address,
            full=self._numbers.address,
            problem=searched.address,
            work=work.address,
            changes=changes,
            terms=full.rows.softening.terms.address,
        )
        self._softened = SoftenedFull(full, LexicographicSolver)
        # What is compiled is compiled now, for the first batch may have no state of use.
        gather(self._places, self._packed[0])
        self.solve(slice(0, 0), _no_answers())

    def holding_tasks(self) -> list[Owner]:
        """Tasks without a target, which hold what the robot does in each state."""
        found: list[Owner] = []
        for owner in self.full.rows.evaluation.owners:
            before = owner.parameters.copy()
            owner.hold(self._dynamics)
            if not np.array_equal(before, owner.parameters, equal_nan=True):
                found.append(owner)
                owner.reset()
        return found

    def take(
        self,
        states: Sequence[RobotState],
        chunk: slice,
        answers: Answers,
        holding: Sequence[Owner],
        before_each: Callable[[int], None] | None,
    ) -> None:
        """Takes a chunk of states up: all that compiled code cannot do."""
        dynamics, torques = self._dynamics, self._stack.torque_limit
        self._torques[0], self._torques[1] = torques.lower, torques.upper
        for row, i in enumerate(range(chunk.start, chunk.stop)):
            if before_each is not None:
                before_each(i)
            state = states[i]
            if not is_usable(state, self._robot):
                answers.found[i] = UNUSABLE
                continue
            answers.found[i] = 0
            dynamics.update(state)
            for owner in holding:
                owner.hold(dynamics)
            self.full.rows.update_own(dynamics)
            gather(self._places, self._packed[row])
            for owner in holding:
                owner.reset()

    def solve(self, chunk: slice, answers: Answers) -> None:
        """Solves the states that were taken up last."""
        own = Answers(*(numbers[chunk] for numbers in answers))
        solve_states(self._packed, self._program.address, own)
        solved = (own.found != UNUSABLE) & (own.found != UNSOUND) & (own.found != LOST)
        strained = ~(own.strain <= UNSOFTENED)
        for i in np.flatnonzero(solved & strained).tolist():
            self._soften(i, Answers(*(numbers[i : i + 1] for numbers in own)))

    def _soften(self, row: int, own: Answers) -> None:
        """Solve one state of the chunk anew, with its levels softened."""
        # The compiled loop leaves the numbers of its last state in the problem.
        solve_states(self._packed[row : row + 1], self._program.address, own)
        solver = self._softened
        self.full.velocity = self._dynamics.v
        solver.reset()
        if solver.run() not in USABLE:
            return
        own.residuals[0] = solver.relative_residuals
        own.x[0], own.torque[0], _ = self.full.answer(solver.x, self._dynamics)

    def _own_numbers(self) -> list[Float64[np.ndarray, " _"]]:
        """Numbers of a state that are written where compiled code reads them."""
        own: list[Float64[np.ndarray, " _"]] = [
            *self._dynamics.moving_numbers,
            self._torques.ravel(),
        ]
        problem, rows = self.full.problem, self.full.rows
        for _, place in rows.own_tasks:
            # The stack's rows begin where the dynamics' end.
            at = slice(self._robot.nv + place.start, self._robot.nv + place.stop)
            beyond = slice(problem.n + at.start, problem.n + at.stop)
            own += [
                problem.A[at].ravel(),
                problem.lower[beyond],
                problem.upper[beyond],
                problem.weights[beyond],
                rows.evaluation.rows.error[place],
            ]
        return own


def _no_answers() -> Answers:
    matrix = np.zeros((0, 0))
    sides, found = np.zeros((0, 0), dtype=np.int8), np.zeros(0, dtype=np.int64)
    return Answers(sides, matrix, matrix, matrix, found, np.zeros(0))


def _places(numbers: Sequence[Float64[np.ndarray, " _"]]) -> list[Numbers]:
    return [Numbers(all=array) for array in numbers]


def _addresses(places: Sequence[Numbers]) -> Int64[np.ndarray, " places"]:
    return np.array([place.address for place in places], dtype=np.int64)
