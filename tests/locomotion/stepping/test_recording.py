"""Recordings: replay bit for bit, and what is wrong with a file is said."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest
from walker import hands, sample, up_and_down, walk

from poise.apps.teleoperation import (
    TORQUE_TELEOP_PLANT,
    VELOCITY_TELEOP_PLANT,
    BadOperator,
    RecordedDevice,
    RecordedPush,
    RecordingError,
    read_recording,
    replay_teleop,
    run_teleop,
    write_recording,
)
from poise.errors import ConfigurationError, UnknownNameError
from poise.locomotion import StepTeleoperator
from poise.sim import RunRecord, SensorConfig, read_log, write_log


def device_of(robot, *points):
    """A device by way-points, without a run."""
    return hands(*points)(StepTeleoperator(robot, actuation="velocity"))


def write(path, samples=3, robot="biped20", dt=0.005, **more):
    given = [(tick, sample(tick * dt)) for tick in range(samples)]
    write_recording(path, given, robot=robot, dt=dt, **more)
    return path


def cut(path, size):
    """As a disk has it, of a run that died."""
    path.write_bytes(path.read_bytes()[:size])
    return path


@pytest.mark.parametrize("seed", [None, 5], ids=["script", "bad operator with noise"])
def test_a_recording_replays_bit_for_bit(get_robot, tmp_path, seed):
    robot, path = get_robot("biped20"), tmp_path / "run.mcap"
    if seed is None:
        run = walk(robot, up_and_down(lift=0.1, lower=0.8), 1.8, recording=path)
    else:
        run = run_teleop(
            robot,
            lambda c: BadOperator(c, seed),
            VELOCITY_TELEOP_PLANT.with_noise(),
            duration=2.0,
            seed=seed,
            recording=path,
        )
    for again in (replay_teleop(path), replay_teleop(run.record)):
        assert np.array_equal(run.log.command, again.log.command)
        assert np.array_equal(run.log.q, again.log.q)


def test_the_log_of_another_run_is_no_recording(tmp_path):
    write_log(RunRecord({"robot": "biped20"}), tmp_path / "log.mcap")
    with pytest.raises(RecordingError, match=r"log\.mcap is no recording of a teleoperated run"):
        read_recording(tmp_path / "log.mcap")


def test_gaps_stay_gaps(tmp_path):
    path = tmp_path / "gap.mcap"
    write_recording(path, [(0, sample(0.0)), (200, sample(1.0))], robot="biped20", dt=0.005)
    device = RecordedDevice(read_recording(path))
    given = [device.sample(tick * 0.005) for tick in range(202)]
    assert [i for i, s in enumerate(given) if s is not None] == [0, 200]


def test_nan_and_times_that_go_backwards_come_through_to_the_guard(tmp_path):
    path = tmp_path / "bad.mcap"
    nowhere = sample(6.0, (np.nan, -0.0, np.inf), np.zeros(3))
    given = enumerate((sample(5.0), sample(1.0), nowhere))
    write_recording(path, given, robot="biped20", dt=0.005)
    device = RecordedDevice(read_recording(path))
    assert [device.sample(t * 0.005).time for t in range(2)] == [5.0, 1.0]
    last = device.sample(0.01)
    np.testing.assert_array_equal(last.place(0), nowhere.place(0))
    assert np.signbit(last.place(0)[1])


def test_pushes_are_kept(tmp_path):
    path = tmp_path / "push.mcap"
    pushes = [RecordedPush(1, (50.0, 0.0, 0.0), 0.1)]
    write_recording(path, [], robot="biped20", dt=0.005, pushes=pushes)
    recording = read_recording(path)
    device = RecordedDevice(recording)
    assert device.sample(0.0) is None
    assert device.sample(0.005) is None
    assert recording.pushes == pushes


def test_a_truncated_file_says_so_and_can_be_read_in_part(tmp_path):
    path = write(tmp_path / "cut.mcap")
    cut(path, len(path.read_bytes()) - 10)
    with pytest.raises(RecordingError, match="not finished.*allow_partial"):
        read_recording(path)
    partial = read_recording(path, allow_partial=True)
    assert len(partial.samples) == 3
    assert partial.duration == pytest.approx(0.015)


def test_ticks_that_go_backwards_are_an_error(tmp_path):
    path = tmp_path / "back.mcap"
    given = [(tick, sample(tick * 0.005)) for tick in (0, 5, 4)]
    write_recording(path, given, robot="biped20", dt=0.005)
    with pytest.raises(RecordingError, match="number 2 of the samples.*backwards"):
        read_recording(path)


def test_another_robot_does_not_repeat_a_run(get_robot, tmp_path):
    path = tmp_path / "run.mcap"
    walk(get_robot("biped20"), up_and_down(), 0.02, recording=path)
    with pytest.raises(RecordingError, match="another robot.*'biped20'.*humanoid33"):
        replay_teleop(path, get_robot("humanoid33"))


@pytest.mark.parametrize(
    "content",
    [b"", b"hello", b"\xff\xfe" * 100, b"{}", b"\x89MCAP0\r\n" * 20, b"[" * 20000],
    ids=["empty", "text", "binary", "json", "magic", "nested"],
)
def test_what_is_no_recording_is_said(tmp_path, content):
    path = tmp_path / "no.mcap"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=r"no\.mcap"):
        read_recording(path)


def test_a_file_that_is_not_there_is_said(tmp_path):
    with pytest.raises(RecordingError, match="does not exist"):
        read_recording(tmp_path / "nowhere.mcap")


@pytest.mark.parametrize(
    ("topic", "content"),
    [
        ("operator", b""),
        ("operator", b"\xff" * 20),
        ("operator", msgspec.msgpack.encode((0, {"time": 0.0, "left": [0.0], "right": "x"}))),
        ("operator", msgspec.msgpack.encode((0, {"time": "now", "left": [0.0] * 3}))),
        ("operator", msgspec.msgpack.encode((-3, {}))),
        ("push", msgspec.msgpack.encode((0, (1.0, 2.0), 0.1))),
        ("push", msgspec.msgpack.encode((2**60, (1.0, 2.0, 3.0), 0.1))),
    ],
)
def test_messages_that_cannot_be_are_said(tmp_path, topic, content):
    path = write(tmp_path / "odd.mcap")
    record = read_log(path)
    record.message(1.0, topic, content)
    write_log(record, path)
    with pytest.raises(RecordingError, match=r"number \d of the \w+ of odd\.mcap cannot be"):
        read_recording(path)


@pytest.mark.parametrize(
    "plant", [VELOCITY_TELEOP_PLANT, TORQUE_TELEOP_PLANT], ids=["velocity", "torque"]
)
def test_a_run_with_late_sensors_replays_bit_for_bit(get_robot, tmp_path, plant):
    """A sample belongs to the tick at which it came, whatever the robot's time was then."""
    run = run_teleop(
        get_robot("biped20"),
        lambda c: BadOperator(c, 3),
        replace(plant, sensors=SensorConfig(delay=0.01)),
        duration=0.6,
        recording=tmp_path / "late.mcap",
    )
    again = replay_teleop(tmp_path / "late.mcap")
    np.testing.assert_array_equal(run.log.command, again.log.command)
    np.testing.assert_array_equal(run.log.devices, again.log.devices)


def test_a_run_that_died_is_replayed_as_far_as_it_goes(get_robot, tmp_path):
    path = tmp_path / "run.mcap"
    run = walk(get_robot("biped20"), up_and_down(), 0.2, recording=path)
    # The end of the file, which says how long the run was.
    cut(path, path.read_bytes().rindex(b"duration") - 40)
    rest = read_recording(path, allow_partial=True)
    assert rest.duration == pytest.approx(0.2)
    np.testing.assert_array_equal(replay_teleop(rest).log.command, run.log.command)


def test_a_robot_that_carries_something_is_another_one(get_robot, tmp_path):
    robot, path = get_robot("humanoid33"), tmp_path / "loaded.mcap"
    loaded = robot.carrying("right_hand", 2.0)
    run = walk(loaded, up_and_down(), 0.1, recording=path)
    with pytest.raises(RecordingError, match="another humanoid33: masses.*made with, as `robot`"):
        replay_teleop(path)
    again = replay_teleop(path, loaded)
    np.testing.assert_array_equal(run.log.command, again.log.command)


@pytest.mark.parametrize("name", ["mona", "mona.urdf", "humanoid99"])
def test_a_recording_of_a_robot_from_a_file_says_how_to_give_it(
    get_robot, tmp_path, monkeypatch, name
):
    robot, path = replace(get_robot("biped20"), name=name), tmp_path / "x.mcap"
    run = walk(robot, up_and_down(), 0.1, recording=path)
    # No file is opened by a name that a stranger may have written.
    monkeypatch.chdir(tmp_path)
    (tmp_path / name).write_text(robot.source.text)
    with pytest.raises(UnknownNameError, match="not in the catalog") as refused:
        replay_teleop(path)
    for words in (
        "recording x.mcap",
        f"got {name!r}",
        'robot=load_robot("FILE")',
        "--robot FILE",
    ):
        assert words in str(refused.value)
    np.testing.assert_array_equal(run.log.command, replay_teleop(path, robot).log.command)


def test_a_recording_that_is_played_is_not_written_over(get_robot, tmp_path):
    robot, path = get_robot("biped20"), tmp_path / "run.mcap"
    walk(robot, up_and_down(), 0.1, recording=path)
    before, link = path.read_bytes(), tmp_path / "link.mcap"
    link.symlink_to(path)
    played = read_recording(path)
    device = RecordedDevice(played)
    for file in (path, link):
        with pytest.raises(ConfigurationError, match=r"cannot be written over.*another file"):
            run_teleop(robot, device, VELOCITY_TELEOP_PLANT, duration=0.1, recording=file)
    assert path.read_bytes() == before
