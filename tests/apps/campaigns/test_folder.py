"""A campaign's folder: nothing recorded is lost, nothing of two campaigns is mixed."""

import errno
import os
import subprocess
import sys

import episodes
import pytest

pytest.importorskip("mujoco")
pytest.importorskip("pyarrow")

import pyarrow.parquet as pq

from poise.apps.campaigns import CampaignFolder, Job, RowLog, read_rows
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


def test_numbers_are_kept_to_the_last_bit(tmp_path):
    values = [0.1 + 0.2, 1e-308, 5e300, float("inf"), -0.0, 2**62 + 1]
    filled(tmp_path, [rows(1)[0] | {f"x{i}": value for i, value in enumerate(values)}])
    (found,) = CampaignFolder(tmp_path).rows.values()
    assert [repr(found[f"x{i}"]) for i in range(len(values))] == [repr(v) for v in values]


def test_a_row_that_is_not_there_is_said(tmp_path):
    (row,) = rows(1)
    folder = filled(tmp_path, [row])
    assert folder.row(0) == row
    with pytest.raises(ConfigurationError, match="no result; got 7; wanted one of the 1 numbers"):
        folder.row(7)


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


def test_a_full_disk_costs_the_row_that_is_written_and_no_other(tmp_path, monkeypatch):
    def full(_):
        raise OSError(errno.ENOSPC, "No space left on device")

    first, second = rows(2)
    log = RowLog(tmp_path / "rows.jsonl")
    log.add(first)
    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        with pytest.raises(OSError, match="No space left"):
            log.add(second)
    assert RowLog(tmp_path / "rows.jsonl").rows == log.rows == [first]
    log.add(second)
    assert RowLog(tmp_path / "rows.jsonl").rows == [first, second]


LIMITED = """
import resource, sys
from pathlib import Path
from poise.apps.campaigns import RowLog
log = RowLog(Path(sys.argv[1]))
log.add({"number": 0})
resource.setrlimit(resource.RLIMIT_FSIZE, (20, 20))
try:
    log.add({"number": 1})
except OSError as error:
    print(type(error).__name__)
"""


def test_a_row_for_a_part_of_which_there_is_room_is_not_kept(tmp_path):
    path = tmp_path / "rows.jsonl"
    done = subprocess.run([sys.executable, "-c", LIMITED, path], capture_output=True, text=True)
    assert done.stdout == "OSError\n", done.stderr
    assert path.read_text() == '{"number": 0}\n'


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


def test_a_campaign_may_be_made_longer(tmp_path):
    longer = CONTENT | {"campaign": {"name": "c", "episodes": 30}}
    folder = filled(tmp_path, [])
    with folder.claimed(longer):
        assert folder.content() == longer


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


def test_without_pyarrow_rows_are_kept_all_the_same(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    filled(tmp_path, rows(2))
    assert read_rows(tmp_path) == rows(2)
    assert not (tmp_path / "episodes").exists()


def test_the_seeds_and_values_of_a_row_make_its_job_again(tmp_path):
    job = Job(number=4, scenario=episodes.TINY, where="t", values={"duration": 0.1 + 0.2}, seed=9)
    assert job.make().duration == 0.1 + 0.2
    assert job.make().seed == 9
