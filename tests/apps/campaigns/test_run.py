"""Running a campaign: results, resumption, crashes, replays."""

import os
import signal
from collections import Counter
from dataclasses import replace

import pytest

pytest.importorskip("mujoco")
pytest.importorskip("pyarrow")

import episodes

from poise.apps.campaigns import (
    CampaignFolder,
    LocalWorkers,
    Runner,
    ThisProcess,
    _episode,
    differences,
    read_rows,
    replay_job,
    row_of,
    run_campaign,
    version,
)
from poise.apps.campaigns._episode import run_episode, warm_up
from poise.apps.scenarios import run_scenario
from poise.errors import PoiseError

STACK = {"contacts": [{"surface": {"frame": "left_sole"}}]}
CONTENT = {"campaign": {}, "scenario": {}}
CAMPAIGN = """
name: tiny
scenario: tiny.yaml
episodes: 6
set: {plant.sensors.gyro_noise: 0.001}
vary:
  controller: [whole_body, osf]
  plant.mass_scale: {uniform: [0.9, 1.1]}
figures:
  rise: {metric: com_travel, axis: z}
"""
TINY = """
name: tiny
robot: biped20
duration: 0.05
checks:
  - {metric: com_error_max, at_most: 0.02}
"""


@pytest.fixture
def campaign(tmp_path):
    (tmp_path / "tiny.yaml").write_text(TINY)
    (tmp_path / "campaign.yaml").write_text(CAMPAIGN)
    return tmp_path / "campaign.yaml"


class Nobody(ThisProcess):
    """Workers that are asked for nothing."""

    def submit(self, function, item):
        raise AssertionError("ran again")


@pytest.fixture
def run(two):
    """Runs stand-ins into a folder, without a warm-up, which is for real episodes."""

    def run(folder, jobs, function):
        runner = Runner(two, folder, function=function, prepare=None)
        with folder.claimed(CONTENT):
            return runner.run(jobs)

    return run


@pytest.mark.slow
def test_real_episodes_in_two_processes_give_rows_that_replay(campaign, tmp_path):
    """What a user does, once in full: run, look, go on, replay."""
    seen = []
    rows = run_campaign(
        campaign, tmp_path / "out", LocalWorkers(2), lambda done, of: seen.append((done, of))
    )
    assert seen == [(float(n), 6.0) for n in range(7)]
    assert [row["number"] for row in rows] == list(range(6))
    assert {row["outcome"] for row in rows} == {"ok"}
    assert [row["controller"] for row in rows] == ["whole_body", "osf"] * 3
    assert len({row["seed"] for row in rows}) == 6
    assert len({row["com_error_max_m"] for row in rows}) == 6
    assert all(row["rise"] >= 0.0 for row in rows)
    assert all(row["check: robot fell"] == 0.0 for row in rows)
    assert len({row["version"] for row in rows}) == 1
    assert all(row["seconds"] > 0.0 for row in rows)

    assert run_campaign(campaign, tmp_path / "out", Nobody()) == rows
    assert read_rows(tmp_path / "out") == rows
    folder = CampaignFolder(tmp_path / "out")
    job = replay_job(folder, 3)
    again = row_of(job, run_scenario(job.make()))
    assert {n: (folder.rows[3][n], again[n]) for n in differences(folder.rows[3], again)} == {}
    other = folder.rows[3] | {"rise": -1.0, "seconds": 9.0}
    assert differences(folder.rows[3], other) == ["rise"]
    with pytest.raises(PoiseError, match="no result; got 6"):
        replay_job(folder, 6)


def outcome_of(**values):
    job = episodes.Job(number=0, scenario=episodes.TINY, where="t", values=values)
    return run_episode(job)


def test_what_becomes_of_an_episode_is_its_outcome(monkeypatch):
    checks = [{"metric": "com_error_max", "at_least": 1.0}]
    failed = outcome_of(checks=checks)
    assert failed["outcome"] == "failed"
    assert failed["reason"] == "largest distance of the CoM from its reference"
    push = [{"body": "pelvis", "at": 0.0, "duration": 0.1, "velocity_change": [8.0, 0.0, 0.0]}]
    fell = outcome_of(pushes=push, duration=1.0)
    assert fell["outcome"] == "fell"
    assert 0.1 < fell["simulated_s"] < 1.0
    push[0] = {"body": "torso", "at": 0.0, "duration": 0.1, "force": [1.0e9, 0.0, 0.0]}
    diverged = outcome_of(pushes=push, duration=0.1)
    assert (diverged["outcome"], diverged["reason"]) == ("diverged", "the simulation diverged")
    refused = outcome_of(robot="nobody")
    assert refused["outcome"] == "refused"
    assert "'nobody'" in refused["reason"]


def test_a_worker_of_another_version_is_refused():
    job = episodes.jobs(1)[0]
    with pytest.raises(PoiseError, match=r"another version of Poise; got '.*\+.*wanted x"):
        run_episode(job)


def test_a_scenario_that_does_not_fit_its_robot_is_found_before_the_first_episode():
    (misfit,) = episodes.jobs(1, robot="arm6", stack=STACK)
    misfit = replace(misfit, version=version())
    with pytest.raises(PoiseError, match="a foot.*left_sole"):
        warm_up([([misfit], False)])
    warm_up([([misfit], True)])
    with pytest.raises(PoiseError, match="another version"):
        warm_up([([replace(misfit, version="x")], True)])


def test_what_is_recorded_is_not_run_again_and_rows_come_in_order(run, tmp_path):
    notes = tmp_path / "notes"
    jobs = episodes.jobs(6, notes=str(notes))
    folder = CampaignFolder(tmp_path / "c")
    assert len(run(folder, jobs[:3], episodes.noted)) == 3
    rows = run(CampaignFolder(tmp_path / "c"), jobs[::-1], episodes.noted)
    assert [row["number"] for row in rows] == [5, 4, 3, 2, 1, 0]
    ran = Counter(line.split()[0] for line in notes.read_text().splitlines())
    assert ran == dict.fromkeys("012345", 1)


def test_an_episode_that_ctrl_c_ends_is_no_result(campaign, tmp_path, monkeypatch):
    def interrupted(*_, **__):
        os.kill(os.getpid(), signal.SIGINT)
        return run_scenario(*_, **__)

    monkeypatch.setattr(_episode, "run_scenario", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run_campaign(campaign, tmp_path / "out", ThisProcess())
    assert CampaignFolder(tmp_path / "out").rows == {}
