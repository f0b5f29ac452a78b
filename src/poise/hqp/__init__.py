"""Hierarchical QPs: ordered levels of two-sided rows plus a final quadratic cost."""

from poise.hqp._active_set import (
    LOST as LOST,
    UNSOUND as UNSOUND,
    LexicographicSolver,
    SearchWork as SearchWork,
    begin_with as begin_with,
    search as search,
)
from poise.hqp._certificate import certify_point as certify_point
from poise.hqp._problem import HierarchicalProblem, Level, LevelView as LevelView
from poise.hqp._softening import (
    SoftenedLevel as SoftenedLevel,
    SoftenedSolver as SoftenedSolver,
    SofteningProgram as SofteningProgram,
    search_softened as search_softened,
)
from poise.hqp._solution import Solution, SolveStatus
from poise.hqp._strategies import STRATEGIES as STRATEGIES, Solver as Solver, make_solver, solve
from poise.hqp._tolerances import ACCURACY as ACCURACY

__all__ = [
    "HierarchicalProblem",
    "Level",
    "LexicographicSolver",
    "Solution",
    "SolveStatus",
    "make_solver",
    "solve",
]
