"""The log of a live run: it plays again, and is never in the robot's way."""

import builtins
import shutil

import numpy as np
import pytest
from operators import drive, wait_for

pytest.importorskip("websockets")
pytest.importorskip("mujoco")

from poise.apps.live import _log as logs
from poise.apps.live._inputs import OperatorInputs
from poise.apps.live._leads import FootLead
from poise.apps.live._log import Takes
from poise.apps.live._loop import LiveLoop, PushOrder, Reset
from poise.apps.teleoperation import (
    VELOCITY_TELEOP_PLANT,
    RecordingError,
    read_recording,
    replay_teleop,
    run_teleop,
)
from poise.errors import ConfigurationError
from poise.locomotion import Mode, OperatorSample, ScriptedDevice, StepTeleoperator


@pytest.fixture
def lead(get_robot):
    return FootLead(get_robot("biped20"), OperatorInputs(), VELOCITY_TELEOP_PLANT)


@pytest.fixture
def loop(start):
    return start()


def test_a_run_leaves_a_log_that_agrees_with_its_replay(loop, tmp_path):
    pytest.importorskip("mcap")
    from log_topics import read_topics

    from poise.sim import read_log

    drive(loop, OperatorSample(lift=(False, True)), lambda s: s.mode is Mode.SL, "the lift")
    drive(loop, OperatorSample(), lambda s: s.mode is Mode.D, "double support")
    loop.stop()
    assert not loop.takes.problem
    log = read_log(tmp_path / "takes" / "take-001.mcap")
    assert log.complete
    assert log.metadata["robot"] == "biped20"
    assert [mode for _, mode in log.notes("mode")] == ["D", "TL", "SL", "D"]
    topics = read_topics(tmp_path / "takes" / "take-001.mcap")
    modes = [message["value"] for _, message in topics["/mode"]]
    assert modes == ["D", "TL", "SL", "D"]
    assert {"/joints", "/tf", "/scene", "/signals"} <= set(topics)
    times, references = log.signal("zmp_reference")
    run = replay_teleop(read_recording(tmp_path / "takes" / "take-001.mcap"))
    at = np.round(times / VELOCITY_TELEOP_PLANT.control_dt).astype(int) - 1
    kept = at < len(run.log)
    assert kept.sum() > 10
    # From the controller's world to the simulator's it is the drift of the stance foot.
    np.testing.assert_allclose(references[kept], run.log.zmp_reference[at[kept]], atol=5e-3)
    _, commands = log.signal("command_velocity")
    np.testing.assert_allclose(commands[kept], run.log.command[at[kept]], atol=1e-12)


def test_without_the_package_the_run_goes_on_and_says_so(loop, tmp_path, monkeypatch):
    real = builtins.__import__

    def missing(name, *rest, **more):
        if name.startswith("mcap"):
            raise ModuleNotFoundError(name)
        return real(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", missing)
    drive(loop, OperatorSample(), lambda s: s.time > 0.3, "some time")
    loop.stop()
    assert loop.error is None
    assert "not recorded" in loop.takes.name
    assert "mcap" in loop.takes.name
    assert list((tmp_path / "takes").iterdir()) == []


def test_a_log_that_cannot_be_made_costs_nothing_but_itself(loop, tmp_path):
    (tmp_path / "takes" / "take-001.mcap").mkdir()
    drive(loop, OperatorSample(), lambda s: s.time > 0.3, "some time")
    loop.stop()
    assert loop.error is None
    assert "take-001.mcap" in loop.takes.name
    shutil.rmtree(tmp_path / "takes" / "take-001.mcap")


def test_a_full_folder_ends_what_is_recorded_and_not_the_run(lead, tmp_path, monkeypatch):
    monkeypatch.setattr(logs, "_LOOK_EVERY", 0.0)
    takes = Takes(tmp_path, most_bytes=60_000)
    loop = LiveLoop(lead, takes)
    loop.start()
    wait_for(lambda: loop.snapshot, "the first picture")
    drive(loop, OperatorSample(), lambda s: "is full" in s.take, "the folder to be full")
    now = loop.snapshot.time
    drive(loop, OperatorSample(), lambda s: s.time > now + 1.0, "the run to go on")
    held = {path.name: path.stat().st_size for path in tmp_path.iterdir()}
    assert sum(held.values()) < 400_000
    with pytest.raises(ConfigurationError, match="is full"):
        takes.keep()
    # What there is, is finished; and a reset begins nothing more.
    assert len(read_recording(tmp_path / "take-001.mcap").samples) > 10
    loop.order(Reset())
    wait_for(lambda: loop.snapshot.time < now, "the reset")
    drive(loop, OperatorSample(), lambda s: s.time > 0.5, "some time")
    loop.stop()
    assert loop.error is None
    assert {path.name for path in tmp_path.iterdir()} == set(held)


def test_a_file_that_can_be_written_no_more_costs_the_recording_and_not_the_run(
    loop, tmp_path, monkeypatch
):
    def full(*_):
        raise OSError(28, "No space left on device")

    drive(loop, OperatorSample(), lambda s: s.time > 1.0, "some time")
    monkeypatch.setattr(loop.takes._recorder._log._writer, "flush", full)
    drive(loop, OperatorSample(), lambda s: "No space left" in s.take, "the loss to be told")
    now = loop.snapshot.time
    drive(loop, OperatorSample(), lambda s: s.time > now + 0.2, "the run to go on")
    with pytest.raises(ConfigurationError, match="No space left"):
        loop.takes.keep()
    loop.order(Reset())
    wait_for(lambda: loop.snapshot.time < now, "the reset")
    loop.stop()
    assert loop.error is None
    partial = read_recording(tmp_path / "takes" / "take-001.mcap", allow_partial=True)
    assert len(partial.samples) > 2


def test_a_folder_that_is_gone_costs_the_recording_and_not_the_run(loop, tmp_path, monkeypatch):
    monkeypatch.setattr(logs, "_LOOK_EVERY", 0.0)
    drive(loop, OperatorSample(), lambda s: s.time > 0.2, "some time")
    shutil.rmtree(tmp_path / "takes")
    drive(loop, OperatorSample(), lambda s: "not recorded" in s.take, "the loss to be told")
    now = loop.snapshot.time
    drive(loop, OperatorSample(), lambda s: s.time > now + 0.2, "the run to go on")
    loop.stop()
    assert loop.error is None


def test_numbers_of_files_that_are_there_are_not_given_again(lead, tmp_path):
    takes = Takes(tmp_path)
    (tmp_path / "take-004.teleop").write_bytes(b"of an earlier version")
    (tmp_path / "take-002.mcap").write_bytes(b"")
    takes.expect(lead)
    takes.end()
    assert takes.path.name == "take-005.mcap"


def test_a_link_to_nothing_in_the_folder_costs_nothing(lead, tmp_path):
    takes = Takes(tmp_path, most_bytes=1000)
    (tmp_path / "latest").symlink_to(tmp_path / "gone")
    (tmp_path / "some").write_bytes(bytes(600))
    takes.expect(lead)
    assert not takes.problem
    (tmp_path / "more").write_bytes(bytes(600))
    takes.expect(lead)
    assert "is full" in takes.problem
    assert takes.name == takes.problem


def test_a_recording_of_another_robot_of_the_same_name_is_not_repeated(get_robot, tmp_path):
    robot, path = get_robot("biped20"), tmp_path / "loaded.mcap"
    device = ScriptedDevice([], *StepTeleoperator(robot).estimator.anchors)
    run_teleop(robot, device, duration=0.02, recording=path)
    heavier = robot.carrying("torso", 3.0)
    with pytest.raises(RecordingError, match="another biped20: masses"):
        replay_teleop(path, heavier)
    recording = read_recording(path)
    assert not recording.is_of(heavier)
    assert recording.setup_for(heavier, "torque") is None
    assert recording.setup_for(robot, "torque") == recording.setup


def test_a_take_that_somebody_has_moved_costs_itself_alone(loop, tmp_path):
    drive(loop, OperatorSample(), lambda s: s.time > 0.2, "some time")
    (tmp_path / "takes" / "take-001.mcap").unlink()
    loop.order(Reset())
    wait_for(lambda: loop.snapshot.time < 0.2, "the reset")
    drive(loop, OperatorSample(), lambda s: s.time > 0.2, "some time")
    loop.stop()
    assert not loop.takes.problem
    assert loop.takes.files == ["take-001.mcap"]


def test_no_copy_is_kept_for_which_there_is_no_room(loop, monkeypatch):
    drive(loop, OperatorSample(), lambda s: s.time > 0.5, "some time")
    size = loop.takes.path.stat().st_size
    monkeypatch.setattr(loop.takes, "_most", 2 * size - 1)
    with pytest.raises(ConfigurationError, match="has no room for it"):
        loop.takes.keep()
    assert loop.takes.files == ["take-001.mcap"]


def test_a_push_before_anybody_drives_is_recorded(loop, tmp_path):
    loop.order(PushOrder("left"))
    wait_for(lambda: loop.snapshot.time > 0.3, "some time")
    loop.stop()
    path = tmp_path / "takes" / "take-001.mcap"
    assert len(read_recording(path).pushes) == 1
    assert replay_teleop(path).plant.time == pytest.approx(read_recording(path).duration)
