"""The whole-body problem in two parts, Ahn et al. 2024, section 4.2: LQP 1, then LQP 2."""

from poise.control.reduced.assignment import Assignment, assign
from poise.control.reduced.constraint_chain import ConstraintChainProblem
from poise.control.reduced.controller import ReducedController
from poise.control.reduced.resolver import ReducedResolver
from poise.control.reduced.unconstrained_chain import UnconstrainedChainProblem

__all__ = [
    "Assignment",
    "ConstraintChainProblem",
    "ReducedController",
    "ReducedResolver",
    "UnconstrainedChainProblem",
    "assign",
]
