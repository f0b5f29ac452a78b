"""`Batch`: many states of one stack, solved by compiled code on several threads."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from threading import Lock
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int8, Int64

from poise._compiled import (
    Block,
    compiled,
    compiled_for_threads,
    part,
    say_if_slow,
    usable_cores,
    view,
)
from poise.control._command import Commands, CommandStatus
from poise.control._fallback import Fallback
from poise.control._full_problem import FullProblem, answer, fill
from poise.control._state_check import is_usable
from poise.control._strategy import PHYSICS_TOLERANCE
from poise.dynamics import Dynamics, Motion, RobotState
from poise.hqp import LOST, UNSOUND, LexicographicSolver, Work, search
from poise.robots import Robot
from poise.stack import Contact, Owner, Owners, Rows, Stack, evaluate

CHUNK = 16
"""States that a thread takes at a time: Pinocchio's part of them, which one thread does at a time,
ends soon enough for the others, and their numbers stay in the processor's cache."""

UNUSABLE = -1
"""Stands for how the search ended where a state was of no use."""


class Batch:
    """Solves one stack for many states, each by itself, whoever solves the others.

    Pinocchio's part and what is written in Python are done by one thread at a time; all else of a
    chunk of states is one compiled call, during which other threads go on.

    Args:
        robot: the robot.
        stack: contacts, limits and tasks, bound to the robot.
    """

    def __init__(self, robot: Robot, stack: Stack) -> None:
        self._robot, self._stack = robot, stack
        self._lanes: dict[tuple[Contact, ...], list[_Lane]] = {}
        self._sides: dict[tuple[Contact, ...], Int8[np.ndarray, "count nm"]] = {}

    def reset(self) -> None:
        """Forgets the active sets that the next solves would begin with."""
        self._sides.clear()

    def solve(
        self,
        states: Sequence[RobotState],
        threads: int | None,
        before_each: Callable[[int], None] | None,
    ) -> Commands:
        """The commands for some states.

        Args:
            states: the states.
            threads: how many work; as many as there are processors when None.
            before_each: called before a state is taken up, with its number.
        """
        if len(states) and is_usable(states[0], self._robot):
            for contact in self._stack.contacts:
                contact.advance(states[0].time)
        chunks = [slice(i, min(i + CHUNK, len(states))) for i in range(0, len(states), CHUNK)]
        wanted = min(threads or usable_cores(), max(len(chunks), 1))
        lanes = self._lanes_for(self._stack.active_contacts, wanted)
        answers, holding = self._answers_for(len(states), lanes[0]), lanes[0].holding_tasks()
        # Tasks and targets are there only once, so one thread at a time takes states up.
        taking, left = Lock(), iter(chunks)

        def work(lane: _Lane) -> None:
            while True:
                with taking:
                    chunk = next(left, None)
                    if chunk is None:
                        return
                    lane.take(states, chunk, answers, holding, before_each)
                lane.solve(chunk, answers)

        if len(lanes) == 1:
            work(lanes[0])
        else:
            with ThreadPoolExecutor(len(lanes)) as pool:
                # What a thread raises is raised here.
                list(pool.map(work, lanes))
        return self._commands(states, answers, lanes[0])

    def _lanes_for(self, contacts: tuple[Contact, ...], wanted: int) -> "list[_Lane]":
        lanes = self._lanes.setdefault(contacts, [])
        if not lanes:
            say_if_slow(solve_states, "the solver of many states")
        while len(lanes) < wanted:
            lanes.append(_Lane(self._robot, self._stack, contacts))
        return lanes[:wanted]

    def _answers_for(self, count: int, lane: "_Lane") -> "Answers":
        problem, contacts = lane.full.problem, lane.full.rows.contacts
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
        self, states: Sequence[RobotState], answers: "Answers", lane: "_Lane"
    ) -> Commands:
        x, torque, residuals, found = answers.x, answers.torque, answers.residuals, answers.found
        limit, rows, nv = self._stack.torque_limit, lane.full.rows, self._robot.nv
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
            wrenches={
                contact.name: x[:, nv + own.start : nv + own.stop]
                for contact, own in zip(rows.contacts, rows.wrench_slices, strict=True)
            },
            residuals=residuals,
        )


class Answers(NamedTuple):
    """What is found for each state.

    Attributes:
        sides: the active set; the last batch's before.
        x: the point, accelerations before wrenches.
        torque: of the joints [N m].
        residuals: of the levels, relative.
        found: how the search ended.
    """

    sides: Int8[np.ndarray, "count nm"]
    x: Float64[np.ndarray, "count n"]
    torque: Float64[np.ndarray, "count nj"]
    residuals: Float64[np.ndarray, "count levels"]
    found: Int64[np.ndarray, " count"]


class Numbers(Block):
    """Some numbers, wherever they lie."""

    all: Float64[np.ndarray, " _"]


class Program(NamedTuple):
    """All that one thread works on.

    Attributes:
        places: addresses of the `Numbers` that a state brings.
        q: configuration.
        v: velocity.
        motion: what Pinocchio found.
        owners: tasks and contacts.
        rows: where their rows go.
        room: for their formulas.
        M: mass matrix.
        h: nonlinear effects.
        sizes: coordinates of the base, length of all wrenches.
        torques: bounds of the joint torques.
        joints: bounds of the joint accelerations.
        problem: A, bounds and final cost.
        problem_at: address of the problem.
        work_at: address of the search's workspace.
        changes: after how many the search stops.
    """

    places: Int64[np.ndarray, " places"]
    q: Float64[np.ndarray, " nq"]
    v: Float64[np.ndarray, " nv"]
    motion: Motion
    owners: Owners
    rows: Rows
    room: Float64[np.ndarray, " room"]
    M: Float64[np.ndarray, "nv nv"]
    h: Float64[np.ndarray, " nv"]
    sizes: tuple[int, int]
    torques: tuple[Float64[np.ndarray, " nj"], Float64[np.ndarray, " nj"]]
    joints: tuple[Float64[np.ndarray, " nj"], Float64[np.ndarray, " nj"]]
    problem: tuple[
        Float64[np.ndarray, "m n"],
        Float64[np.ndarray, " nm"],
        Float64[np.ndarray, " nm"],
        Float64[np.ndarray, "n n"],
    ]
    problem_at: int
    work_at: int
    changes: int


class _Lane:
    """What one thread needs: dynamics, rows, problem and workspace of its own.

    Args:
        robot: the robot.
        stack: contacts, limits and tasks, bound to the robot.
        contacts: the active contacts.
    """

    def __init__(self, robot: Robot, stack: Stack, contacts: tuple[Contact, ...]) -> None:
        self._robot, self._stack = robot, stack
        self.full = full = FullProblem(robot, stack, contacts)
        self._dynamics, self._solver = Dynamics(robot), LexicographicSolver()
        self._bounds = np.zeros((4, robot.nj))
        evaluation, problem = full.rows.evaluation, full.problem
        ends = np.cumsum([len(owner.parameters) for owner in evaluation.owners])
        own = self._own_numbers()
        # Where a state's numbers are read when it is taken up, and written when it is solved.
        sources = [*own, *(owner.parameters for owner in evaluation.owners)]
        targets = [*own, *np.split(evaluation.inputs.parameters, ends[:-1])]
        self._sources, self._targets = _places(sources), _places(targets)
        self._places = _addresses(self._sources)
        self._packed = np.zeros((CHUNK, sum(map(len, sources))))
        searched, work, changes = self._solver.memory_for(problem)
        self._program = Program(
            _addresses(self._targets),
            self._dynamics.q,
            self._dynamics.v,
            self._dynamics.motion,
            evaluation.inputs,
            evaluation.rows,
            evaluation.work,
            self._dynamics.M,
            self._dynamics.h,
            (robot.base_dofs, full.rows.contact_rows.stop),
            (self._bounds[0], self._bounds[1]),
            (self._bounds[2], self._bounds[3]),
            (problem.A, problem.lower, problem.upper, problem.H),
            searched.address,
            work.address,
            changes,
        )
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
        """Takes a chunk of states up: all that compiled code cannot do.

        Args:
            states: all states.
            chunk: which of them.
            answers: receives which of them are of use.
            holding: tasks that hold what the robot does.
            before_each: called before each, with its number.
        """
        dynamics, joints = self._dynamics, self._stack.joint_limit
        torques = self._stack.torque_limit
        self._bounds[0], self._bounds[1] = torques.lower, torques.upper
        for row, i in enumerate(range(chunk.start, chunk.stop)):
            if before_each is not None:
                before_each(i)
            state = states[i]
            if not is_usable(state, self._robot):
                answers.found[i] = UNUSABLE
                continue
            answers.found[i] = 0
            dynamics.update(state)
            joints.evaluate(dynamics)
            self._bounds[2], self._bounds[3] = joints.lower, joints.upper
            for owner in holding:
                owner.hold(dynamics)
            self.full.rows.update_own(dynamics)
            gather(self._places, self._packed[row])
            for owner in holding:
                owner.reset()

    def solve(self, chunk: slice, answers: Answers) -> None:
        """Solves the states that were taken up last.

        Args:
            chunk: which they are.
            answers: receives what is found.
        """
        own = Answers(*(numbers[chunk] for numbers in answers))
        solve_states(self._packed, self._program, own)

    def _own_numbers(self) -> list[Float64[np.ndarray, " _"]]:
        """Numbers of a state that are written where compiled code reads them."""
        own: list[Float64[np.ndarray, " _"]] = [*self._dynamics.numbers, self._bounds.ravel()]
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
            ]
        return own


@compiled
def gather(places: Int64[np.ndarray, " places"], packed: Float64[np.ndarray, " size"]) -> None:
    """Copies numbers from where they lie into one row.

    Args:
        places: addresses of `Numbers`.
        packed: receives them.
    """
    at = 0
    for place in places:
        numbers = view(Numbers, place).all
        for k in range(len(numbers)):
            packed[at + k] = numbers[k]
        at += len(numbers)


@part
def _scatter(packed: Float64[np.ndarray, " size"], places: Int64[np.ndarray, " places"]) -> None:
    """Copies them to other places."""
    at = 0
    for place in places:
        numbers = view(Numbers, place).all
        for k in range(len(numbers)):
            numbers[k] = packed[at + k]
        at += len(numbers)


@compiled_for_threads
def solve_states(
    packed: Float64[np.ndarray, "chunk size"], program: Program, answers: Answers
) -> None:
    """Solves some states, each by itself.

    Args:
        packed: numbers of each state.
        program: what they are solved with.
        answers: receives what is found; states that are of no use are left out.
    """
    work = view(Work, program.work_at)
    x, side = work.points.x, work.rows.side
    torques, joints, problem, p = program.torques, program.joints, program.problem, program
    for i in range(len(answers.found)):
        if answers.found[i] == UNUSABLE:
            continue
        _scatter(packed[i], p.places)
        evaluate(p.q, p.v, p.motion, p.owners, p.rows, False, p.room)
        fill(p.M, p.h, p.sizes, torques, joints, problem)
        _begin(work, answers.sides[i])
        found = search(p.problem_at, p.work_at, p.changes)
        answers.found[i] = found
        for k in range(len(side)):
            answers.sides[i, k] = side[k] if found != UNSOUND and found != LOST else 0
        answer(x, problem[0], p.h, answers.x[i], answers.torque[i])
        for k in range(len(work.answer.relative)):
            answers.residuals[i, k] = work.answer.relative[k]


@part
def _begin(work: Work, sides: Int8[np.ndarray, " nm"]) -> None:
    """Has the next search begin with an active set, and with nothing else of the last state."""
    rows = work.rows
    work.state.begun = 0
    for k in range(len(work.points.x)):
        work.points.x[k] = 0.0
    for k in range(len(sides)):
        rows.side[k] = sides[k]
        rows.sign_free[k] = rows.locked[k] = rows.needed_by[k] = rows.factored[k] = 0


def _no_answers() -> Answers:
    matrix = np.zeros((0, 0))
    sides, found = np.zeros((0, 0), dtype=np.int8), np.zeros(0, dtype=np.int64)
    return Answers(sides, matrix, matrix, matrix, found)


def _places(numbers: Sequence[Float64[np.ndarray, " _"]]) -> list[Numbers]:
    return [Numbers(all=array) for array in numbers]


def _addresses(places: Sequence[Numbers]) -> Int64[np.ndarray, " places"]:
    return np.array([place.address for place in places], dtype=np.int64)
