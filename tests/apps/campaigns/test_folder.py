"""A campaign's folder: nothing recorded is lost, nothing of two campaigns is mixed."""

import errno
import subprocess
import sys

import episodes
import pytest

pytest.importorskip("mujoco")
pytest.importorskip("pyarrow")

import pyarrow.parquet as pq

from poise.apps.campaigns import CampaignFolder, Job, _folder
from poise.errors import ConfigurationError, PoiseError

CONTENT = {
    "campaign": {"name": "c", "episodes": 3},
    "scenario": {"name": "s"},
    "robots": {"/r.urdf": "aa"},
}


def rows(count, **more):
    return [episodes.row(job) | more for job in episodes.jobs(count)]


def names(path):
    return sorted(p.name for p in (path / "episodes").iterdir())


def test_a_row_is_on_the_disk_when_it_is_added_and_all_are_one_file_at_the_end(tmp_path):
    folder = CampaignFolder(tmp_path / "c")
    with folder.claimed(CONTENT):
        for row in rows(3):
            folder.add(row)
        assert names(folder.path) == [f"part-{n:08d}.parquet" for n in range(3)]
        assert CampaignFolder(folder.path).rows == folder.rows
    assert names(folder.path) == ["rows-00000001.parquet"]
    assert CampaignFolder(folder.path).rows == {row["number"]: row for row in rows(3)}
    table = pq.read_table(folder.path / "episodes")
    assert table["square"].to_pylist() == [0.0, 1.0, 4.0]


def test_a_row_that_is_not_there_is_said(tmp_path):
    folder, (row,) = CampaignFolder(tmp_path), rows(1)
    with folder.claimed(CONTENT):
        folder.add(row)
    assert folder.row(0) == row
    with pytest.raises(ConfigurationError, match="no result; got 7; wanted one of the 1 numbers"):
        folder.row(7)


def test_many_rows_become_one_file_meanwhile(tmp_path, monkeypatch):
    monkeypatch.setattr(_folder, "_MOST_PARTS", 4)
    folder = CampaignFolder(tmp_path)
    with folder.claimed(CONTENT):
        for row in rows(5):
            folder.add(row)
        assert names(tmp_path) == ["part-00000004.parquet", "rows-00000001.parquet"]
    assert names(tmp_path) == ["rows-00000002.parquet"]
    assert len(CampaignFolder(tmp_path).rows) == 5


def test_columns_may_be_missing_empty_or_of_several_kinds(tmp_path):
    first, second, third = rows(3)
    folder = CampaignFolder(tmp_path)
    with folder.claimed(CONTENT):
        folder.add(first | {"gain": 1, "error": None})
        folder.add(second | {"gain": 0.5, "error": 0.1, "mode": 1})
        folder.add(third | {"mode": "auto", "flag": True})
    found = CampaignFolder(tmp_path).rows
    assert [found[n]["gain"] for n in range(3)] == [1.0, 0.5, None]
    assert [found[n]["error"] for n in range(3)] == [None, 0.1, None]
    assert [found[n]["mode"] for n in range(3)] == [None, "1", "auto"]
    assert found[2]["flag"] is True


def test_a_run_killed_before_parts_are_deleted_leaves_each_row_once(tmp_path, monkeypatch):
    folder = CampaignFolder(tmp_path)
    with folder.claimed(CONTENT):
        for row in rows(2):
            folder.add(row)
        part = (tmp_path / "episodes" / "part-00000001.parquet").read_bytes()
    (tmp_path / "episodes" / "part-00000001.parquet").write_bytes(part)
    (tmp_path / "episodes" / ".part-00000002.parquet.tmp").write_bytes(part[:100])
    assert sorted(CampaignFolder(tmp_path).rows) == [0, 1]
    with CampaignFolder(tmp_path).claimed(CONTENT):
        pass
    assert pq.read_table(tmp_path / "episodes").num_rows == 2


def test_who_looks_on_while_many_files_become_one_sees_every_row(tmp_path, monkeypatch):
    folder, read = CampaignFolder(tmp_path), pq.read_table
    with folder.claimed(CONTENT):
        for row in rows(3):
            folder.add(row)

        def read_late(path):
            monkeypatch.undo()
            folder._compact()
            return read(path)

        monkeypatch.setattr(pq, "read_table", read_late)
        assert sorted(CampaignFolder(tmp_path).rows) == [0, 1, 2]


def test_a_full_disk_costs_the_row_that_is_written_and_no_other(tmp_path, monkeypatch):
    def full(table, path):
        path.write_bytes(b"half")
        raise OSError(errno.ENOSPC, "No space left on device")

    folder = CampaignFolder(tmp_path)
    with folder.claimed(CONTENT):
        folder.add(rows(1)[0])
        monkeypatch.setattr(pq, "write_table", full)
        with pytest.raises(OSError, match="No space left"):
            folder.add(rows(2)[1])
    assert names(tmp_path) == ["part-00000000.parquet"]
    assert sorted(CampaignFolder(tmp_path).rows) == [0]


@pytest.mark.parametrize(
    ("other", "words"),
    [
        ({"campaign": {"name": "d"}}, ("another campaign", "'name' differs", "got 'd'", "'c'")),
        ({"scenario": {"name": "s", "seed": 1}}, ("another scenario", "'seed' differs", "got 1")),
        ({"robots": {"/r.urdf": "bb"}}, ("another robot", "'/r.urdf' differs", "got 'bb'", "'aa'")),
    ],
)
def test_a_folder_of_another_campaign_is_refused(tmp_path, other, words):
    folder = CampaignFolder(tmp_path)
    with folder.claimed(CONTENT):
        folder.add(rows(1)[0])
    with pytest.raises(ConfigurationError) as error, folder.claimed(CONTENT | other):
        pass
    assert all(word in str(error.value) for word in words)
    assert folder.content() == CONTENT


def test_a_campaign_may_be_made_longer(tmp_path):
    longer = CONTENT | {"campaign": {"name": "c", "episodes": 30}}
    folder = CampaignFolder(tmp_path)
    with folder.claimed(CONTENT):
        pass
    with folder.claimed(longer):
        assert folder.content() == longer


def test_a_folder_of_a_version_that_did_not_look_at_robots_is_gone_on_with(tmp_path):
    folder = CampaignFolder(tmp_path)
    with folder.claimed({part: CONTENT[part] for part in ("campaign", "scenario")}):
        pass
    with folder.claimed(CONTENT):
        assert folder.content() == CONTENT


RUN = """
import sys
from pathlib import Path
import pyarrow.parquet as pq

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


def test_a_folder_without_a_campaign_and_damaged_results_are_said(tmp_path):
    with pytest.raises(ConfigurationError, match="no campaign in this folder"):
        CampaignFolder(tmp_path).content()
    (tmp_path / "episodes").mkdir()
    (tmp_path / "episodes" / "part-00000000.parquet").write_bytes(b"no table")
    with pytest.raises(PoiseError, match="cannot read results"):
        CampaignFolder(tmp_path)


def test_the_seeds_and_values_of_a_row_make_its_job_again(tmp_path):
    job = Job(number=4, scenario=episodes.TINY, where="t", values={"duration": 0.1 + 0.2}, seed=9)
    assert job.make().duration == 0.1 + 0.2
    assert job.make().seed == 9
