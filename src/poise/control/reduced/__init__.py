"""The whole-body problem in two parts, Ahn et al. 2024, section 4.2: LQP 1, then LQP 2."""

from poise.control.reduced.assignment import Assignment, assign
from poise.control.reduced.constraint_chain import ConstraintChainProblem
from poise.control.reduced.resolver import ReducedAnswer, ReducedResolver
from poise.control.reduced.unconstrained_chain import UnconstrainedChainProblem

__all__ = [
    "Assignment",
    "ConstraintChainProblem",
    "ReducedAnswer",
    "ReducedResolver",
    "UnconstrainedChainProblem",
    "assign",
]
