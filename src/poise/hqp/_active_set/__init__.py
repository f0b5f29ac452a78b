"""Lexicographic least squares: strict hierarchies of two-sided rows by one active set, compiled."""

from poise.hqp._active_set.search import LOST as LOST, UNSOUND as UNSOUND, search as search
from poise.hqp._active_set.solver import LexicographicSolver
from poise.hqp._active_set.workspace import SearchWork as SearchWork

__all__ = ["LexicographicSolver"]
