"""A campaign's folder: nothing recorded is lost, nothing of two campaigns is mixed."""

import subprocess
import sys

import episodes
import pytest

pytest.importorskip("mujoco")
pytest.importorskip("pyarrow")

import pyarrow.parquet as pq

from poise.apps.campaigns import CampaignFolder, read_rows
from poise.errors import ConfigurationError, PoiseError

CONTENT = {
    "campaign": {"name": "c", "episodes": 3},
    "scenario": {"name": "s"},
    "robots": {"/r.urdf": "aa"},
}


def rows(count, **more):
    return [episodes.row(job) | more for job in episodes.jobs(count)]


def filled(path, rows):
    folder = CampaignFolder(path)
    with folder.claimed(CONTENT):
        for row in rows:
            folder.add(row)
    return folder


def test_a_row_is_on_the_disk_when_it_is_added_and_all_are_a_table_at_the_end(tmp_path):
    folder = CampaignFolder(tmp_path / "c")
    with folder.claimed(CONTENT):
        for row in rows(3):
            folder.add(row)
        assert CampaignFolder(folder.path).rows == folder.rows
        assert not (folder.path / "episodes").exists()
    assert CampaignFolder(folder.path).rows == {row["number"]: row for row in rows(3)}
    table = pq.read_table(folder.path / "episodes")
    assert table["square"].to_pylist() == [0.0, 1.0, 4.0]


def test_columns_may_be_missing_empty_or_of_several_kinds(tmp_path):
    first, second, third = rows(3)
    filled(
        tmp_path,
        [
            third | {"mode": "auto", "flag": True},
            first | {"gain": 1, "error": None},
            second | {"gain": 0.5, "error": 0.1, "mode": 1},
        ],
    )
    for found, mode in (
        (read_rows(tmp_path), 1),
        (pq.read_table(tmp_path / "episodes").to_pylist(), "1"),
    ):
        assert [row["number"] for row in found] == [0, 1, 2]
        assert [row["gain"] for row in found] == [1.0, 0.5, None]
        assert [row["error"] for row in found] == [None, 0.1, None]
        assert [row["mode"] for row in found] == [None, mode, "auto"]
        assert [row["flag"] for row in found] == [None, None, True]


def test_a_row_that_was_not_finished_is_passed_over_and_cut_off(tmp_path):
    first, second = rows(2)
    filled(tmp_path, [first, second])
    log = tmp_path / "rows.jsonl"
    log.write_bytes(log.read_bytes()[:-5])
    assert [*CampaignFolder(tmp_path).rows] == [0]
    filled(tmp_path, [second])
    assert [*CampaignFolder(tmp_path).rows.values()] == [first, second]
    assert pq.read_table(tmp_path / "episodes").num_rows == 2


@pytest.mark.parametrize(
    ("other", "words"),
    [
        ({"campaign": {"name": "d"}}, ("another campaign", "'name' differs", "got 'd'", "'c'")),
        ({"scenario": {"name": "s", "seed": 1}}, ("another scenario", "'seed' differs", "got 1")),
        ({"robots": {"/r.urdf": "bb"}}, ("another robot", "'/r.urdf' differs", "got 'bb'", "'aa'")),
    ],
)
def test_a_folder_of_another_campaign_is_refused(tmp_path, other, words):
    folder = filled(tmp_path, rows(1))
    with pytest.raises(ConfigurationError) as error, folder.claimed(CONTENT | other):
        pass
    assert all(word in str(error.value) for word in words)
    assert folder.content() == CONTENT


RUN = """
import sys
from pathlib import Path

from poise.apps.campaigns import CampaignFolder
with CampaignFolder(Path(sys.argv[1])).claimed({"campaign": {}, "scenario": {}}):
    print("has it", flush=True)
    sys.stdin.read()
"""


def test_two_runs_cannot_have_one_folder_until_the_first_is_gone(tmp_path):
    first = subprocess.Popen(
        [sys.executable, "-c", RUN, str(tmp_path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    content = {"campaign": {}, "scenario": {}}
    with first:
        assert first.stdout.readline() == "has it\n"
        folder = CampaignFolder(tmp_path)
        with pytest.raises(ConfigurationError) as error, folder.claimed(content):
            pass
        assert f"process {first.pid} on" in str(error.value)
        assert folder.pace(3)["running"]
        first.kill()
    assert not folder.pace(3)["running"]
    with folder.claimed(content):
        pass


def test_folders_without_a_campaign_damaged_ones_and_those_of_earlier_forms_are_said(tmp_path):
    with pytest.raises(ConfigurationError, match="no campaign in this folder"):
        CampaignFolder(tmp_path).content()
    with pytest.raises(ConfigurationError, match="no campaign in this folder"):
        read_rows(tmp_path)
    (tmp_path / "rows.jsonl").write_bytes(b"no row\n")
    with pytest.raises(PoiseError, match="cannot read results .*rows.jsonl"):
        CampaignFolder(tmp_path)
    (tmp_path / "rows.jsonl").unlink()
    (tmp_path / "episodes").mkdir()
    (tmp_path / "episodes" / "part-00000000.parquet").touch()
    with pytest.raises(ConfigurationError, match="of an earlier form.*another --out"):
        CampaignFolder(tmp_path)
