"""The log of a live run: it plays again, and is never in the robot's way."""

import shutil
import sys

import numpy as np
import pytest

pytest.importorskip("websockets")
pytest.importorskip("mujoco")
pytest.importorskip("mcap")

from log_topics import read_topics

from poise.apps.live import _log as logs
from poise.apps.live._inputs import OperatorInputs
from poise.apps.live._leads import FootLead
from poise.apps.live._log import Takes
from poise.apps.live._loop import PushOrder, Reset
from poise.apps.teleoperation import (
    VELOCITY_TELEOP_PLANT,
    RecordingError,
    read_recording,
    replay_teleop,
)
from poise.errors import ConfigurationError
from poise.locomotion import Mode, OperatorSample
from poise.sim import read_log

REST = OperatorSample()


@pytest.fixture
def loop(start):
    return start()


def pass_time(loop, seconds):
    """Stand for a while with an operator."""
    begin = loop.plant.time
    loop.until(lambda _: loop.plant.time > begin + seconds, "some time", REST)


def test_a_run_leaves_a_log_that_agrees_with_its_replay(loop, tmp_path):
    lift = OperatorSample(lift=(False, True))
    loop.until(lambda s: s.mode is Mode.SL, "the lift", lift)
    loop.until(lambda s: s.mode is Mode.D, "double support", REST)
    loop.stop()
    assert not loop.takes.problem
    path = tmp_path / "takes" / "take-001.mcap"
    log = read_log(path)
    assert log.complete
    assert log.metadata["robot"] == "biped20"
    assert [mode for _, mode in log.notes("mode")] == ["D", "TL", "SL", "D"]
    topics = read_topics(path)
    assert [message["value"] for _, message in topics["/mode"]] == ["D", "TL", "SL", "D"]
    assert {"/joints", "/tf", "/scene", "/signals"} <= set(topics)
    times, references = log.signal("zmp_reference")
    run = replay_teleop(read_recording(path))
    at = np.round(times / VELOCITY_TELEOP_PLANT.control_dt).astype(int) - 1
    kept = at < len(run.log)
    assert kept.sum() > 10
    # From the controller's world to the simulator's it is the drift of the stance foot.
    np.testing.assert_allclose(references[kept], run.log.zmp_reference[at[kept]], atol=5e-3)
    _, commands = log.signal("command_velocity")
    np.testing.assert_allclose(commands[kept], run.log.command[at[kept]], atol=1e-12)


def remove_package(loop, monkeypatch):
    monkeypatch.setitem(sys.modules, "mcap", None)
    monkeypatch.setitem(sys.modules, "mcap.writer", None)


def take_its_place(loop, monkeypatch):
    (loop.takes.folder / "take-001.mcap").mkdir()


def remove_folder(loop, monkeypatch):
    pass_time(loop, 0.2)
    shutil.rmtree(loop.takes.folder)


def fill_disk(loop, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    pass_time(loop, 0.2)
    monkeypatch.setattr(loop.takes._recorder._log._writer, "flush", full)


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        (remove_package, "mcap"),
        (take_its_place, "take-001.mcap"),
        (remove_folder, "takes"),
        (fill_disk, "No space left"),
    ],
)
def test_a_log_that_cannot_be_written_costs_the_recording_and_not_the_run(
    start, tmp_path, monkeypatch, fault, words
):
    monkeypatch.setattr(logs, "_LOOK_EVERY", 0.0)
    loop = start()
    fault(loop, monkeypatch)
    loop.until(lambda s: "not recorded" in s.take and words in s.take, "the loss to be told", REST)
    pass_time(loop, 0.2)
    with pytest.raises(ConfigurationError, match=words):
        loop.takes.keep()
    loop.order(Reset())
    loop.until(lambda s: s.time < 0.2, "the reset")


def test_a_full_folder_ends_what_is_recorded_and_not_the_run(start, tmp_path, monkeypatch):
    monkeypatch.setattr(logs, "_LOOK_EVERY", 0.0)
    loop = start(most_bytes=60_000)
    loop.until(lambda s: "is full" in s.take, "the folder to be full", REST)
    pass_time(loop, 1.0)
    held = {path.name: path.stat().st_size for path in (tmp_path / "takes").iterdir()}
    assert sum(held.values()) < 400_000
    with pytest.raises(ConfigurationError, match="is full"):
        loop.takes.keep()
    # What there is, is finished; and a reset begins nothing more.
    assert len(read_recording(tmp_path / "takes" / "take-001.mcap").samples) > 10
    loop.order(Reset())
    loop.until(lambda s: s.time < 0.1, "the reset")
    pass_time(loop, 0.5)
    loop.stop()
    assert {path.name for path in (tmp_path / "takes").iterdir()} == set(held)


def test_a_link_to_nothing_in_the_folder_costs_nothing_and_no_number_is_given_again(
    get_robot, tmp_path
):
    lead = FootLead(get_robot("biped20"), OperatorInputs(), VELOCITY_TELEOP_PLANT)
    takes = Takes(tmp_path, most_bytes=1000)
    (tmp_path / "latest").symlink_to(tmp_path / "gone")
    (tmp_path / "take-004.part").write_bytes(bytes(600))
    (tmp_path / "take-002.mcap").write_bytes(b"")
    takes.expect(lead)
    assert not takes.problem
    assert takes.name == "take-005.mcap"
    (tmp_path / "more").write_bytes(bytes(600))
    takes.expect(lead)
    assert "is full" in takes.problem
    assert takes.name == takes.problem


def test_what_a_killed_run_has_left_can_be_read_and_a_copy_is_kept(loop, tmp_path):
    path = tmp_path / "takes" / "take-001.mcap"

    def readable(_):
        # As the disk has it if the process were gone now: the writer may be behind.
        return path.exists() and path.stat().st_size > 10_000

    pass_time(loop, 1.0)
    loop.until(readable, "what is written", REST)
    (tmp_path / "left.mcap").write_bytes(path.read_bytes())
    with pytest.raises(RecordingError, match="not finished"):
        read_recording(tmp_path / "left.mcap")
    assert read_recording(tmp_path / "left.mcap", allow_partial=True).samples[-1][0] > 10
    kept = loop.takes.keep()
    assert kept.name == "kept-001.mcap"
    assert len(read_recording(kept).samples) > 10
    pass_time(loop, 0.1)
    loop.takes._most = path.stat().st_size + kept.stat().st_size
    with pytest.raises(ConfigurationError, match="has no room for it"):
        loop.takes.keep()
    assert loop.takes.files == ["kept-001.mcap", "take-001.mcap"]


def test_a_push_before_anybody_drives_is_recorded(loop, tmp_path):
    loop.order(PushOrder("left"))
    loop.until(lambda s: s.time > 0.3, "some time")
    loop.stop()
    path = tmp_path / "takes" / "take-001.mcap"
    assert len(read_recording(path).pushes) == 1
    assert replay_teleop(path).plant.time == pytest.approx(read_recording(path).duration)
