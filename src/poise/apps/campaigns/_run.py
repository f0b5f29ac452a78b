"""`run_campaign`: all episodes of a file. `replay_job`, `differences`: one of them again."""

import json
from pathlib import Path

from poise.apps.campaigns._campaign import Design
from poise.apps.campaigns._episode import TIMINGS, Job, Row
from poise.apps.campaigns._folder import CampaignFolder
from poise.apps.campaigns._runner import Runner
from poise.apps.campaigns._tune import tune
from poise.apps.campaigns._workers import LocalWorkers, Workers
from poise.apps.pages import write_campaign_page
from poise.apps.scenarios import Progress


def run_campaign(
    file: str | Path,
    directory: str | Path,
    workers: Workers | None = None,
    progress: Progress | None = None,
) -> list[dict[str, object]]:
    """Runs the episodes of a campaign that its folder has no results of yet.

    Args:
        file: the campaign's.
        directory: for the results; that of an earlier run of the campaign is gone on with.
        workers: who does it; one process a core when None. They start here.
        progress: told how many results there are, of how many.

    Returns:
        A row an episode: number, seed, values, outcome, figures.

    Raises:
        PoiseError: the file is not right, the folder is another campaign's or in use, no scenario
            of a kind fits its robot, or nobody is left who could work. What was recorded stays.
    """
    design, folder = Design.load(Path(file)), CampaignFolder(Path(directory))
    with folder.claimed(design.to_json()), workers or LocalWorkers() as crew:
        runner = Runner(crew, folder, progress=progress, total=design.count)
        plan = design.campaign.tune
        rows = (
            runner.run([*design.jobs()])
            if plan is None
            else tune(design, plan, runner, folder.path)
        )
    write_campaign_page(rows, folder.path / "campaign.html")
    return rows


def replay_job(folder: CampaignFolder, number: int) -> Job:
    """The job of a recorded episode, made of what its row says."""
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
    passed_over = {*TIMINGS, "version", "trial"}
    names = {name for name in {*recorded, *again} if name not in passed_over}
    return sorted(name for name in names if recorded.get(name) != again.get(name))
