"""`solve_states`: the states of a chunk, one after the other, by one compiled call."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float64, Int8, Int64

from poise._compiled import Block, compiled, compiled_for_threads, part, view
from poise.control._full_problem import answer, fill
from poise.dynamics import Motion
from poise.hqp import LOST, UNSOUND, Work, search
from poise.stack import (
    Owners,
    Rows,
    SettlingRoom,
    Viability,
    bound_settling,
    evaluate,
    find_softening,
)

UNUSABLE = -1
"""Stands for how the search ended where a state was of no use."""


class Answers(NamedTuple):
    """What is found for each state.

    Attributes:
        sides: the active set; the last batch's before.
        x: the point, accelerations before wrenches.
        torque: of the joints [N m].
        residuals: of the levels, relative.
        found: how the search ended.
        strain: largest change that a softening term can make to its level.
    """

    sides: Int8[np.ndarray, "count nm"]
    x: Float64[np.ndarray, "count n"]
    torque: Float64[np.ndarray, "count nj"]
    residuals: Float64[np.ndarray, "count levels"]
    found: Int64[np.ndarray, " count"]
    strain: Float64[np.ndarray, " count"]


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
        sizes: of the problem, as `FullProblem` says them.
        torques: bounds of the joint torques.
        joints: bounds of the joint accelerations.
        viability: what they are made from.
        settling: room for those beside contacts that move.
        problem: A, bounds and final cost.
        problem_at: address of the problem.
        work_at: address of the search's workspace.
        changes: after how many the search stops.
        terms_at: address of the softening terms.
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
    viability: Viability
    settling: SettlingRoom
    problem: tuple[
        Float64[np.ndarray, "m n"],
        Float64[np.ndarray, " nm"],
        Float64[np.ndarray, " nm"],
        Float64[np.ndarray, "n n"],
    ]
    problem_at: int
    work_at: int
    changes: int
    terms_at: int


@compiled
def gather(places: Int64[np.ndarray, " places"], packed: Float64[np.ndarray, " size"]) -> None:
    """Copies numbers from where they lie into one row."""
    at = 0
    for place in places:
        numbers = view(Numbers, place).all
        for k in range(len(numbers)):
            packed[at + k] = numbers[k]
        at += len(numbers)


@compiled_for_threads
def solve_states(
    packed: Float64[np.ndarray, "chunk size"], program: Program, answers: Answers
) -> None:
    """Solves some states, each by itself."""
    work = view(Work, program.work_at)
    x, side = work.points.x, work.rows.side
    torques, joints, problem, p = program.torques, program.joints, program.problem, program
    for i in range(len(answers.found)):
        if answers.found[i] == UNUSABLE:
            continue
        _scatter(packed[i], p.places)
        evaluate(p.q, p.v, p.motion, p.owners, p.rows, False, p.room)
        bound_settling(p.q, p.v, p.owners, p.rows, p.viability, p.settling, joints[0], joints[1])
        fill(p.M, p.h, p.sizes, torques, joints, problem)
        _begin(work, answers.sides[i])
        found = search(p.problem_at, p.work_at, p.changes)
        answers.found[i] = found
        for k in range(len(side)):
            answers.sides[i, k] = side[k] if found != UNSOUND and found != LOST else 0
        answer(x, problem[0], p.h, answers.x[i], answers.torque[i])
        for k in range(len(work.answer.relative)):
            answers.residuals[i, k] = work.answer.relative[k]
        answers.strain[i] = find_softening(p.terms_at, p.v, x, p.sizes[0])


@part
def _scatter(packed: Float64[np.ndarray, " size"], places: Int64[np.ndarray, " places"]) -> None:
    """Copies them to other places."""
    at = 0
    for place in places:
        numbers = view(Numbers, place).all
        for k in range(len(numbers)):
            numbers[k] = packed[at + k]
        at += len(numbers)


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
