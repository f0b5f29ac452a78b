"""Lexicographic least squares: strict hierarchies of two-sided rows by one active set, compiled."""

from poise.hqp._active_set.kernels import copy as copy
from poise.hqp._active_set.moves import find_values as find_values, measure as measure
from poise.hqp._active_set.search import (
    CONVERGED as CONVERGED,
    LOST as LOST,
    UNSOUND as UNSOUND,
    begin_with as begin_with,
    search as search,
)
from poise.hqp._active_set.solver import ENDS as ENDS, LexicographicSolver
from poise.hqp._active_set.workspace import Problem as Problem, SearchWork as SearchWork

__all__ = ["LexicographicSolver"]
