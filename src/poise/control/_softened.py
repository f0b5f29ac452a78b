"""`SoftenedFull`: the full problem, solved with the softening terms of its stack."""

from collections.abc import Callable

from poise.control._full_problem import FullProblem
from poise.control._strategy import UNSOFTENED
from poise.hqp import SoftenedSolver, Solver, SolveStatus


class SoftenedFull(SoftenedSolver):
    """A solver of a full problem that softens the levels of its stack.

    Args:
        full: the problem, filled before each solve.
        make_solver: makes a solver with a workspace of its own.
    """

    def __init__(self, full: FullProblem, make_solver: Callable[[], Solver]) -> None:
        rows, problem = full.rows, full.problem
        first, base = len(problem.levels) - len(rows.levels), full.sizes[0]
        self._softening = rows.softening
        super().__init__(
            problem,
            make_solver(),
            [first + level for level in rows.softening.levels],
            range(base, base + len(rows.softening.reference)),
            exact=rows.softening.exact,
            tolerance=UNSOFTENED,
            make_solver=make_solver,
        )

    def run(self) -> SolveStatus:
        """Solve the problem with the weights and the reference of its rows."""
        self.weights[:], self.reference[:] = self._softening.weights, self._softening.reference
        return super().run()
