"""`velocity_problem`: prioritised joint velocities as a hierarchical problem."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64

from poise.hqp import HierarchicalProblem, Level


def velocity_problem(
    tasks: Sequence[Level], lower: Float64[np.ndarray, " n"], upper: Float64[np.ndarray, " n"]
) -> HierarchicalProblem:
    """Joint limits first, then tasks, then the least velocity.

    Args:
        tasks: rows J u = v, most important first.
        lower: of the velocities [rad/s]; -inf where there is no bound.
        upper: likewise.
    """
    n = len(lower)
    limits = Level(np.zeros((0, n)), 0.0, 0.0, name="joint limits")
    return HierarchicalProblem([limits, *tasks], None, None, lower, upper)


def equalities(
    name: str, J: Float64[np.ndarray, "m n"], velocity: Float64[np.ndarray, " m"]
) -> Level:
    """A task J u = velocity.

    Args:
        name: of the level.
        J: Jacobian.
        velocity: what is wanted.
    """
    return Level(J, velocity, velocity, name=name, labels=name)
