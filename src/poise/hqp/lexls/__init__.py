"""Lexicographic least squares: strict hierarchies of two-sided rows, exact and fast.

Usable without anything else of Poise: `solve` for one problem, `LexicographicSolver` for many. The
algorithm can be read in `reference`.
"""

from poise.hqp.level import Level
from poise.hqp.lexls.solution import LexicographicSolution
from poise.hqp.lexls.solver import LexicographicSolver, solve

__all__ = ["Level", "LexicographicSolution", "LexicographicSolver", "solve"]
