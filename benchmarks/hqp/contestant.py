"""`Contestant`: a method as the race sees it, and those that are Poise's own strategies."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float64

from poise.hqp import HierarchicalProblem, LexicographicSolver, Solution, SolveStatus, make_solver


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """What a method says.

    Attributes:
        x: its point.
        status: how its solve ended, in its own words.
        claimed: whether it says that this is the answer.
    """

    x: Float64[np.ndarray, " n"]
    status: str
    claimed: bool


@runtime_checkable
class Contestant(Protocol):
    """A method with a workspace. Only `solve` is timed."""

    def forget(self) -> None:
        """Forgets the last solve, so that the next one starts cold."""
        ...

    def take(self, problem: HierarchicalProblem) -> None:
        """Takes the next problem, and states it the way the method's own user would write it."""
        ...

    def solve(self) -> None:
        """Solves it, as a user pays for it."""
        ...

    def answer(self) -> Answer:
        """What the last solve found; owns its numbers."""
        ...


class DirectContestant:
    """`LexicographicSolver.run`, the call of a loop.

    Args:
        time_limit: cap on a solve [s].
    """

    def __init__(self, time_limit: float) -> None:
        self._solver = LexicographicSolver(time_limit)
        self._status = SolveStatus.FAILED

    def forget(self) -> None:
        """Forgets the last active set."""
        self._solver.reset()

    def take(self, problem: HierarchicalProblem) -> None:
        """Takes the problem as it is."""
        self._problem = problem

    def solve(self) -> None:
        """Solves it; the answer stays in the workspace."""
        self._status = self._solver.run(self._problem)

    def answer(self) -> Answer:
        """Copies the answer out of the workspace."""
        return Answer(x=self._solver.x.copy(), status=self._status.value, claimed=self._status.ok)


class StrategyContestant:
    """Any strategy, by its `solve`, which makes a `Solution`.

    Args:
        strategy: its name.
        backend: QP solver of the strategy; its own when None.
        time_limit: cap on a solve [s].
    """

    def __init__(self, strategy: str, backend: str | None, time_limit: float) -> None:
        self._solver = make_solver(strategy, backend, time_limit=time_limit)

    def forget(self) -> None:
        """Forgets the last solution."""
        self._solver.reset()

    def take(self, problem: HierarchicalProblem) -> None:
        """Takes the problem as it is."""
        self._problem = problem

    def solve(self) -> None:
        """Solves it."""
        self._solution: Solution = self._solver.solve(self._problem)

    def answer(self) -> Answer:
        """The solution's point and status."""
        found = self._solution
        return Answer(x=found.x, status=found.status.value, claimed=found.ok)
