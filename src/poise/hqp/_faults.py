"""Whether the numbers of a problem can be one, asked in a loop, where nothing raises."""

import numpy as np
from jaxtyping import Bool

from poise._show import few
from poise.hqp._problem import HierarchicalProblem


def is_sound(problem: HierarchicalProblem) -> bool:
    """Return whether the numbers can be a problem: finite coefficients, bounds in order.

    What a solver asks in a loop, where `validate` would raise.
    """
    return bool(
        np.isfinite(problem.A).all()
        and np.isfinite(problem.H).all()
        and np.isfinite(problem.g).all()
        and (np.isfinite(problem.weights) & (problem.weights > 0.0)).all()
        and (problem.lower <= problem.upper).all()
        and (problem.lower < np.inf).all()
        and (problem.upper > -np.inf).all()
    )


def faults(problem: HierarchicalProblem) -> list[str]:
    """List the faults of a problem's numbers by the labels of their rows, see `is_sound`."""
    lower, upper, weights = problem.lower, problem.upper, problem.weights
    wrong = np.isnan(lower) | np.isnan(upper) | (lower == np.inf) | (upper == -np.inf)
    wrong |= ~(np.isfinite(weights) & (weights > 0.0))
    wrong[problem.n :] |= ~np.isfinite(problem.A).all(axis=1)
    words: list[str] = []
    if names := _labels(problem, wrong):
        words.append(f"numbers that are not finite in {few(names)}")
    if names := _labels(problem, lower > upper):
        words.append(f"bounds that cross in {few(names)}")
    if not (np.isfinite(problem.H).all() and np.isfinite(problem.g).all()):
        words.append("a final cost that is not finite")
    return words


def _labels(problem: HierarchicalProblem, rows: Bool[np.ndarray, " nm"]) -> list[str]:
    """Labels of rows, each once."""
    return list(dict.fromkeys(problem.label(row) for row in np.flatnonzero(rows).tolist()))
