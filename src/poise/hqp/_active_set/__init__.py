"""Lexicographic least squares: strict hierarchies of two-sided rows by one active set, compiled."""

from poise.hqp._active_set.solver import LexicographicSolver

__all__ = ["LexicographicSolver"]
