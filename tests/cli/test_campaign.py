"""`poise campaign`: run, status, replay; exit status, and one clean line for bad input."""

import errno
import json
import os
import shutil
import signal
import subprocess
import sys
import time

import pytest

pytest.importorskip("mujoco")
pytest.importorskip("pyarrow")
pytest.importorskip("distributed")

import poise
from poise.apps import campaigns
from poise.apps.campaigns import LocalWorkers
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


def write_campaign(folder, text=CAMPAIGN):
    (folder / "tiny.yaml").write_text(TINY)
    (folder / "trial.yaml").write_text(text)


@pytest.fixture
def here(in_folder, monkeypatch):
    """A folder with a campaign, to work in."""
    write_campaign(in_folder)
    monkeypatch.setattr(campaigns, "LocalWorkers", InPlace)
    return in_folder


@pytest.fixture(scope="module")
def _finished(tmp_path_factory):
    """What the campaign leaves behind; made once."""
    folder = tmp_path_factory.mktemp("finished")
    write_campaign(folder)
    campaigns.run_campaign(folder / "trial.yaml", folder / "o", InPlace(1))
    return folder / "o"


@pytest.fixture
def finished(_finished, here):
    """The campaign's results, in the folder `o`."""
    shutil.copytree(_finished, here / "o")
    return here / "o"


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


def test_a_replay_with_other_figures_says_so(finished, capsys, monkeypatch):
    monkeypatch.setattr(campaigns, "row_of", lambda job, run: {"com_error_max_m": 1.0})
    assert main(["campaign", "replay", "o", "0", "--no-video", "--json"]) == 1
    out, err = capsys.readouterr()
    assert "com_error_max_m" in json.loads(out)["differs"]
    assert err.startswith(f"differs from what version {poise.__version__}+")


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


BAD = {
    "field that does not exist": (["wrong.yaml"], "choices: friction"),
    "too many words": (["a", "b", "c", "d"], "replay FOLDER NUMBER"),
    "replay of nothing": (["replay", ".", "0"], "campaign.json"),
    "replay of no number": (["replay", "o", "x"], "0, 1, 2"),
    "replay of an episode without result": (["replay", "o", "7"], "got 7"),
    "folder of another campaign": (["other.yaml", "--out", "o"], "another campaign"),
    "folder that is a file": (["trial.yaml", "--out", "tiny.yaml"], "writable"),
    "no workers": (["trial.yaml", "--out", "n", "--workers", "0"], "got 0"),
    "scheduler and workers": (["trial.yaml", "--scheduler", "x", "--workers", "2"], "--workers"),
    "slurm without a number": (["trial.yaml", "--slurm"], "--workers N"),
    "no slurm": (["trial.yaml", "--slurm", "--workers", "2"], "no command sbatch"),
    "scenario that does not fit its robot": (["arm.yaml"], "left_sole"),
}


@pytest.mark.parametrize("case", BAD)
@pytest.mark.usefixtures("finished")
def test_bad_input_is_one_line_and_status_two(here, refused, case):
    (here / "wrong.yaml").write_text(CAMPAIGN.replace("mass_scale", "fricton"))
    (here / "other.yaml").write_text(CAMPAIGN.replace("0.9", "0.8"))
    stand = "{contacts: [{surface: {frame: left_sole}}]}"
    (here / "arm.yaml").write_text(CAMPAIGN + f"set: {{robot: arm6, stack: {stand}}}\n")
    arguments, word = BAD[case]
    assert word in refused("campaign", *arguments)


@pytest.mark.usefixtures("here")
def test_without_the_extra_the_command_that_installs_it_is_said(refused, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    assert 'pip install "poise[campaign]"' in refused("campaign", "trial.yaml")


def test_a_full_disk_is_one_line_and_nothing_recorded_is_lost(here, refused, capsys, monkeypatch):
    add = campaigns.CampaignFolder.add

    def full(folder, row):
        if row["number"] == 1:
            raise OSError(errno.ENOSPC, "No space left on device")
        add(folder, row)

    monkeypatch.setattr(campaigns.CampaignFolder, "add", full)
    assert "No space left" in refused("campaign", "trial.yaml", "--out", "o")
    monkeypatch.undo()
    assert main(["campaign", "status", str(here / "o"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["done"] == 1


def test_a_real_process_stops_at_ctrl_c_and_goes_on(tmp_path):
    """Ctrl-C reaches the workers too, as in a terminal, and they leave it to the parent."""
    write_campaign(tmp_path, CAMPAIGN.replace("episodes: 2", "episodes: 40"))
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
        out, err = first.communicate(timeout=280.0)
    assert first.returncode == 1, err
    assert err.splitlines()[-1] == "interrupted; the same command goes on from here"
    done = int(out.split()[1])
    assert 1 <= done < 40
    assert f"ok        {done}\n" in out


def until(condition, parent):
    deadline = time.monotonic() + 120.0
    while not condition():
        assert parent.poll() is None, "the campaign has ended too early"
        assert time.monotonic() < deadline
        time.sleep(0.005)
