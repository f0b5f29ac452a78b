"""`Source`: a sequence that can be made."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import islice

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
