"""`poise campaign`: run, status, replay; exit status, and one clean line for bad input."""

import errno
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("mujoco")
pytest.importorskip("pyarrow")
pytest.importorskip("distributed")

from poise.apps import campaigns
from poise.apps.campaigns import LocalWorkers
from poise.apps.campaigns._episode import TIMINGS
from poise.cli.main import main

TINY = "name: tiny\nrobot: biped20\nduration: 0.04\n"
CAMPAIGN = """
name: trial
scenario: tiny.yaml
episodes: 2
vary: {plant.mass_scale: {uniform: [0.9, 1.1]}}
"""


class InPlace(campaigns.ThisProcess):
    """Runs episodes here: what processes do is tested with them."""

    def __init__(self, count=1):
        LocalWorkers(count)  # refuses what it does not take


@pytest.fixture
def here(tmp_path, monkeypatch):
    """A folder with a campaign, to work in."""
    (tmp_path / "tiny.yaml").write_text(TINY)
    (tmp_path / "trial.yaml").write_text(CAMPAIGN)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(campaigns, "LocalWorkers", InPlace)
    return tmp_path


@pytest.fixture(scope="module")
def _finished(tmp_path_factory):
    """What the campaign leaves behind; made once."""
    folder = tmp_path_factory.mktemp("finished")
    (folder / "tiny.yaml").write_text(TINY)
    (folder / "trial.yaml").write_text(CAMPAIGN)
    campaigns.run_campaign(folder / "trial.yaml", folder / "o", InPlace(1))
    return folder / "o"


@pytest.fixture
def finished(_finished, here):
    """The campaign's results, in the folder `o`."""
    shutil.copytree(_finished, here / "o")
    return here / "o"


def one_line(err):
    assert err.startswith("poise: "), err
    assert err.count("\n") == 1
    assert "Traceback" not in err


def test_a_campaign_is_run_looked_at_and_replayed(here, capsys):
    assert main(["campaign", "trial.yaml"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert out == "trial: 2 of 2 episodes in runs/campaign-trial\n  ok        2\n"
    assert main(["campaign", "status", "runs/campaign-trial", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert (said["done"], said["episodes"], said["running"]) == (2, 2, False)
    assert said["outcomes"] == {"ok": 2}
    assert main(["campaign", "replay", "runs/campaign-trial", "1", "--no-video"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert "the figures are those of episode 1, outcome ok" in out
    replay = here / "runs" / "campaign-trial" / "replays" / "1"
    assert {p.name for p in replay.iterdir()} == {"report.html", "log.mcap", "summary.json"}


def test_the_status_of_a_copy_without_its_lock_is_said(finished, capsys):
    (finished / "lock").unlink()
    assert main(["campaign", "status", "o"]) == 0
    assert capsys.readouterr().out == "trial: 2 of 2 episodes in o\n  ok        2\n"


def test_a_campaign_that_is_made_shorter_counts_what_it_has(finished, here, capsys):
    (here / "trial.yaml").write_text(CAMPAIGN.replace("episodes: 2", "episodes: 1"))
    assert main(["campaign", "trial.yaml", "--out", "o"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert out == "trial: 1 of 1 episodes in o\n  ok        1\n"


def test_a_replay_with_other_figures_says_so(finished, capsys, monkeypatch):
    monkeypatch.setattr(campaigns, "row_of", lambda job, run: {"com_error_max_m": 1.0})
    assert main(["campaign", "replay", "o", "0", "--no-video", "--json"]) == 1
    out, err = capsys.readouterr()
    assert "com_error_max_m" in json.loads(out)["differs"]
    assert err.startswith("differs from what version 0.1.0+")


def test_ctrl_c_leaves_what_is_done_and_says_how_to_go_on(here, capsys, monkeypatch):
    class Interrupted(InPlace):
        def submit(self, function, item):
            if item.number == 1:
                raise KeyboardInterrupt
            return super().submit(function, item)

    monkeypatch.setattr(campaigns, "LocalWorkers", Interrupted)
    assert main(["campaign", "trial.yaml", "--out", "o"]) == 1
    out, err = capsys.readouterr()
    assert err.splitlines()[-1] == "interrupted; the same command goes on from here"
    assert out.startswith("trial: 1 of 2 episodes in o\n")
    monkeypatch.setattr(campaigns, "LocalWorkers", InPlace)
    assert main(["campaign", "trial.yaml", "--out", "o"]) == 0
    assert capsys.readouterr().out.startswith("trial: 2 of 2")


def test_a_campaign_whose_next_episode_is_refused_goes_on(here, capsys):
    periods = "vary: {plant.control_dt: [0.001, 0.002], plant.physics_dt: [0.001, 0.002]}\n"
    periods += "set: {plant.control_dt: 0.002}"
    for count, outcomes in ((1, {"ok": 1}), (2, {"ok": 1, "refused": 1})):
        text = f"name: trial\nscenario: tiny.yaml\nepisodes: {count}\n{periods}\n"
        (here / "periods.yaml").write_text(text)
        assert main(["campaign", "periods.yaml", "--out", "o", "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["outcomes"] == outcomes


BAD = {
    "no file": (["nowhere.yaml"], "nowhere.yaml"),
    "field that does not exist": (["wrong.yaml"], "choices: friction"),
    "words that are no command": (["statu", "nowhere"], "replay FOLDER NUMBER"),
    "too many words": (["a", "b", "c", "d"], "replay FOLDER NUMBER"),
    "no campaign in the folder": (["status", "."], "campaign.json"),
    "replay of nothing": (["replay", ".", "0"], "campaign.json"),
    "replay of no number": (["replay", "o", "x"], "0, 1, 2"),
    "replay of an episode without result": (["replay", "o", "7"], "got 7"),
    "folder of another campaign": (["other.yaml", "--out", "o"], "another campaign"),
    "folder that is a file": (["trial.yaml", "--out", "tiny.yaml"], "writable"),
    "no workers": (["trial.yaml", "--out", "n", "--workers", "0"], "got 0"),
    "no scheduler": (["trial.yaml", "--scheduler", "nonsense"], "no scheduler there"),
    "scheduler and workers": (["trial.yaml", "--scheduler", "x", "--workers", "2"], "--workers"),
    "slurm without a number": (["trial.yaml", "--slurm"], "--workers N"),
    "no slurm": (["trial.yaml", "--slurm", "--workers", "2"], "no command sbatch"),
    "scenario that does not fit its robot": (["arm.yaml"], "left_sole"),
}


@pytest.mark.parametrize("case", BAD)
@pytest.mark.usefixtures("finished")
def test_bad_input_is_one_line_and_status_two(here, capsys, case):
    (here / "wrong.yaml").write_text(CAMPAIGN.replace("mass_scale", "fricton"))
    (here / "other.yaml").write_text(CAMPAIGN.replace("0.9", "0.8"))
    stand = "{contacts: [{surface: {frame: left_sole}}]}"
    (here / "arm.yaml").write_text(CAMPAIGN + f"set: {{robot: arm6, stack: {stand}}}\n")
    arguments, word = BAD[case]
    assert main(["campaign", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    one_line(err)
    assert word in err


def test_without_the_extra_the_command_that_installs_it_is_said(here, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    assert main(["campaign", "trial.yaml"]) == 2
    err = capsys.readouterr().err
    one_line(err)
    assert 'pip install "poise[campaign]"' in err


def test_a_full_disk_is_one_line_and_nothing_recorded_is_lost(here, capsys, monkeypatch):
    add = campaigns.CampaignFolder.add

    def full(folder, row):
        if row["number"] == 1:
            raise OSError(errno.ENOSPC, "No space left on device")
        add(folder, row)

    monkeypatch.setattr(campaigns.CampaignFolder, "add", full)
    assert main(["campaign", "trial.yaml", "--out", "o"]) == 2
    one_line(capsys.readouterr().err)
    monkeypatch.undo()
    assert main(["campaign", "status", str(here / "o"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["done"] == 1


def test_a_real_process_stops_at_ctrl_c_and_goes_on(tmp_path):
    """Ctrl-C reaches the workers too, as in a terminal, and they leave it to the parent."""
    (tmp_path / "tiny.yaml").write_text(TINY)
    (tmp_path / "trial.yaml").write_text(CAMPAIGN.replace("episodes: 2", "episodes: 40"))
    command = [sys.executable, "-m", "poise", "campaign", "trial.yaml", "--out", "o"]
    with subprocess.Popen(
        [*command, "--workers", "1"],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as first:
        rows = tmp_path / "o" / "rows.jsonl"
        # The last row may be under way.
        until(lambda: rows.exists() and rows.read_bytes().count(b"\n") > 1, first)
        os.killpg(first.pid, signal.SIGINT)
        out, err = first.communicate(timeout=30.0)
    assert first.returncode == 1, err
    assert err.splitlines()[-1] == "interrupted; the same command goes on from here"
    done = int(out.split()[1])
    assert 1 <= done < 40
    assert f"ok        {done}\n" in out


def workers_of(parent):
    """Ids of a process's workers, which may be starting."""
    children = Path(f"/proc/{parent.pid}/task/{parent.pid}/children")
    # Threads start them, and are listed apart.
    found = [p.read_text().split() for p in children.parents[1].glob("*/children")]
    pids = [int(pid) for own in found for pid in own]
    return [p for p in pids if b"spawn_main" in Path(f"/proc/{p}/cmdline").read_bytes()]


def until(condition, parent):
    deadline = time.monotonic() + 120.0
    while not condition():
        assert parent.poll() is None, "the campaign has ended too early"
        assert time.monotonic() < deadline
        time.sleep(0.005)


def without_times(rows):
    return [{name: v for name, v in row.items() if name not in TIMINGS} for row in rows]


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_killed_workers_and_a_killed_parent_leave_the_rows_of_a_campaign_in_peace(tmp_path):
    """One worker is killed while it starts, one in the middle, then the parent."""
    (tmp_path / "tiny.yaml").write_text(TINY.replace("0.04", "0.1"))
    (tmp_path / "trial.yaml").write_text(CAMPAIGN.replace("episodes: 2", "episodes: 16"))
    command = [sys.executable, "-m", "poise", "campaign", "trial.yaml", "--json", "--workers"]
    quiet = {"cwd": tmp_path, "stdout": subprocess.DEVNULL}

    def rows():
        return campaigns.CampaignFolder(tmp_path / "o").rows

    with subprocess.Popen([*command, "2", "--out", "o"], **quiet) as parent:
        until(lambda: workers_of(parent), parent)
        os.kill(workers_of(parent)[0], signal.SIGKILL)
        until(lambda: len(rows()) >= 3, parent)
        os.kill(workers_of(parent)[0], signal.SIGKILL)
        until(lambda: len(rows()) >= 6, parent)
        parent.kill()
    before = rows()
    assert 6 <= len(before) < 16
    subprocess.run([*command, "2", "--out", "o"], check=True, **quiet)
    subprocess.run([*command, "1", "--out", "peace"], check=True, **quiet)
    after = campaigns.read_rows(tmp_path / "o")
    assert [row["number"] for row in after] == list(range(16))
    assert all(rows()[number] == row for number, row in before.items())
    assert without_times(after) == without_times(campaigns.read_rows(tmp_path / "peace"))
