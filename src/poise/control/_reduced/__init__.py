"""The whole-body problem in two parts, Ahn et al. 2024, section 4.2: LQP 1, then LQP 2."""

from poise.control._reduced._constraint_chain import ConstraintChainProblem
from poise.control._reduced._controller import ReducedController
from poise.control._reduced._resolver import ReducedResolver
from poise.control._reduced._task_rows import Assignment, assign
from poise.control._reduced._unconstrained_chain import UnconstrainedChainProblem

__all__ = [
    "Assignment",
    "ConstraintChainProblem",
    "ReducedController",
    "ReducedResolver",
    "UnconstrainedChainProblem",
    "assign",
]
