"""`run_each`: the trials of a part of a study, in processes of their own."""

from collections.abc import Callable, Sequence
from typing import TypeVar

from poise.apps.campaigns import LocalWorkers
from poise.errors import PoiseError
from studies.plan import Progress

Trial = TypeVar("Trial")
Outcome = TypeVar("Outcome")


def run_each(
    run: Callable[[Trial], Outcome],
    kind: type[Outcome],
    trials: Sequence[Trial],
    progress: Progress,
    workers: int | None = None,
) -> dict[Trial, Outcome]:
    """Runs trials, as many at a time as there are cores.

    Args:
        run: one of them; a function of a module.
        kind: of its outcome.
        trials: in any order.
        progress: told how many are done.
        workers: processes; one a core when None.

    Raises:
        PoiseError: a trial has ended every process that tried it.
    """
    outcomes: dict[Trial, Outcome] = {}
    with LocalWorkers(workers) as crew:
        for trial, outcome in crew.each(run, list(trials)):
            if not isinstance(outcome, kind):
                raise PoiseError(f"no outcome of {trial}: {outcome}")
            outcomes[trial] = outcome
            progress(float(len(outcomes)), float(len(trials)))
    return outcomes
