"""Campaigns: many episodes of a scenario, on local processes or a cluster, into one table."""

from poise.apps.campaigns._campaign import Design, robot_files as robot_files
from poise.apps.campaigns._cluster import (
    DaskWorkers as DaskWorkers,
    SlurmWorkers as SlurmWorkers,
)
from poise.apps.campaigns._episode import (
    OUTCOMES as OUTCOMES,
    Job as Job,
    Row as Row,
    row_of as row_of,
    run_episode as run_episode,
    version as version,
)
from poise.apps.campaigns._folder import (
    CampaignFolder as CampaignFolder,
    RowLog,
    read_rows as read_rows,
)
from poise.apps.campaigns._run import (
    Runner as Runner,
    differences as differences,
    replay_job as replay_job,
    run_campaign,
)
from poise.apps.campaigns._tune import best_trial as best_trial
from poise.apps.campaigns._workers import (
    LocalWorkers,
    ThisProcess as ThisProcess,
    WorkerLostError as WorkerLostError,
    Workers as Workers,
)

__all__ = [
    "Design",
    "LocalWorkers",
    "RowLog",
    "run_campaign",
]
