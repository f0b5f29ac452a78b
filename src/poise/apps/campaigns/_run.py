"""`run_campaign`: all episodes of a file. `Runner`: any jobs over any workers, to a row each."""

import json
import math
from collections import defaultdict
from collections.abc import Callable, Sequence
from pathlib import Path

from poise.apps.campaigns._campaign import Design
from poise.apps.campaigns._episode import (
    TIMINGS,
    Job,
    Row,
    run_episode,
    same_kind,
    warm_up,
    without_run,
)
from poise.apps.campaigns._folder import CampaignFolder, require_pyarrow
from poise.apps.campaigns._tune import tune
from poise.apps.campaigns._workers import LocalWorkers, WorkerLostError, Workers
from poise.apps.pages import write_campaign_page
from poise.apps.scenarios import Progress


class Runner:
    """Runs jobs, once each however often they are asked for; rows are kept in a folder."""

    def __init__(
        self,
        workers: Workers,
        folder: CampaignFolder,
        *,
        progress: Callable[[], None] = lambda: None,
        function: Callable[[Job], Row] = run_episode,
        prepare: Callable[[Sequence[tuple[Sequence[Job], bool]]], bool] | None = warm_up,
    ) -> None:
        self._workers, self._folder, self._progress = workers, folder, progress
        self._function, self._prepare = function, prepare
        self._warm: set[str] = set()
        self._begun: set[str] = set()

    def run(self, jobs: Sequence[Job], begin_with: Sequence[Job] = ()) -> list[Row]:
        """Run those jobs that have no row yet; the rows of all, in their order.

        Before all workers would compile the same, one of each machine does for jobs of each kind:
        for those to begin with, which are known to fit their robots, where there are any.
        """
        left = [job for job in jobs if job.number not in self._folder.rows]
        self._begun |= {same_kind(job) for job in jobs if job.number in self._folder.rows}
        self._progress()
        self._warm_up((begin_with or left) if left else ())
        for job, found in self._workers.each(self._function, left):
            lost = isinstance(found, WorkerLostError)
            self._folder.add(without_run(job, "crashed", str(found)) if lost else found)
            self._progress()
        return [self._folder.rows[job.number] for job in jobs]

    def _warm_up(self, jobs: Sequence[Job]) -> None:
        kinds: defaultdict[str, list[Job]] = defaultdict(list)
        for job in jobs:
            kinds[same_kind(job)].append(job)
        # Neighbours in a grid are alike: of each kind eight at most are tried, far from each other.
        cold = [
            (own[:: math.ceil(len(own) / 8)], name in self._begun)
            for name, own in kinds.items()
            if name not in self._warm
        ]
        if cold and self._prepare is not None:
            self._workers.warm(self._prepare, cold)
            self._warm |= set(kinds)


def run_campaign(
    file: str | Path,
    directory: str | Path,
    workers: Workers | None = None,
    progress: Progress | None = None,
) -> list[dict[str, object]]:
    """Run the episodes of a campaign that its folder has no results of yet.

    Args:
        file: the campaign's.
        directory: for the results; that of an earlier run of the campaign is continued.
        workers: one process a core when None. They start here.
        progress: called with how many results there are, and of how many.

    Returns:
        A row an episode: number, seed, values, outcome, figures.

    Raises:
        PoiseError: the file is not right, the folder is another campaign's or in use, no scenario
            of a kind fits its robot, or no worker is left. Recorded episodes stay.
    """
    require_pyarrow()
    design, folder = Design.load(Path(file)), CampaignFolder(Path(directory))

    def tell() -> None:
        if progress is not None:
            # Rows of a campaign that was longer before stay, and are none of this one's.
            progress(float(min(len(folder.rows), design.count)), float(design.count))

    with folder.claimed(design.to_json()), workers or LocalWorkers() as crew:
        runner, plan = Runner(crew, folder, progress=tell), design.campaign.tune
        if plan is None:
            rows = runner.run([*design.jobs()])
        else:
            rows = tune(design, plan, runner.run, folder.path)
    write_campaign_page(rows, folder.path / "campaign.html")
    return rows


def replay_job(folder: CampaignFolder, number: int) -> Job:
    """The job of a recorded episode, from its row."""
    design = Design.of(folder)
    row = folder.row(number)
    return Job(
        number=number,
        scenario=design.scenario,
        where=design.campaign.scenario,
        values=json.loads(row["values"]),
        seed=row["seed"],
        figures=design.campaign.figures,
    )


def differences(recorded: Row, again: Row) -> list[str]:
    """Columns of an episode that are not the same when it is run again, times left out."""
    names = {*recorded, *again} - {*TIMINGS, "version", "trial"}
    return sorted(name for name in names if recorded.get(name) != again.get(name))
