"""A campaign on a Dask cluster whose worker and whose parent are killed, beside one in peace."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from poise.apps.campaigns import LocalWorkers, run_campaign
from poise.errors import PoiseError
from studies.campaigns.campaign_files import (
    recorded,
    without_times,
    write_campaign,
)
from studies.finding import Finding, Section
from studies.plan import Progress, StudyOptions

_EPISODES, _QUICK_EPISODES = 400, 24

_WORKER_AT, _PARENT_AT = 0.25, 0.5
"""Parts of the episodes after which the worker and the parent are killed."""

_LIMIT = 1800.0
"""No campaign of this study takes longer [s]."""


def interruption_section(options: StudyOptions, progress: Progress) -> Section:
    """The section."""
    count = _QUICK_EPISODES if options.quick else _EPISODES
    with TemporaryDirectory() as place:
        folder = Path(place)
        file = write_campaign(
            folder / "interrupted.yaml",
            "stand.yaml",
            seed=options.seed,
            episodes=count,
            vary={
                "pushes[0].velocity_change[0]": {"uniform": [-0.3, 0.3]},
                "plant.friction": [0.4, 1.0],
                "plant.sensors.gyro_noise": {"log_uniform": [1e-4, 1e-2]},
            },
        )
        peaceful = run_campaign(
            file, folder / "peace", LocalWorkers(2), lambda done, _: progress(done, 2.0 * count)
        )
        before, after = _interrupted(file, folder / "trouble", count, progress)
    then = {row["number"]: row for row in after}
    again = sum(then.get(row["number"]) != row for row in before)
    pairs = zip(without_times(peaceful), without_times(after), strict=False)
    different = abs(len(peaceful) - len(after)) + sum(one != other for one, other in pairs)
    return Section(
        prose=(
            f"{count} episodes on a Dask cluster of two workers here. After a quarter of them one "
            "worker is killed, after half the parent; the same command then goes on. Beside it "
            "the same campaign on two processes of this machine, in peace.",
        ),
        findings=(
            Finding(
                name="results after a worker and the parent were killed",
                paper=count,
                ours=len(after),
                ok=[row["number"] for row in after] == list(range(count)),
                note="one of each number",
            ),
            Finding(
                name="results that are not those of the campaign in peace",
                paper=0,
                ours=different,
                ok=different == 0,
                note="every figure to the last bit, times left out",
            ),
            Finding(
                name="recorded results that were lost or run again",
                paper=0,
                ours=again,
                ok=again == 0,
                note=f"{len(before)} were recorded when the parent was killed",
            ),
        ),
    )


def _interrupted(
    file: Path, folder: Path, count: int, progress: Progress
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """What was recorded when the parent was killed, and what at the end."""
    from distributed import LocalCluster

    with LocalCluster(
        n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0"
    ) as cluster:
        command = [sys.executable, "-m", "poise.cli.main", "campaign", str(file), "--json"]
        command += ["--out", str(folder), "--scheduler", str(cluster.scheduler_address)]
        with subprocess.Popen(command, stdout=subprocess.DEVNULL) as parent:
            _until(folder, _WORKER_AT * count, parent, count, progress)
            worker: Any = next(iter(cluster.workers.values()))
            os.kill(worker.pid, signal.SIGKILL)
            _until(folder, _PARENT_AT * count, parent, count, progress)
            parent.kill()
        before = recorded(folder)
        with subprocess.Popen(command, stdout=subprocess.DEVNULL) as parent:
            _until(folder, float(count), parent, count, progress)
            parent.wait(_LIMIT)
    return before, recorded(folder)


def _until(
    folder: Path, wanted: float, parent: "subprocess.Popen[bytes]", count: int, progress: Progress
) -> None:
    """Waits until so many results are recorded."""
    deadline = time.monotonic() + _LIMIT
    while (found := len(recorded(folder))) < wanted:
        if parent.poll() is not None or time.monotonic() > deadline:
            raise PoiseError("the campaign ended early", got=found, wanted=f"{wanted:g} results")
        progress(float(count + found), 2.0 * count)
        time.sleep(0.1)
