"""`Source`: a sequence that can be made.

`copy_problem`: a problem of its own, from a controller that fills one storage every tick.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import islice

from benchmarks.hqp.packed import FLOATS
from benchmarks.hqp.problem_set import ProblemSequence
from poise.errors import ConfigurationError
from poise.hqp import HierarchicalProblem

Progress = Callable[[int, int], None]
"""Called with what is done and what there is in all."""

Make = Callable[[int, Progress | None], Iterable[HierarchicalProblem]]
"""Makes up to so many problems; each call makes the same ones."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """What a sequence is and how it is made.

    Attributes:
        name: of the sequence.
        family: one of `FAMILIES`.
        description: one sentence.
        consecutive: whether neighbours are one tick apart.
        make: makes its problems.
    """

    name: str
    family: str
    description: str
    consecutive: bool
    make: Make

    def sequence(self, count: int, progress: Progress | None = None) -> ProblemSequence:
        """Makes the sequence.

        Args:
            count: how many problems; fewer where the phase that is recorded ends before.
            progress: told how far it is.

        Raises:
            ConfigurationError: `count` is not positive.
            PoiseError: something that it is made with is not installed.
        """
        if count < 1:
            raise ConfigurationError("no problems to make", got=count, wanted="count >= 1")
        return ProblemSequence(
            name=self.name,
            family=self.family,
            description=self.description,
            consecutive=self.consecutive,
            problems=tuple(islice(self.make(count, progress), count)),
        )


def copy_problem(problem: HierarchicalProblem) -> HierarchicalProblem:
    """The same problem in a storage of its own; its views look into that storage.

    Args:
        problem: what to copy.
    """
    copy = HierarchicalProblem.allocate(
        problem.n,
        [len(view.lower) for view in problem.levels],
        names=[view.name for view in problem.levels],
        bounds_level=problem.bounds_level,
    )
    for key in FLOATS:
        getattr(copy, key)[...] = getattr(problem, key)
    copy.labels = list(problem.labels)
    return copy


def shape_of(problem: HierarchicalProblem) -> tuple[int, ...]:
    """Number of variables, and of rows of each level."""
    return (problem.n, *(len(view.lower) for view in problem.levels))
