"""`Runner`: runs jobs over any workers, to one row each that is kept in a folder."""

import math
from collections import defaultdict
from collections.abc import Callable, Sequence

from poise.apps.campaigns._episode import (
    Job,
    Kind,
    Row,
    crashed,
    run_episode,
    same_kind,
    warm_up,
)
from poise.apps.campaigns._folder import CampaignFolder
from poise.apps.campaigns._workers import WorkerLostError, Workers
from poise.apps.scenarios import Progress

_TRIED = 8
"""So many jobs of a kind are tried at most until one can be begun."""


class Runner:
    """Runs jobs, once each however often they are asked for."""

    def __init__(
        self,
        workers: Workers,
        folder: CampaignFolder,
        *,
        progress: Progress | None = None,
        total: int | None = None,
        function: Callable[[Job], Row] = run_episode,
    ) -> None:
        self._workers, self._folder, self._function = workers, folder, function
        self._progress, self._total = progress, total
        self._warm: set[str] = set()
        self._begun: set[str] = set()

    def run(self, jobs: Sequence[Job]) -> list[Row]:
        """Runs those jobs that have no row yet."""
        left = [job for job in jobs if job.number not in self._folder.rows]
        self._begun |= {same_kind(job) for job in jobs if job.number in self._folder.rows}
        total = len(jobs) if self._total is None else self._total
        self._tell(total)
        self.warm_up(left)
        for job, found in self._workers.each(self._function, left):
            self._folder.add(
                crashed(job, str(found)) if isinstance(found, WorkerLostError) else found
            )
            self._tell(total)
        return [self._folder.rows[job.number] for job in jobs]

    def warm_up(self, jobs: Sequence[Job]) -> None:
        """Has everything compiled before all workers would do it at once.

        `run` does it with its jobs; it is for those who know better ones, that fit their robots.
        """
        kinds: defaultdict[str, list[Job]] = defaultdict(list)
        for job in jobs:
            kinds[same_kind(job)].append(job)
        # Neighbours in a grid are alike: those that are tried are far from each other.
        cold = [
            Kind(jobs=own[:: math.ceil(len(own) / _TRIED)], begun=name in self._begun)
            for name, own in kinds.items()
            if name not in self._warm
        ]
        if cold:
            self._workers.warm(warm_up, cold)
            self._warm |= set(kinds)

    def _tell(self, total: int) -> None:
        if self._progress is not None:
            # Rows of a campaign that was longer before stay, and are none of this one's.
            self._progress(float(min(len(self._folder.rows), total)), float(total))
