"""What a point amounts to, and whether the search may be believed: on the problem's own numbers."""

from math import sqrt

import numpy as np

from poise._compiled import part
from poise.hqp.lexls.combinations import add_rows
from poise.hqp.lexls.reflections import length_of
from poise.hqp.lexls.tolerances import OPTIMALITY_TOLERANCE, SAME_TOLERANCE, SLACK_TOLERANCE
from poise.hqp.lexls.workspace import DOUBT, Problem, Work


@part
def find_values(problem: Problem, x: np.ndarray, values: np.ndarray) -> None:
    """Values of all bounds and rows at a point.

    Args:
        problem: the problem.
        x: the point.
        values: receives them.
    """
    n = len(x)
    for i in range(n):
        values[i] = x[i]
    for i in range(len(problem.A)):
        row, total = problem.A[i], 0.0
        for j in range(n):
            total += row[j] * x[j]
        values[n + i] = total


@part
def residual_of(problem: Problem, values: np.ndarray, level: int) -> float:
    """`|W w|` of a level.

    Args:
        problem: the problem.
        values: of all bounds and rows.
        level: which.
    """
    n, square = len(problem.g), 0.0
    if problem.bounds_level == level:
        for i in range(n):
            square += _square(_slack(problem, values, i) * problem.weights[i])
    for i in range(n + problem.starts[level], n + problem.starts[level + 1]):
        square += _square(_slack(problem, values, i) * problem.weights[i])
    return sqrt(square)


@part
def _slack(problem: Problem, values: np.ndarray, i: int) -> float:
    return max(values[i] - problem.upper[i], 0.0) - max(problem.lower[i] - values[i], 0.0)


@part
def measure(problem: Problem, work: Work) -> bool:
    """Slacks of all rows, residuals of all levels; returns whether all that was found is finite."""
    n, levels = len(work.x), len(work.residuals)
    total = 0.0
    for j in range(n):
        total += abs(work.x[j])
    for i in range(len(work.values)):
        work.slacks[i] = _slack(problem, work.values, i)
        total += abs(work.slacks[i])
        for level in range(levels + 1):
            total += abs(work.multipliers[level, i])
    for level in range(levels):
        scale = 0.0
        if problem.bounds_level == level:
            for i in range(n):
                scale += _square(_least(problem, i) * problem.weights[i])
        for i in range(n + problem.starts[level], n + problem.starts[level + 1]):
            scale += _square(_least(problem, i) * problem.weights[i])
        work.residuals[level] = residual_of(problem, work.values, level)
        work.relative[level] = work.residuals[level] / max(sqrt(scale), 1.0)
        total += work.residuals[level]
    return bool(total < np.inf)


@part
def _square(number: float) -> float:
    return number * number


@part
def _least(problem: Problem, i: int) -> float:
    """Slack of a row at x = 0."""
    return max(problem.lower[i], 0.0) + max(-problem.upper[i], 0.0)


@part
def check(problem: Problem, work: Work) -> None:
    """Checks the optimum that the search claims, on the problem's own rows.

    Args:
        problem: the problem.
        work: whose `errors` are found.
    """
    work.errors[0], work.errors[1] = _row_error(problem, work), 0.0
    levels = len(work.rank)
    for level in range(levels):
        if work.begin[level] < work.begin[level + 1]:
            work.force[:] = 0.0
            work.errors[1] = max(work.errors[1], _imbalance(problem, work, level, 0.0))
    size = 0.0
    for i in range(len(work.hx)):
        work.force[i] = work.hx[i]
        size = max(size, abs(problem.g[i]), abs(problem.H[i, i]) * _reach(work))
    work.errors[1] = max(work.errors[1], _imbalance(problem, work, levels, size))


@part
def is_better(problem: Problem, work: Work) -> bool:
    """Whether the target meets the levels better than the point, or as well."""
    n, reach = len(problem.g), max(length_of(work.x), length_of(work.target))
    for level in range(len(work.rank)):
        old = residual_of(problem, work.values, level)
        new = residual_of(problem, work.goal, level)
        size = 0.0
        for i in range(n if problem.bounds_level == level else 0):
            size = max(size, problem.weights[i])
        for i in range(n + problem.starts[level], n + problem.starts[level + 1]):
            size = max(size, work.norms[i] * problem.weights[i])
        # A level that both meet is met to rounding. Written so that what is no number is no better.
        room = max(SAME_TOLERANCE * max(old, new), SLACK_TOLERANCE * size * reach)
        if not abs(old - new) <= room:
            return bool(new < old)
    return True


@part
def is_sound(work: Work) -> bool:
    """Whether what `check` found lets the search be believed, and no row was kept that pulls."""
    error = max(work.errors[0], work.errors[1])
    return bool(error <= OPTIMALITY_TOLERANCE and work.state[DOUBT] == 0)


@part
def _row_error(problem: Problem, work: Work) -> float:
    """How far rows are from where they should be, relatively; inactive ones inside their bounds."""
    worst, size = 0.0, _reach(work)
    for i in range(len(work.slacks)):
        work.slacks[i] = 1.0
    for place in range(work.begin[len(work.rank)]):
        index = work.order[place]
        weight = problem.weights[index]
        miss = abs(work.values[index] * weight - work.bound[place] - work.slack[place])
        scale = abs(work.bound[place]) + work.size[place] * size
        # Written so that NaN is an error, too.
        if not (miss < np.inf and abs(work.bound[place]) < np.inf):
            return np.inf
        if miss > worst * scale:
            worst = miss / scale
        work.slacks[index] = 0.0
    for i in range(len(work.slacks)):
        if work.slacks[i] != 0.0:
            miss = abs(_slack(problem, work.values, i))
            if not miss < np.inf:
                return np.inf
            if miss > worst * work.norms[i] * size:
                worst = miss / (work.norms[i] * size) if work.norms[i] * size > 0.0 else np.inf
    return worst


@part
def _reach(work: Work) -> float:
    """How far x is, or would be if it met the rows that are active one by one."""
    reach = length_of(work.x)
    for place in range(work.begin[len(work.rank)]):
        if work.size[place] > 0.0:
            reach = max(reach, abs(work.bound[place]) / work.size[place])
    return reach


@part
def _imbalance(problem: Problem, work: Work, level: int, size: float) -> float:
    """What is left of a force where a level's multipliers push against it, relatively."""
    n, force, found = len(work.x), work.force, work.multipliers[level]
    count = 0
    for place in range(work.begin[len(work.rank)]):
        index = work.order[place]
        push = found[index]
        size = max(size, abs(push) * work.norms[index])
        if index < n:
            force[index] += push
        elif push != 0.0:
            work.chosen[count] = index - n
            count += 1
    add_rows(force, problem.A, found, work.chosen, count, n)
    left = 0.0
    for j in range(n):
        if not abs(force[j]) < np.inf:
            return np.inf
        left = max(left, abs(force[j]))
    return left / size if left > 0.0 else left
