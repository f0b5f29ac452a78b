"""Hierarchical QPs: ordered levels of two-sided rows plus a final quadratic cost."""

from poise.hqp.backends import ACCURACY
from poise.hqp.cascade import CascadeSolver
from poise.hqp.explain import Conflict
from poise.hqp.level import Level
from poise.hqp.lexls import LexicographicSolver
from poise.hqp.optimality import Certificate, certify_point
from poise.hqp.problem import HierarchicalProblem, LevelView
from poise.hqp.solution import Solution, SolveStatus
from poise.hqp.strategies import STRATEGIES, Solver, make_solver, solve
from poise.hqp.weighted import WeightedSolver

__all__ = [
    "ACCURACY",
    "STRATEGIES",
    "CascadeSolver",
    "Certificate",
    "Conflict",
    "HierarchicalProblem",
    "Level",
    "LevelView",
    "LexicographicSolver",
    "Solution",
    "SolveStatus",
    "Solver",
    "WeightedSolver",
    "certify_point",
    "make_solver",
    "solve",
]
