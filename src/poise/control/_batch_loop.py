"""`solve_states`: the states of a chunk, one after the other, by one compiled call."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int8, Int64

from poise._compiled import MemoryBlock, compiled, compiled_for_threads, part, view
from poise.control._full_problem import FullNumbers, answer, fill
from poise.dynamics import StateNumbers
from poise.hqp import LOST, UNSOUND, SearchWork, search
from poise.stack import Numbers, evaluate, find_softening

UNUSABLE = -1
"""End of the search of a state that cannot be used."""


class Answers(NamedTuple):
    """Results for each state."""

    sides: Int8[np.ndarray, "count nm"]  # the active set, at first that of the last batch
    x: Float64[np.ndarray, "count n"]  # accelerations, then wrenches
    torque: Float64[np.ndarray, "count nj"]  # of the joints [N m]
    residuals: Float64[np.ndarray, "count levels"]  # of the levels, relative
    found: Int64[np.ndarray, " count"]  # end of the search
    strain: Float64[np.ndarray, " count"]  # largest change of a level by its softening term


class LaneProgram(MemoryBlock):
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
    program = view(LaneProgram, program_at)
    work, full = view(SearchWork, program.work), view(FullNumbers, program.full)
    x, side, v = work.points.x, work.rows.side, view(StateNumbers, program.state).v
    for i in range(len(answers.found)):
        if answers.found[i] == UNUSABLE:
            continue
        _scatter(packed[i], program.places)
        evaluate(program.assembly, program.settling, program.state, False)
        fill(program.full, program.state)
        _begin(work, answers.sides[i])
        found = search(program.problem, program.work, program.changes)
        answers.found[i] = found
        for k in range(len(side)):
            answers.sides[i, k] = side[k] if found != UNSOUND and found != LOST else 0
        for k in range(len(x)):
            answers.x[i, k] = full.point[k] = x[k]
        answer(program.full, program.state)
        for k in range(len(full.torque)):
            answers.torque[i, k] = full.torque[k]
        for k in range(len(work.answer.relative)):
            answers.residuals[i, k] = work.answer.relative[k]
        answers.strain[i] = find_softening(program.terms, v, x, full.base)


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
