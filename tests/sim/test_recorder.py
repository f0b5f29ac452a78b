import json
import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_biped import torque

from poise.control import CommandStatus
from poise.errors import (
    MissingExtraError,
    PoiseError,
    TargetError,
)
from poise.sim import (
    Plant,
    PlantConfig,
    Recorder,
    RecorderConfig,
    RunRecord,
    finish_log,
    read_log,
    rollout,
)

pytest.importorskip("mcap")

from log_topics import read_by_index, read_signal, read_topics

RUN_FOR_EVER = """
import sys, time
sys.path.insert(0, sys.argv[1])
from pathlib import Path
from small_biped import small_biped
from poise.sim import Plant, PlantConfig, Recorder, RecorderConfig
plant = Plant(small_biped(), PlantConfig(actuation="position"))
recorder = Recorder(Path(sys.argv[2]), config=RecorderConfig(flush_dt=0.25))
recorder.begin(plant)
began = time.monotonic()
while True:
    recorder.look()
    plant.step(None)
    while plant.time > time.monotonic() - began:
        time.sleep(0.001)
    if plant.time % 0.05 < 1e-9 or plant.time % 0.05 > 0.05 - 1e-9:
        print(plant.time, flush=True)
"""


@contextmanager
def recording(plant, path=None, **options):
    """A recorder by hand, without a rollout."""
    recorder = Recorder(path, **options)
    recorder.begin(plant)
    yield recorder
    recorder.end()


@pytest.fixture
def plant(biped):
    return Plant(biped, PlantConfig(actuation="position"))


def test_a_finished_log_holds_the_record_and_shows_it(plant, tmp_path):
    path = tmp_path / "log.mcap"
    with recording(plant, path, metadata={"scenario": "none"}) as recorder:
        for _ in range(501):
            recorder.look()
            plant.step(None)
    log, record = read_log(path), recorder.record
    assert log.complete
    assert log.metadata == record.metadata
    assert (log.metadata["robot"], log.metadata["scenario"]) == ("small_biped", "none")
    for name in ("q", "v", "torque", "com", "wrench/left_sole"):
        times, values = read_signal(path, name)
        np.testing.assert_array_equal(values, record[name])
        np.testing.assert_array_equal(times, record.times(name))
    joints = [m for _, m in read_topics(path)["/joints"]]
    assert tuple(joints[0]["name"]) == plant.robot.joint_names
    shown = np.isin(record.times("q"), [m["time"] for m in joints])
    assert shown.sum() == len(joints) == pytest.approx(0.5 * 30, abs=1)
    np.testing.assert_array_equal([m["position"] for m in joints], record["q"][shown, 7:])
    np.testing.assert_array_equal([m["velocity"] for m in joints], record["v"][shown, 6:])
    np.testing.assert_array_equal([m["torque"] for m in joints], record["torque"][shown])


def assert_same(one, other):
    assert one.names == other.names
    assert one.metadata == other.metadata
    assert set(one.topics) == set(other.topics)
    for name in one.names:
        assert one.unit(name) == other.unit(name)
        assert one[name].dtype == other[name].dtype
        np.testing.assert_array_equal(one[name], other[name], strict=True)
        np.testing.assert_array_equal(one.times(name), other.times(name), strict=True)
    for subject in one.topics:
        assert one.notes(subject) == other.notes(subject)


@pytest.mark.parametrize("flush_dt", [0.01, 1e9])
def test_a_log_gives_the_record_back_to_the_last_bit(plant, tmp_path, flush_dt):
    path = tmp_path / "log.mcap"
    config = RecorderConfig(flush_dt=flush_dt)
    with recording(plant, path, config=config, metadata={"seed": "3"}) as recorder:
        for k in range(1100):
            recorder.look()
            recorder.sample(plant.time, flag=k % 3 == 0, code=np.int8(k % 100), count=k)
            recorder.sample(plant.time, odd=np.array([[np.nan, -0.0], [np.inf, 1.0 / (k + 1)]]))
            if k > 500:
                recorder.sample(plant.time, late=np.arange(3) + k, empty=np.zeros(0))
            if k % 200 == 0:
                recorder.note("mode", f"mode {k} \N{GREEK SMALL LETTER ALPHA}")
            plant.step(None)
    record = recorder.record
    assert record["flag"].dtype == np.bool_
    assert record["code"].dtype == np.int8
    assert record.unit("com") == "m"
    log = read_log(path)
    assert_same(record, log)
    assert np.signbit(log["odd"][:, 0, 1]).all()
    assert log.complete


def test_what_is_not_kept_is_in_the_log(plant, tmp_path):
    path = tmp_path / "log.mcap"
    config = RecorderConfig(flush_dt=1e-4, keep=False)
    with recording(plant, path, config=config) as recorder:
        for k in range(300):
            recorder.sample(k * 1e-3, x=float(k))
            recorder.note("mode", f"mode {k // 100}")
    assert len(recorder.record["x"]) < 300
    np.testing.assert_array_equal(read_log(path)["x"], np.arange(300.0))
    assert [text for _, text in read_log(path).notes("mode")] == ["mode 0", "mode 1", "mode 2"]


def test_foxglove_can_show_the_robot(plant, tmp_path):
    path = tmp_path / "log.mcap"
    with recording(plant, path) as recorder:
        for _ in range(200):
            recorder.look()
            plant.step(None)
    topics = read_topics(path)
    transforms = topics["/tf"]
    assert len(transforms) == pytest.approx(0.2 * 30, abs=1)
    frames = {t["child_frame_id"]: t for t in transforms[0][1]["transforms"]}
    np.testing.assert_allclose(
        [frames["base"]["translation"][a] for a in "xyz"], recorder.record["q"][0, :3], atol=1e-12
    )
    (scene,) = topics["/scene"]
    assert {e["id"] for e in scene[1]["entities"]} >= {"base", "chest", "left_foot"}
    assert {e["frame_id"] for e in scene[1]["entities"]} <= set(frames)


def test_shapes_and_kinds_of_number_are_shown_as_numbers(plant, tmp_path):
    path = tmp_path / "log.mcap"
    with recording(plant, path) as recorder:
        recorder.sample(0.0, flag=True, code=np.int8(-3), m=np.arange(6).reshape(2, 3))
        recorder.sample(0.0, empty=np.zeros(0))
        recorder.note("mode", "up \N{GREEK SMALL LETTER ALPHA}")
    assert read_signal(path, "flag")[1] == [1.0]
    assert read_signal(path, "code")[1] == [-3.0]
    np.testing.assert_array_equal(read_signal(path, "m")[1], [np.arange(6)])
    (mode,) = read_topics(path)["/mode"]
    assert mode[1] == {"time": 0.0, "value": "up \N{GREEK SMALL LETTER ALPHA}"}


def test_a_reader_that_goes_by_the_index_finds_every_message(plant, tmp_path):
    path = tmp_path / "log.mcap"
    with recording(plant, path, config=RecorderConfig(flush_dt=0.01)) as recorder:
        for k in range(1500):
            recorder.look()
            recorder.sample(plant.time, **{"odd": 1.0} if k % 2 else {"odd": 1.0, "even": 2.0})
            plant.step(None)
    expected = np.round(recorder.record.times("com") * 1e9)
    np.testing.assert_array_equal(read_by_index(path, "/signals"), expected)
    for topic in ("/signals1", "/signals2"):
        times = read_by_index(path, topic)
        assert times == sorted(times)
        assert len(times) == 750
    assert read_by_index(path, "/nothing") == []


def test_a_signal_of_several_tables_comes_back_in_the_order_of_its_samples(plant, tmp_path):
    path = tmp_path / "log.mcap"
    with recording(plant, path, config=RecorderConfig(flush_dt=1e-4)) as recorder:
        for k in range(3000):
            others = {"other": k} if k % 3 == 0 else {}
            recorder.sample(1e-3 * (k // 2), x=float(k), **others)
    np.testing.assert_array_equal(recorder.record["x"], np.arange(3000.0))
    assert_same(recorder.record, read_log(path))


def test_status_is_noted_when_it_changes(biped, tmp_path):
    class Tired:
        def step(self, state):
            answered = 0.002 < state.time < 0.006
            status = CommandStatus.OK if answered else CommandStatus.SOLVER_FAILED
            return torque(np.zeros(biped.nj))._replace(status=status)

    path = tmp_path / "log.mcap"
    recorder = Recorder(path)
    list(rollout(Plant(biped), Tired(), observers=[recorder], duration=0.01))
    told = [s for _, s in recorder.record.notes("status")]
    assert told == ["solver_failed", "ok", "solver_failed"]
    assert [m["value"] for _, m in read_topics(path)["/status"]] == told


def test_a_state_of_which_an_estimator_makes_nothing_has_a_row_as_it_came(biped):
    class Limp:
        def step(self, state):
            return torque(np.zeros(biped.nj))

    def blind_at_times(state):
        return replace(state, q=state.q + 0.01) if 0.002 < state.time < 0.006 else state

    recorder, plant = Recorder(), Plant(biped)
    ticks = list(rollout(plant, Limp(), None, [recorder], estimator=blind_at_times, duration=0.01))
    record = recorder.record
    np.testing.assert_array_equal(record["base_estimate"], [t.estimate.q[:7] for t in ticks])
    np.testing.assert_array_equal(record.times("base_estimate"), record.times("q"))
    list(rollout(plant, Limp(), None, [recorder], duration=0.002))
    assert "base_estimate" not in recorder.record, "nothing is estimated"


def test_a_writer_that_is_stuck_holds_nobody_up_and_loses_nothing(plant, tmp_path, monkeypatch):
    path, stuck = tmp_path / "log.mcap", threading.Event()
    config = RecorderConfig(flush_dt=1e-6, scene_dt=0.0)
    with recording(plant, path, config=config) as recorder:
        flush = recorder._log._writer.flush
        monkeypatch.setattr(recorder._log._writer, "flush", lambda: stuck.wait() and flush())
        for k in range(3000):
            recorder.sample(k * 1e-3, x=float(k))
        assert read_log(path).end == 0.0
        stuck.set()
    np.testing.assert_array_equal(read_signal(path, "x")[1], np.arange(3000.0))
    assert_same(recorder.record, read_log(path))


def test_a_killed_run_leaves_its_log_readable_up_to_the_last_second(tmp_path):
    path = tmp_path / "log.mcap"
    process = subprocess.Popen(
        [sys.executable, "-c", RUN_FOR_EVER, str(Path(__file__).parent), str(path)],
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        reached = 0.0
        limit = time.monotonic() + 60.0
        while reached < 1.5 and time.monotonic() < limit:
            reached = float(process.stdout.readline())
    finally:
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        process.stdout.close()
    log = read_log(path)
    assert not log.complete
    assert log.end > reached - 1.0
    np.testing.assert_allclose(np.diff(log.times("q")), 0.001, atol=1e-9)
    assert log["q"].shape[1] == 18
    times, _ = read_signal(path, "q")
    np.testing.assert_array_equal(times, log.times("q"))
    assert read_topics(path)["/scene"]


def test_a_log_that_is_damaged_anywhere_is_read_up_to_there(plant, tmp_path):
    """As by a disc: a byte or a page is another one; nothing of it passes for what was recorded."""
    path, bad = tmp_path / "log.mcap", tmp_path / "bad.mcap"
    with recording(plant, path, config=RecorderConfig(flush_dt=0.02)) as recorder:
        for _ in range(400):
            recorder.look()
            plant.step(None)
    data, whole = path.read_bytes(), read_log(path)
    rng, ends = np.random.default_rng(0), []
    # Before the first block is the header, and a text in it more or less is told otherwise.
    for place in np.linspace(0.1, 0.99, 60) * len(data):
        hit = bytearray(data)
        size = int(rng.choice([1, 512]))
        hit[int(place) : int(place) + size] = rng.bytes(size)
        bad.write_bytes(hit[: len(data)])
        log = read_log(bad)
        ends.append(log.end)
        for name in log.names:
            np.testing.assert_array_equal(log[name], whole[name][: len(log[name])], strict=True)
            assert not log.complete or len(log[name]) == len(whole[name])
    assert min(ends) < 0.2
    assert max(ends) > 0.35


def test_of_two_runs_that_write_to_one_file_that_of_the_later_is_whole(plant, tmp_path):
    path, other = tmp_path / "log.mcap", Plant(plant.robot, PlantConfig(actuation="position"))
    config = RecorderConfig(flush_dt=0.01)
    with recording(plant, path, config=config) as earlier:
        with recording(other, path, config=config) as later:
            for _ in range(100):
                for recorder, body in ((earlier, plant), (later, other)):
                    recorder.look()
                    body.step(None)
        for _ in range(100):
            earlier.look()
            plant.step(None)
    log = read_log(path)
    assert log.complete
    assert_same(later.record, log)


@pytest.mark.parametrize(
    ("first", "then"),
    [
        (np.zeros(3), np.zeros(4)),
        (np.zeros((2, 3)), np.zeros(6)),
        (0.0, np.zeros(3)),
    ],
)
def test_a_signal_keeps_its_shape(plant, first, then):
    recorder = Recorder()
    recorder.begin(plant)
    recorder.sample(0.0, before=1.0, x=first, after=np.zeros(2))
    with pytest.raises(TargetError, match="'x' changed its shape"):
        recorder.sample(0.1, before=1.0, x=then, after=np.zeros(2))
    recorder.sample(0.2, before=1.0, x=first, after=np.zeros(2))
    np.testing.assert_array_equal(recorder.record.times("x"), [0.0, 0.2])


def test_files_that_are_no_logs_are_refused(tmp_path):
    with pytest.raises(PoiseError, match="does not exist"):
        read_log(tmp_path / "nothing.mcap")
    for content in (b"", b"MCAP", b"hello, this is no log at all"):
        (tmp_path / "bad.mcap").write_bytes(content)
        with pytest.raises(PoiseError, match="not an MCAP file"):
            read_log(tmp_path / "bad.mcap")


@pytest.mark.parametrize("library", ["poise", "somebody else"])
def test_logs_of_other_versions_and_of_others_are_refused(tmp_path, library):
    from mcap.writer import Writer

    path = tmp_path / "old.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="", library=library)
        channel = writer.register_channel("/record", "poise.block", 0)
        writer.add_message(channel, log_time=0, data=bytes(100), publish_time=0)
        writer.finish()
    with pytest.raises(PoiseError, match=f"no log of this version of Poise.*{library}"):
        read_log(path)


@pytest.mark.parametrize(
    "holds", ["nothing", '[["x", "m", "O", []]]', '[["x", "m", "<f8", [3]]]', "notes"]
)
def test_a_log_that_says_what_it_does_not_hold_is_refused(plant, tmp_path, holds):
    from mcap.writer import Writer

    path = tmp_path / "odd.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(library="poise log 3")
        channel = writer.register_channel("/x", "poise", 0, {"holds": holds})
        writer.add_message(channel, log_time=0, data=b"\xff" * 15, publish_time=0)
        writer.finish()
    with pytest.raises(PoiseError, match="x in .* cannot be read"):
        read_log(path)


def test_names_that_look_alike_in_foxglove_are_told_apart(plant, tmp_path):
    path = tmp_path / "log.mcap"
    with recording(plant, path) as recorder:
        recorder.record.add(0.5, {"a/b": 1.0, "a_b": 2.0, "time": 3.0, "order": np.uint8(4)})
        recorder.note("signals", "a topic of its own")
    (_, message), (_, note) = read_topics(path)["/signals"]
    numbers = [message[name] for name in ("a_b", "a_b_", "time_", "order_")]
    assert (message["time"], numbers) == (0.5, [1.0, 2.0, 3.0, 4])
    assert note["value"] == "a topic of its own"
    assert_same(recorder.record, read_log(path))


def test_odd_times_and_kinds_of_number_are_kept(plant, tmp_path):
    path = tmp_path / "log.mcap"
    with recording(plant, path) as recorder:
        for time in (-1.0, np.nan, np.inf, 1e300):
            recorder.sample(time, z=np.array([1.0 + 2.0j, np.nan]), half=np.float16(0.1))
    log = read_log(path)
    assert_same(recorder.record, log)
    assert log["z"].dtype == np.complex128


def test_a_copy_of_a_log_is_finished_behind_what_is_whole(plant, tmp_path):
    path, copy = tmp_path / "log.mcap", tmp_path / "copy.mcap"
    with recording(plant, path, config=RecorderConfig(flush_dt=1e-3)) as recorder:
        for _ in range(500):
            recorder.look()
            plant.step(None)
    data, times = path.read_bytes(), []
    for size in (len(data), len(data) - 30, len(data) // 2, len(data) // 3):
        copy.write_bytes(data[:size])
        before = read_log(copy)
        finish_log(copy)
        after = read_log(copy)
        assert after.complete
        assert_same(before, after)
        times.append(after.end)
    assert times == sorted(times, reverse=True)
    assert times[1] > times[-1] > 0.0


def test_a_disk_that_fills_up_during_a_run_does_not_stop_it(plant, tmp_path, monkeypatch):
    config = RecorderConfig(flush_dt=1e-6)
    recorder = Recorder(tmp_path / "log.mcap", config=config)
    recorder.begin(plant)

    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(recorder._log._writer, "flush", full)
    for _ in range(300):
        recorder.look()
        plant.step(None)
    assert len(recorder.record["q"]) == 300
    with pytest.raises(PoiseError, match=r"cannot be written.*space"):
        recorder.end()


def test_a_run_that_breaks_off_leaves_a_whole_log(biped, tmp_path):
    class Broken:
        def step(self, state):
            if state.time > 0.05:
                raise RuntimeError("a bug")
            return torque(np.zeros(biped.nj))

    recorder = Recorder(tmp_path / "log.mcap")
    with pytest.raises(RuntimeError, match="a bug"):
        list(rollout(Plant(biped), Broken(), observers=[recorder]))
    log = read_log(tmp_path / "log.mcap")
    assert log.complete
    assert_same(recorder.record, log)
    assert log.end == pytest.approx(0.051)


def test_a_rollout_is_recorded_at_the_end_of_each_period(biped):
    from poise.control import WholeBodyController
    from poise.stack import ComTask, PostureTask, Stack, SurfaceContact

    stack = Stack([SurfaceContact(s) for s in biped.soles], [[ComTask()], [PostureTask()]])
    controller, plant, recorder = WholeBodyController(biped, stack), Plant(biped), Recorder()
    truths, errors = [], []

    class Nod:
        def __init__(self):
            self.stack = stack

        def lead(self, state):
            stack.task("com").set_target(np.array([0.0, 0.0, 0.7]))

        def signals(self):
            return {"nods": 1.0, "mode": "nodding"}

    for tick in rollout(plant, controller, Nod(), [recorder], duration=0.02):
        truths.append(tick.truth)
        errors.append(np.linalg.norm(stack.task("com").error))
    record = recorder.record
    np.testing.assert_array_equal(record["q"], [t.q for t in truths])
    np.testing.assert_array_equal(record.times("q"), [t.time for t in truths])
    np.testing.assert_array_equal(record["error/com"], errors)
    np.testing.assert_array_equal(record["com_reference"][-1], [0.0, 0.0, 0.7])
    np.testing.assert_array_equal(record["nods"], np.ones(20))
    assert record.notes("mode") == ((0.001, "nodding"),)
    phases = {n for n in record.names if n.startswith("tick_us/")}
    assert {"tick_us/leader", "tick_us/solve"} <= phases
    assert json.loads(record.metadata["tasks"]) == [["com", 0, "m"], ["posture", 1, "rad"]]
    assert record.unit("error/com") == "m"


def test_a_table_of_a_record(plant):
    pytest.importorskip("pandas")
    recorder = Recorder()
    recorder.begin(plant)
    for k in range(5):
        recorder.sample(0.1 * k, x=float(k), m=np.full((2, 2), k))
        if k == 3:
            recorder.sample(0.1 * k, late=True)
            recorder.record.note(0.1 * k, "mode", "up")
    table = recorder.record.to_pandas()
    assert list(table.columns) == ["x", "m[0, 0]", "m[0, 1]", "m[1, 0]", "m[1, 1]", "late", "mode"]
    np.testing.assert_array_equal(table["m[1, 0]"], np.arange(5))
    assert table["late"].notna().tolist() == [False, False, False, True, False]
    assert table["mode"].tolist() == ["", "", "", "up", "up"]


@pytest.mark.parametrize(
    ("joints", "columns"),
    [
        (("hip", "knee"), ["q[0]", "q[hip]", "q[knee]", "tilt[0]", "tilt[1]", "torque[hip]"]),
        ((), ["q[0]", "q[1]", "q[2]", "tilt[0]", "tilt[1]", "torque[0]"]),
        (("of", "another", "robot", "all"), ["q[0]", "q[1]", "q[2]"]),
    ],
)
def test_a_record_of_ones_own_loop_may_know_the_joints(joints, columns):
    pytest.importorskip("pandas")
    record = RunRecord(joints=joints)
    record.add(0.0, {"q": np.zeros(3), "tilt": np.zeros(2), "torque": np.zeros(2)})
    assert list(record.to_pandas().columns)[: len(columns)] == columns


def test_a_table_without_pandas_says_what_to_install(plant, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(MissingExtraError, match=r'pip install "poise\[tables\]"'):
        Recorder().record.to_pandas()
