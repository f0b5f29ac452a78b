"""Recordings: replay bit for bit, and what is wrong with a file is said."""

import json
import time
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from msgspec import structs
from walker import hands, sample, up_and_down, walk

from poise.apps.teleoperation import (
    TORQUE_TELEOP_PLANT,
    VELOCITY_TELEOP_PLANT,
    BadOperator,
    replay_teleop,
    run_teleop,
)
from poise.errors import ConfigurationError, PoiseError, UnknownNameError
from poise.locomotion import (
    DeviceStatus,
    Mode,
    RecordingError,
    RecordingWriter,
    StepTeleoperator,
    read_recording,
)
from poise.locomotion._stepping._operator._recording_format import HEADER_BYTES, ROW
from poise.sim import SensorConfig


def device_of(robot, *points):
    """A device by way-points, without a run."""
    return hands(*points)(StepTeleoperator(robot, actuation="velocity"))


def write(path, rows=3, robot="biped20", dt=0.005, close=True):
    writer = RecordingWriter(path, robot=robot, dt=dt)
    for tick in range(rows):
        writer.sample(tick, sample(tick * dt))
    if close:
        writer.close()
    else:
        writer._file.close()
    return path


@pytest.mark.parametrize("seed", [None, 5], ids=["script", "bad operator with noise"])
def test_a_recording_replays_bit_for_bit(get_robot, tmp_path, seed):
    robot, path = get_robot("biped20"), tmp_path / "run.teleop"
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
    again = replay_teleop(path)
    assert np.array_equal(run.log.command, again.log.command)
    assert np.array_equal(run.log.q, again.log.q)


def test_gaps_stay_gaps(tmp_path):
    path = tmp_path / "gap.teleop"
    with RecordingWriter(path, robot="biped20", dt=0.005) as writer:
        writer.sample(0, sample(0.0))
        writer.sample(200, sample(1.0))
    device = read_recording(path).device(robot="biped20", dt=0.005)
    given = [device.sample(tick * 0.005) for tick in range(202)]
    assert [i for i, s in enumerate(given) if s is not None] == [0, 200]


def test_nan_and_times_that_go_backwards_come_through_to_the_guard(tmp_path):
    path = tmp_path / "bad.teleop"
    with RecordingWriter(path, robot="biped20", dt=0.005) as writer:
        writer.sample(0, sample(5.0))
        writer.sample(1, sample(1.0))
        writer.sample(2, sample(6.0, np.full(3, np.nan), np.zeros(3)))
    device = read_recording(path).device(robot="biped20", dt=0.005)
    assert [device.sample(t * 0.005).time for t in range(3)] == [5.0, 1.0, 6.0]


def test_a_lost_device_brings_the_foot_down(get_robot, tmp_path):
    path = tmp_path / "lost.teleop"
    robot = get_robot("biped20")
    says = device_of(robot, *up_and_down(lift=0.1))
    with RecordingWriter(path, robot="biped20", dt=0.005) as writer:
        for tick in range(240):
            writer.sample(tick, says.sample(0.005 * tick))
    device = read_recording(path).device(robot="biped20", dt=0.005)
    run = run_teleop(robot, device, VELOCITY_TELEOP_PLANT, duration=3.0)
    assert run.log.when(Mode.SL).any()
    assert run.teleoperator.mode is Mode.D
    assert not run.fell


def test_a_walk_with_gaps_and_times_that_go_backwards_ends_on_both_feet(get_robot, tmp_path):
    robot, path = get_robot("biped20"), tmp_path / "bad.teleop"
    says = device_of(robot, *up_and_down(lift=0.1, lower=1.8))
    with RecordingWriter(path, robot="biped20", dt=0.005) as writer:
        for tick in range(640):
            given = says.sample(0.005 * tick)
            # Nothing for 0.6 s while the foot is in the air, then 0.2 s of samples from the past.
            if not 200 <= tick < 320:
                moment = given.time - (1.0 if 340 <= tick < 380 else 0.0)
                writer.sample(tick, structs.replace(given, time=moment))
    run = run_teleop(
        robot,
        read_recording(path).device(robot="biped20", dt=0.005),
        VELOCITY_TELEOP_PLANT,
        duration=3.6,
    )
    seen = {tuple(DeviceStatus)[i] for i in np.unique(run.log.device)}
    assert {DeviceStatus.OK, DeviceStatus.LOST, DeviceStatus.REFUSED} <= seen
    assert run.log.when(Mode.SL).any()
    assert run.teleoperator.mode is Mode.D
    assert not run.fell


def test_pushes_are_kept(tmp_path):
    path = tmp_path / "push.teleop"
    with RecordingWriter(path, robot="biped20", dt=0.005) as writer:
        writer.push(1, np.array([50.0, 0.0, 0.0]), 0.1)
    recording = read_recording(path)
    device = recording.device(robot="biped20", dt=0.005)
    assert device.sample(0.0) is None
    assert device.sample(0.005) is None
    assert recording.pushes == [(1, (50.0, 0.0, 0.0), 0.1)]


def test_ten_million_rows_stay_on_the_disk(tmp_path):
    path = write(tmp_path / "long.teleop", rows=0)
    rows = 10_000_000
    header = json.loads(path.read_bytes()[:HEADER_BYTES]) | {"rows": rows}
    with path.open("r+b") as file:
        file.write(json.dumps(header).encode().ljust(HEADER_BYTES - 1) + b"\n")
        # A sparse file: all rows are at tick zero.
        file.truncate(HEADER_BYTES + rows * ROW.itemsize)
    # Where the disk knows of holes, this takes a page of it.
    assert path.stat().st_blocks * 512 < 1e6
    tracemalloc.start()
    begin = time.perf_counter()
    recording = read_recording(path)
    seconds, peak = time.perf_counter() - begin, tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(recording.rows) == rows
    assert isinstance(recording.rows, np.memmap)
    assert peak < 50e6
    # Every tick is looked at once: some tenths of a second where nothing else runs.
    assert seconds < 20.0


def test_a_truncated_file_says_so_and_can_be_read_in_part(tmp_path):
    path = write(tmp_path / "cut.teleop")
    path.write_bytes(path.read_bytes()[:-10])
    with pytest.raises(RecordingError, match="truncated.*allow_partial"):
        read_recording(path)
    assert len(read_recording(path, allow_partial=True).rows) == 2


def test_a_run_that_died_leaves_what_it_had(tmp_path):
    path = write(tmp_path / "died.teleop", close=False)
    with pytest.raises(RecordingError, match="unfinished"):
        read_recording(path)
    assert len(read_recording(path, allow_partial=True).rows) == 3


def test_ticks_that_go_backwards_are_an_error(tmp_path):
    path = tmp_path / "back.teleop"
    with RecordingWriter(path, robot="biped20", dt=0.005) as writer:
        for tick in (0, 5, 4):
            writer.sample(tick, sample(tick * 0.005))
    with pytest.raises(RecordingError, match="row 2 .*backwards"):
        read_recording(path)


def test_another_robot_and_another_tick_are_refused(tmp_path):
    recording = read_recording(write(tmp_path / "g1.teleop", robot="g1"))
    with pytest.raises(RecordingError, match="another robot.*'g1'.*biped20"):
        recording.device(robot="biped20", dt=0.005)
    with pytest.raises(RecordingError, match="0.005 s"):
        recording.device(robot="g1", dt=0.002)


@pytest.mark.parametrize(
    "content",
    [b"", b"hello", b"\xff\xfe" * 100, b"{}", b'{"format": "poise teleoperation", "version": 9}',
     b'{"format": "poise teleoperation", "version": 1, "robot": 3}'],
    ids=["empty", "text", "binary", "json", "version", "header"],
)  # fmt: skip
def test_what_is_no_recording_is_said(tmp_path, content):
    path = tmp_path / "no.teleop"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=r"no\.teleop"):
        read_recording(path)


def test_a_file_that_is_not_there_is_said(tmp_path):
    with pytest.raises(RecordingError, match="No such file"):
        read_recording(tmp_path / "nowhere.teleop")


def test_a_recording_without_the_set_up_of_a_run_cannot_be_run_again(get_robot, tmp_path):
    get_robot("biped20")
    with pytest.raises(RecordingError, match="set-up"):
        replay_teleop(write(tmp_path / "bare.teleop"))


def test_a_set_up_that_is_no_json_is_refused(tmp_path):
    with pytest.raises(ConfigurationError, match="JSON"):
        RecordingWriter(tmp_path / "x.teleop", robot="r", dt=0.005, setup={"a": object()})
    with pytest.raises(PoiseError, match="too long"):
        RecordingWriter(tmp_path / "x.teleop", robot="r", dt=0.005, setup={"a": "x" * 20000})


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
        recording=tmp_path / "late.teleop",
    )
    again = replay_teleop(tmp_path / "late.teleop")
    np.testing.assert_array_equal(run.log.command, again.log.command)
    np.testing.assert_array_equal(run.log.devices, again.log.devices)


def test_a_run_that_died_is_replayed_as_far_as_it_goes(get_robot, tmp_path):
    path = tmp_path / "whole.teleop"
    walk(get_robot("biped20"), up_and_down(), 0.2, recording=path)
    whole = read_recording(path)
    setup = dict(whole.setup) | {"duration": 1e9}
    died = RecordingWriter(tmp_path / "died.teleop", robot="biped20", dt=0.005, setup=setup)
    died.copy(whole.rows)
    died._file.close()
    rest = read_recording(tmp_path / "died.teleop", allow_partial=True)
    assert rest.setup["duration"] == pytest.approx(0.2)
    assert replay_teleop(rest).plant.time == pytest.approx(0.2)


@pytest.mark.parametrize("size", [300, HEADER_BYTES - 1])
def test_a_file_that_ends_in_its_header_says_so(tmp_path, size):
    path = write(tmp_path / "cut.teleop")
    path.write_bytes(path.read_bytes()[:size])
    for partial in (False, True):
        with pytest.raises(RecordingError, match=rf"truncated; got '{size} bytes'"):
            read_recording(path, allow_partial=partial)


def test_a_robot_that_carries_something_is_another_one(get_robot, tmp_path):
    robot, path = get_robot("humanoid33"), tmp_path / "loaded.teleop"
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
    robot, path = replace(get_robot("biped20"), name=name), tmp_path / "x.teleop"
    run = walk(robot, up_and_down(), 0.1, recording=path)
    # No file is opened by a name that a stranger may have written.
    monkeypatch.chdir(tmp_path)
    (tmp_path / name).write_text(robot.source.text)
    with pytest.raises(UnknownNameError, match="not in the catalog") as refused:
        replay_teleop(path)
    for words in (
        "recording x.teleop",
        f"got {name!r}",
        'robot=load_robot("FILE")',
        "--robot FILE",
    ):
        assert words in str(refused.value)
    np.testing.assert_array_equal(run.log.command, replay_teleop(path, robot).log.command)


def test_a_recording_that_is_played_is_not_written_over(get_robot, tmp_path):
    robot, path = get_robot("biped20"), tmp_path / "run.teleop"
    walk(robot, up_and_down(), 0.1, recording=path)
    before, link = path.read_bytes(), tmp_path / "link.teleop"
    link.symlink_to(path)
    played = read_recording(path)
    device = played.device(robot=robot.name, dt=played.dt)
    for file in (path, link):
        with pytest.raises(ConfigurationError, match=r"cannot be written over.*another file"):
            run_teleop(robot, device, VELOCITY_TELEOP_PLANT, duration=0.1, recording=file)
    assert path.read_bytes() == before


def test_a_run_shorter_than_a_tick_is_refused(get_robot):
    with pytest.raises(ConfigurationError, match=r"shorter than a tick; got '0.0001 s'"):
        walk(get_robot("biped20"), up_and_down(), 1e-4)


@pytest.mark.parametrize("text", ["[" * 20000, "7" * 20000], ids=["nested", "a long number"])
def test_what_is_too_much_to_read_is_no_recording(tmp_path, text):
    path = tmp_path / "much"
    path.write_text(text)
    with pytest.raises(RecordingError, match="is no recording"):
        read_recording(path)
