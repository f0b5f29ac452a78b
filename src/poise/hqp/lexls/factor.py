"""The factorisation of the active rows, level by level, by reflections of the free coordinates.

With x = Q y, each level's rows become a trapezoid in y: zero to the right of the coordinates that
it and the levels above it take. So the levels can be solved one after the other, and what a level
does with its own coordinates leaves those above untouched.
"""

from poise._compiled import part
from poise.hqp.lexls.reflections import length_of, reflect_rows, turn_row
from poise.hqp.lexls.tolerances import RANK_TOLERANCE
from poise.hqp.lexls.workspace import Problem, Work

_CANCELLED = 1e-5
"""Squares that became smaller than this by subtraction are computed anew."""


@part
def factor_level(problem: Problem, work: Work, level: int) -> None:
    """Turns the coordinates that the levels above have left so that a level's rows are a trapezoid.

    Args:
        problem: the problem.
        work: receives the level's rows, their order, and its rank.
        level: whose rows; those of the levels above are factored.
    """
    n = len(work.x)
    begin, first = work.begin[level], work.first[level]
    firm = _gather(problem, work, level, begin, 1)
    end = _gather(problem, work, level, firm, 0)
    work.begin[level + 1] = end
    for k in range(first):
        reflect_rows(work.R, begin, end, k, work.V[k, k:], work.tau[k])
    for row in range(begin, end):
        square = length_of(work.R[row, first:]) / work.size[row] if work.size[row] > 0.0 else 0.0
        work.left[row] = work.kept[row] = square * square
    column, pivot = first, begin
    # Rows that may push either way come first, so that no other row has to push for them.
    for stop in (firm, end):
        while pivot < stop and column < n:
            best, most = pivot, 0.0
            for row in range(pivot, stop):
                # Large rows first, so that the others are combinations with small coefficients.
                worth = work.left[row] * work.size[row]
                if worth > most and work.left[row] > RANK_TOLERANCE * RANK_TOLERANCE:
                    best, most = row, worth
            if not most > 0.0:
                break
            if best != pivot:
                _swap(work, best, pivot)
            v = work.V[column, column:]
            tail = work.R[pivot, column:]
            tau = turn_row(tail, v, length_of(tail))
            work.tau[column] = tau
            reflect_rows(work.R, pivot + 1, end, column, v, tau)
            column += 1
            pivot += 1
            _update_left(work, pivot, end, column)
    work.rank[level] = column - first
    work.first[level + 1] = column


@part
def _gather(problem: Problem, work: Work, level: int, place: int, firm: int) -> int:
    """Copies a level's active rows, times their weights; returns where the next ones go."""
    n = len(work.x)
    if problem.bounds_level == level:
        for i in range(n):
            if work.side[i] != 0 and work.firm[i] == firm:
                work.R[place, :] = 0.0
                work.R[place, i] = problem.weights[i]
                place = _enter(problem, work, i, place)
    for i in range(problem.starts[level], problem.starts[level + 1]):
        if work.side[n + i] != 0 and work.firm[n + i] == firm:
            weight = problem.weights[n + i]
            source, row = problem.A[i], work.R[place]
            for j in range(n):
                row[j] = source[j] * weight
            place = _enter(problem, work, n + i, place)
    return place


@part
def _enter(problem: Problem, work: Work, index: int, place: int) -> int:
    """Notes which row stands at a place; returns the next place."""
    weight = problem.weights[index]
    bound = problem.upper[index] if work.side[index] > 0 else problem.lower[index]
    work.order[place] = index
    work.bound[place] = (bound + work.shift[index]) * weight
    work.size[place] = work.norms[index] * weight
    return place + 1


@part
def _swap(work: Work, a: int, b: int) -> None:
    """Lets two active rows of a level change places."""
    row_a, row_b = work.R[a], work.R[b]
    for j in range(len(row_a)):
        row_a[j], row_b[j] = row_b[j], row_a[j]
    work.order[a], work.order[b] = work.order[b], work.order[a]
    work.bound[a], work.bound[b] = work.bound[b], work.bound[a]
    work.size[a], work.size[b] = work.size[b], work.size[a]
    work.left[a], work.left[b] = work.left[b], work.left[a]
    work.kept[a], work.kept[b] = work.kept[b], work.kept[a]


@part
def _update_left(work: Work, begin: int, end: int, column: int) -> None:
    """Takes what the last pivot saw of each row out of what is left of it."""
    for row in range(begin, end):
        size = work.size[row]
        if not size > 0.0:
            continue
        seen = work.R[row, column - 1] / size
        left = work.left[row] - seen * seen
        if left < _CANCELLED * work.kept[row]:
            share = length_of(work.R[row, column:]) / size
            left = share * share
            work.kept[row] = left
        work.left[row] = left
