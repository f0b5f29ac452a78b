"""`Batch`: many states of one stack, solved by compiled code on several threads.

`solve_states`: the states of a chunk, one after the other, by one compiled call.
"""

from collections.abc import Callable, Sequence
from itertools import chain
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
from poise.control._strategy import PHYSICS_TOLERANCE, UNSOFTENED, USABLE
from poise.dynamics import Dynamics, RobotState, StateNumbers
from poise.hqp import LOST, UNSOUND, LexicographicSolver, SearchWork, search
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
    evaluate: int  # machine code of what a tick calls, which is not compiled again for the loop
    fill: int
    search: int
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
    packed: Float64[np.ndarray, "chunk size"], program_at: int, first: int, answers: Answers
) -> int:
    """Solve states from `first` on, each by itself; return the first to soften, or their number."""
    program = view(BatchProgram, program_at)
    work, full = view(SearchWork, program.work), view(FullNumbers, program.full)
    x, side, v = work.points.x, work.rows.side, view(StateNumbers, program.state).v
    for i in range(first, len(answers.found)):
        if answers.found[i] == UNUSABLE:
            continue
        _scatter(packed[i], program.places)
        settling, state = program.settling, program.state
        call_at(program.evaluate, evaluate, program.assembly, settling, state, False)
        call_at(program.fill, fill, program.full, state)
        _begin(work, answers.sides[i])
        found = call_at(program.search, search, program.problem, program.work, program.changes)
        answers.found[i] = found
        for k in range(len(side)):
            answers.sides[i, k] = side[k] if found != UNSOUND and found != LOST else 0
        for k in range(len(x)):
            answers.x[i, k] = full.point[k] = x[k]
        call_at(program.answer, answer, program.full, state)
        for k in range(len(full.torque)):
            answers.torque[i, k] = full.torque[k]
        for k in range(len(work.answer.relative)):
            answers.residuals[i, k] = work.answer.relative[k]
        strain = find_softening(program.terms, v, x, full.base)
        if found != UNSOUND and found != LOST and not strain <= UNSOFTENED:
            return i
    return len(answers.found)


@compiled_for_threads
def search_in_thread(code: int, problem_at: int, work_at: int, changes: int) -> int:
    """Search, while other threads run."""
    return call_at(code, search, problem_at, work_at, changes)


class _ThreadSolver(LexicographicSolver):
    def _search(self, changes: int) -> int:
        at = self._problem.address, self._work.address
        return search_in_thread(address_of(search), *at, changes)


@part
def _scatter(packed: Float64[np.ndarray, " size"], places: Int64[np.ndarray, " places"]) -> None:
    """Copy them to other places."""
    at = 0
    for place in places:
        numbers = view(Numbers, place).all
        for k in range(len(numbers)):
            numbers[k] = packed[at + k]
        at += len(numbers)


@part
def _begin(work: SearchWork, sides: Int8[np.ndarray, " nm"]) -> None:
    """Begin the next search with an active set, and with nothing else of the last state."""
    rows = work.rows
    work.state.begun = 0
    for k in range(len(work.points.x)):
        work.points.x[k] = 0.0
    for k in range(len(sides)):
        rows.side[k] = sides[k]
        rows.sign_free[k] = rows.locked[k] = rows.needed_by[k] = rows.factored[k] = 0


_CHUNK = 16
"""States that a thread takes at a time: few enough that the others do not wait for its part of
Pinocchio's work, and that their numbers stay in the processor's cache."""


class _BatchWorker:
    """Dynamics, rows, problem and workspace of one thread."""

    def __init__(self, robot: Robot, stack: Stack, contacts: tuple[Contact, ...]) -> None:
        self._robot, self._stack = robot, stack
        self.full = full = FullProblem(robot, stack, contacts)
        self._dynamics, self._solver = Dynamics(robot), _ThreadSolver()
        self._torques, joints = np.zeros((2, robot.nj)), np.zeros((2, robot.nj))
        evaluation, own = full.rows.evaluation, self._own_numbers()
        # A state's numbers are read here when it is taken up, and written when it is solved.
        sources = [*own, *(owner.parameters for owner in evaluation.owners)]
        targets = [*own, *(np.empty_like(owner.parameters) for owner in evaluation.owners)]
        self._sources, self._targets = _places(sources), _places(targets)
        self._places = _addresses(self._sources)
        evaluation.inputs.places[:] = _addresses(self._targets[len(own) :])
        self._packed = np.zeros((_CHUNK, sum(map(len, sources))))
        searched, work, changes = self._solver.memory_for(full.problem)
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
            problem=searched.address,
            work=work.address,
            changes=changes,
            terms=full.rows.softening.terms.address,
            evaluate=address_of(evaluate),
            fill=address_of(fill),
            search=address_of(search),
            answer=address_of(answer),
        )
        solvers = chain([self._solver], iter(_ThreadSolver, None))
        self._softened = SoftenedFull(full, lambda: next(solvers))
        # What is compiled is compiled now, for the first batch may have no state of use.
        gather(self._places, self._packed[0])
        self.solve(slice(0, 0), _no_answers())
        self._softened.soften()

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
        at, count = 0, len(own.found)
        while (at := solve_states(self._packed, self._program.address, at, own)) < count:
            self._soften(Answers(*(numbers[at : at + 1] for numbers in own)))
            at += 1

    def _soften(self, own: Answers) -> None:
        """Solve the state that the compiled loop stopped at again, with its levels softened."""
        solver = self._softened
        self.full.velocity = self._dynamics.v
        if solver.soften() not in USABLE:
            return
        own.residuals[0] = solver.relative_residuals
        own.x[0], own.torque[0], _ = self.full.answer(solver.x, self._dynamics)

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
