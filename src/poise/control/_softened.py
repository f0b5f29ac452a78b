"""`SoftenedFull`: the full problem, solved with the softening terms of its stack."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float64

from poise.control._full_problem import FullProblem
from poise.control._strategy import UNSOFTENED
from poise.hqp import SoftenedSolver, Solver


class SoftenedFull(SoftenedSolver):
    """A solver of a full problem that softens the levels of its stack."""

    def __init__(self, full: FullProblem, make_solver: Callable[[], Solver]) -> None:
        softening, problem = full.rows.softening, full.problem
        first, base = len(problem.levels) - len(full.rows.levels), full.sizes[0]

        def find(x: Float64[np.ndarray, " n"]) -> float:
            return softening.find(full.velocity, x, base)

        super().__init__(
            problem,
            make_solver(),
            {level: first + level for level in softening.levels},
            range(base, base + len(softening.terms.reference)),
            weights=softening.terms.weights,
            reference=softening.terms.reference,
            find=find,
            exact=softening.exact,
            tolerance=UNSOFTENED,
            make_solver=make_solver,
        )
