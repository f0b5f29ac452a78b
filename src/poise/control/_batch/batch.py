"""`Batch`: many states of one stack, solved by compiled code on several threads."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from threading import Lock

import numpy as np
from jaxtyping import Int8

from poise._compiled import say_if_slow, usable_cores
from poise.control._batch.lane import CHUNK, Lane
from poise.control._batch.loop import UNUSABLE, Answers, solve_states
from poise.control._command import Commands, CommandStatus
from poise.control._fallback import Fallback
from poise.control._state_check import is_usable
from poise.control._strategy import PHYSICS_TOLERANCE
from poise.dynamics import RobotState
from poise.hqp import LOST, UNSOUND
from poise.robots import Robot
from poise.stack import Contact, Stack


class Batch:
    """Solves one stack for many states, each by itself, whoever solves the others.

    Pinocchio's part and what is written in Python are done by one thread at a time; all else of a
    chunk of states is one compiled call, during which other threads go on.
    """

    def __init__(self, robot: Robot, stack: Stack) -> None:
        self._robot, self._stack = robot, stack
        self._lanes: dict[tuple[Contact, ...], list[Lane]] = {}
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
        """The commands for some states."""
        first = next((state for state in states if is_usable(state, self._robot)), None)
        if first is not None:
            for contact in self._stack.contacts:
                contact.advance(first.time)
        chunks = [slice(i, min(i + CHUNK, len(states))) for i in range(0, len(states), CHUNK)]
        wanted = min(threads or usable_cores(), max(len(chunks), 1))
        lanes = self._lanes_for(self._stack.active_contacts, wanted)
        answers, holding = self._answers_for(len(states), lanes[0]), lanes[0].holding_tasks()
        # Tasks and targets are there only once, so one thread at a time takes states up.
        taking, left = Lock(), iter(chunks)

        def work(lane: Lane) -> None:
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

    def _lanes_for(self, contacts: tuple[Contact, ...], wanted: int) -> list[Lane]:
        lanes = self._lanes.setdefault(contacts, [])
        if not lanes:
            say_if_slow(solve_states, "the solver of many states")
        while len(lanes) < wanted:
            lanes.append(Lane(self._robot, self._stack, contacts))
        return lanes[:wanted]

    def _answers_for(self, count: int, lane: Lane) -> Answers:
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
            np.zeros(count),
        )

    def _commands(self, states: Sequence[RobotState], answers: Answers, lane: Lane) -> Commands:
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
            residuals=lane.full.levels_with_numbers(residuals),
        )
