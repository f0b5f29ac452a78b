"""`copy_problem`: a problem of its own, from a controller that fills one storage every tick."""

from benchmarks.hqp.packed import FLOATS
from poise.hqp import HierarchicalProblem


def copy_problem(problem: HierarchicalProblem) -> HierarchicalProblem:
    """The same problem in a storage of its own; its views look into that storage.

    Args:
        problem: what to copy.
    """
    copy = HierarchicalProblem.allocate(
        problem.n,
        [len(view.lower) for view in problem.levels],
        names=[view.name for view in problem.levels],
        bounds_level=problem.bounds_level,
    )
    for key in FLOATS:
        getattr(copy, key)[...] = getattr(problem, key)
    copy.labels = list(problem.labels)
    return copy


def shape_of(problem: HierarchicalProblem) -> tuple[int, ...]:
    """Number of variables, and of rows of each level."""
    return (problem.n, *(len(view.lower) for view in problem.levels))
