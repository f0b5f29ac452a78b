"""`Batch`: many states of one stack, solved by compiled code on several threads.

`solve_states`: the states of a chunk, one after the other, by one compiled call.
"""

from collections.abc import Callable, Sequence
from threading import Lock
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int8, Int64

from poise._compiled import (
    MemoryBlock,
    address_of,
    call_at,
    compiled,
    compiled_for_threads,
    part,
    usable_cores,
    view,
)
from poise.control._command import Commands, CommandStatus
from poise.control._fallback import Fallback, is_usable
from poise.control._full_problem import FullNumbers, FullProblem, SoftenedFull, answer, fill
from poise.control._strategy import PHYSICS_TOLERANCE, UNSOFTENED
from poise.dynamics import Dynamics, RobotState, StateNumbers
from poise.hqp import (
    LOST,
    UNSOUND,
    LexicographicSolver,
    SearchWork,
    SofteningProgram,
    begin_with,
    search,
    search_softened,
)
from poise.robots import Robot
from poise.stack import Contact, Numbers, Owner, Stack, evaluate, find_softening

UNUSABLE = -1
"""End of the search of a state that cannot be used."""


class Answers(NamedTuple):
    """Results for each state."""

    sides: Int8[np.ndarray, "count nm"]  # the active set, at first that of the last batch
    x: Float64[np.ndarray, "count n"]  # accelerations, then wrenches
    torque: Float64[np.ndarray, "count nj"]  # of the joints [N m]
    residuals: Float64[np.ndarray, "count levels"]  # of the levels, relative
    found: Int64[np.ndarray, " count"]  # end of the search


class BatchProgram(MemoryBlock):
    """Addresses of the memory of one thread."""

    places: Int64[np.ndarray, " places"]  # of the `Numbers` that a state brings
    state: int
    assembly: int
    settling: int
    full: int
    problem: int
    work: int
    changes: int  # most changes of the active set
    terms: int  # of softening
    softening: int
    evaluate: int  # machine code of what a tick calls, which is not compiled again for the loop
    fill: int
    search: int
    soften: int
    answer: int


@compiled
def gather(places: Int64[np.ndarray, " places"], packed: Float64[np.ndarray, " size"]) -> None:
    """Copy numbers from their places into one row."""
    at = 0
    for place in places:
        numbers = view(Numbers, place).all
        for k in range(len(numbers)):
            packed[at + k] = numbers[k]
        at += len(numbers)


@compiled_for_threads
def solve_states(
    packed: Float64[np.ndarray, "chunk size"], program_at: int, answers: Answers
) -> None:
    """Solve some states, each by itself."""
    program = view(BatchProgram, program_at)
    work, full = view(SearchWork, program.work), view(FullNumbers, program.full)
    x, side, v = work.points.x, work.rows.side, view(StateNumbers, program.state).v
    for i in range(len(answers.found)):
        if answers.found[i] == UNUSABLE:
            continue
        _scatter(packed[i], program.places)
        settling, state = program.settling, program.state
        call_at(program.evaluate, evaluate, program.assembly, settling, state, False)
        call_at(program.fill, fill, program.full, state)
        begin_with(work, answers.sides[i])
        found = call_at(program.search, search, program.problem, program.work, program.changes)
        usable = found not in (UNSOUND, LOST)
        for k in range(len(side)):
            answers.sides[i, k] = side[k] if usable else 0
        if usable and not find_softening(program.terms, v, x, full.base) <= UNSOFTENED:
            # Nothing of the last state.
            view(SofteningProgram, program.softening).soft[:] = 0
            found = call_at(program.soften, search_softened, program.softening, found)
        answers.found[i] = found
        for k in range(len(x)):
            answers.x[i, k] = full.point[k] = x[k]
        call_at(program.answer, answer, program.full, state)
        for k in range(len(full.torque)):
            answers.torque[i, k] = full.torque[k]
        for k in range(len(work.answer.relative)):
            answers.residuals[i, k] = work.answer.relative[k]


@part
def _scatter(packed: Float64[np.ndarray, " size"], places: Int64[np.ndarray, " places"]) -> None:
    """Copy them to other places."""
    at = 0
    for place in places:
        numbers = view(Numbers, place).all
        for k in range(len(numbers)):
            numbers[k] = packed[at + k]
        at += len(numbers)


_CHUNK = 16
"""States that a thread takes at a time: few enough that the others do not wait for its part of
Pinocchio's work, and that their numbers stay in the processor's cache."""


class _BatchWorker:
    """Dynamics, rows, problem and workspace of one thread."""

    def __init__(self, robot: Robot, stack: Stack, contacts: tuple[Contact, ...]) -> None:
        self._robot, self._stack = robot, stack
        self.full = full = FullProblem(robot, stack, contacts)
        self._dynamics = Dynamics(robot)
        self._solver = solver = SoftenedFull(full, LexicographicSolver)
        softening = solver.program
        assert softening is not None
        self._torques, joints = np.zeros((2, robot.nj)), np.zeros((2, robot.nj))
        evaluation, own = full.rows.evaluation, self._own_numbers()
        # A state's numbers are read here when it is taken up, and written when it is solved.
        sources = [*own, *(owner.parameters for owner in evaluation.owners)]
        targets = [*own, *(np.empty_like(owner.parameters) for owner in evaluation.owners)]
        self._sources, self._targets = _places(sources), _places(targets)
        self._places = _addresses(self._sources)
        evaluation.inputs.places[:] = _addresses(self._targets[len(own) :])
        self._packed = np.zeros((_CHUNK, sum(map(len, sources))))
        # Bounds of its own, which no other thread writes.
        self._numbers = full.numbers_with(
            (self._torques[0], self._torques[1]), (joints[0], joints[1])
        )
        self._settling = stack.joint_limit.settling(joints[0], joints[1])
        self._program = BatchProgram(
            places=_addresses(self._targets),
            state=self._dynamics.numbers.address,
            assembly=evaluation.assembly.address,
            settling=self._settling.address,
            full=self._numbers.address,
            problem=softening.problem,
            work=softening.work,
            changes=softening.changes,
            terms=full.rows.softening.terms.address,
            softening=softening.address,
            evaluate=address_of(evaluate),
            fill=address_of(fill),
            search=address_of(search),
            soften=address_of(search_softened),
            answer=address_of(answer),
        )
        # What is compiled is compiled now, for the first batch may have no state of use.
        gather(self._places, self._packed[0])
        self.solve(slice(0, 0), _no_answers())

    def holding_tasks(self) -> list[Owner]:
        """Return the tasks without a target, whose target is the value at each state."""
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
        """Take a chunk of states up: the part that is not compiled."""
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
            self.full.rows.evaluation.update_own(dynamics)
            gather(self._places, self._packed[row])
            for owner in holding:
                owner.reset()

    def solve(self, chunk: slice, answers: Answers) -> None:
        """Solve the states of the current chunk."""
        own = Answers(*(numbers[chunk] for numbers in answers))
        solve_states(self._packed, self._program.address, own)

    def _own_numbers(self) -> list[Float64[np.ndarray, " _"]]:
        """Return the numbers of a state that compiled code reads in place."""
        own: list[Float64[np.ndarray, " _"]] = [
            *self._dynamics.moving_numbers,
            self._torques.ravel(),
        ]
        evaluation, nv = self.full.rows.evaluation, self._robot.nv
        rows = evaluation.rows
        for _, place in evaluation.own:
            matrix = rows.matrix[rows.first + place.start : rows.first + place.stop]
            own += [row[:nv] for row in matrix]
            found = rows.drift, rows.fade, rows.error, rows.error_rate, rows.feedforward
            own += [numbers[place] for numbers in found]
        return own


def _no_answers() -> Answers:
    matrix = np.zeros((0, 0))
    sides, found = np.zeros((0, 0), dtype=np.int8), np.zeros(0, dtype=np.int64)
    return Answers(sides, matrix, matrix, matrix, found)


def _places(numbers: Sequence[Float64[np.ndarray, " _"]]) -> list[Numbers]:
    return [Numbers(all=array) for array in numbers]


def _addresses(places: Sequence[Numbers]) -> Int64[np.ndarray, " places"]:
    return np.array([place.address for place in places], dtype=np.int64)


class Batch:
    """Solve one stack for many states, each by itself.

    Pinocchio and Python run in one thread at a time; all else of a chunk of states is one compiled
    call, during which other threads go on.
    """

    def __init__(self, robot: Robot, stack: Stack) -> None:
        self._robot, self._stack = robot, stack
        self._workers: dict[tuple[Contact, ...], list[_BatchWorker]] = {}
        self._sides: dict[tuple[Contact, ...], Int8[np.ndarray, "count nm"]] = {}

    def reset(self) -> None:
        """Forget the active sets that the next solves would begin with."""
        self._sides.clear()

    def solve(
        self,
        states: Sequence[RobotState],
        threads: int | None,
        before_each: Callable[[int], None] | None,
    ) -> Commands:
        """Return the commands for some states."""
        first = next((state for state in states if is_usable(state, self._robot)), None)
        if first is not None:
            for contact in self._stack.contacts:
                contact.advance(first.time)
        chunks = [slice(i, min(i + _CHUNK, len(states))) for i in range(0, len(states), _CHUNK)]
        wanted = min(threads or usable_cores(), max(len(chunks), 1))
        workers = self._workers_for(self._stack.active_contacts, wanted)
        answers, holding = self._answers_for(len(states), workers[0]), workers[0].holding_tasks()
        # Threads share tasks and targets, so one at a time takes states up.
        taking, left = Lock(), iter(chunks)

        def work(worker: _BatchWorker) -> None:
            while True:
                with taking:
                    chunk = next(left, None)
                    if chunk is None:
                        return
                    worker.take(states, chunk, answers, holding, before_each)
                worker.solve(chunk, answers)

        if len(workers) == 1:
            work(workers[0])
        else:
            # A controller alone needs no threads.
            from concurrent.futures import ThreadPoolExecutor

            with ThreadPoolExecutor(len(workers)) as pool:
                # Errors of a thread are raised here.
                list(pool.map(work, workers))
        return self._commands(states, answers, workers[0])

    def _workers_for(self, contacts: tuple[Contact, ...], wanted: int) -> list[_BatchWorker]:
        workers = self._workers.setdefault(contacts, [])
        while len(workers) < wanted:
            workers.append(_BatchWorker(self._robot, self._stack, contacts))
        return workers[:wanted]

    def _answers_for(self, count: int, worker: _BatchWorker) -> Answers:
        problem, contacts = worker.full.problem, worker.full.rows.contacts
        size = problem.n + problem.m
        sides = self._sides.get(contacts)
        if sides is None or len(sides) != count:
            sides = self._sides[contacts] = np.zeros((count, size), dtype=np.int8)
        return Answers(
            sides,
            np.zeros((count, problem.n)),
            np.zeros((count, self._robot.nj)),
            np.zeros((count, len(problem.levels))),
            np.full(count, UNUSABLE),
        )

    def _commands(
        self, states: Sequence[RobotState], answers: Answers, worker: _BatchWorker
    ) -> Commands:
        x, torque, residuals, found = answers.x, answers.torque, answers.residuals, answers.found
        limit, nv = self._stack.torque_limit, self._robot.nv
        solved = ~np.isin(found, (UNUSABLE, UNSOUND, LOST))
        good = solved & (residuals[:, 0] <= PHYSICS_TOLERANCE) & np.isfinite(torque).all(axis=1)
        np.clip(torque, limit.lower, limit.upper, out=torque)
        statuses = np.full(len(states), CommandStatus.OK)
        statuses[~good] = CommandStatus.SOLVER_FAILED
        statuses[found == UNUSABLE] = CommandStatus.BAD_STATE
        x[~good], residuals[~good] = np.nan, np.nan
        fallback = Fallback.of_torque(self._robot, limit)
        for i in np.flatnonzero(~good).tolist():
            fallback.reset()
            torque[i] = fallback.command(states[i])
        return Commands(
            statuses=tuple(statuses),
            torque=torque,
            acceleration=x[:, :nv],
            wrenches={name: wrench.T for name, wrench in worker.full.wrenches(x.T).items()},
            residuals=np.delete(residuals, worker.full.unnumbered, axis=1),
        )
