"""A Dask cluster and Slurm's jobs give what processes here give, whoever dies."""

import os
import time
from collections import Counter
from contextlib import contextmanager

import episodes
import pytest

pytest.importorskip("mujoco")
pytest.importorskip("pyarrow")
pytest.importorskip("distributed")

import dask
import distributed

from poise.apps.campaigns import DaskWorkers, SlurmWorkers
from poise.apps.campaigns._episode import run_episode
from poise.errors import ConfigurationError, PoiseError

# A worker that ends before its nanny has heard of its start is not replaced (distributed 2026.8).
KNOWN = 0.5


@contextmanager
def a_cluster():
    """Two workers, each a process that is replaced when it dies."""
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 1}),
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0"
        ) as cluster,
    ):
        yield cluster


@pytest.fixture(scope="module")
def cluster():
    with a_cluster() as cluster:
        yield cluster


@pytest.fixture
def workers(cluster):
    with DaskWorkers(cluster.scheduler_address) as workers:
        yield workers


def test_a_worker_of_another_version_is_refused(workers):
    with pytest.raises(PoiseError, match=r"a worker on .* another version .*\+.*wanted x"):
        list(workers.each(run_episode, episodes.jobs(1)))


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nonsense", "udp://x:1", ""])
def test_a_scheduler_that_is_not_there_is_said(address):
    workers = DaskWorkers(address, patience=0.3)
    with pytest.raises(ConfigurationError, match="no scheduler there"), workers:
        pass


def test_a_worker_that_is_killed_loses_its_own_episode_alone(workers, tmp_path):
    """Last of those that share a cluster: it may have lost a worker for good."""
    notes = tmp_path / "notes"
    jobs = episodes.jobs(12, notes=str(notes), marker=str(tmp_path / "marker"), after=KNOWN)
    found = {job.number: row for job, row in workers.each(episodes.ending_once, jobs)}
    assert found == {job.number: episodes.row(job) for job in jobs}
    ran = [line.split() for line in notes.read_text().splitlines()]
    assert Counter(number for number, _ in ran) == {str(n): 1 for n in range(12)}


# The process of a job may outlive submitit's own object for it.
@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:subprocess .* is still running:ResourceWarning")
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_jobs_of_slurm_work_and_end(tmp_path, monkeypatch):
    pytest.importorskip("submitit")
    here = os.path.dirname(episodes.__file__)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([here, os.environ.get("PYTHONPATH", "")]))
    notes = tmp_path / "notes"
    jobs = episodes.jobs(4, notes=str(notes))
    with SlurmWorkers(1, tmp_path / "logs", executor="local") as workers:
        found = {job.number: row for job, row in workers.each(episodes.noted, jobs)}
        assert found == {job.number: episodes.row(job) for job in jobs}
        pids = {int(line.split()[1]) for line in notes.read_text().splitlines()}
    deadline = time.monotonic() + 20.0
    while any(os.path.exists(f"/proc/{pid}") for pid in pids) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert pids
    assert not any(os.path.exists(f"/proc/{pid}") for pid in pids)


def test_without_slurm_that_is_said(monkeypatch):
    monkeypatch.setenv("PATH", "")
    with pytest.raises(ConfigurationError, match="no Slurm on this machine"), SlurmWorkers(2):
        pass
