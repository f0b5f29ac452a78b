import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from small_biped import torque

from poise.errors import ConfigurationError, PoiseError, TargetError, UnknownNameError
from poise.sim import Plant, PlantConfig, Recorder, RecorderConfig, read_log

pytest.importorskip("mcap")

RUN_FOR_EVER = """
import sys, time
sys.path.insert(0, sys.argv[1])
from pathlib import Path
from small_biped import small_biped
from poise.sim import Plant, PlantConfig, Recorder, RecorderConfig
plant = Plant(small_biped(), PlantConfig(actuation="position"))
recorder = Recorder(plant, Path(sys.argv[2]), config=RecorderConfig(flush_dt=0.25))
began = time.monotonic()
while True:
    recorder.record()
    plant.step(None)
    while plant.time > time.monotonic() - began:
        time.sleep(0.001)
    if plant.time % 0.05 < 1e-9 or plant.time % 0.05 > 0.05 - 1e-9:
        print(plant.time, flush=True)
"""


@pytest.fixture
def plant(biped):
    return Plant(biped, PlantConfig(actuation="position"))


def test_memory_keeps_every_sample_exactly(plant):
    recorder = Recorder(plant)
    qs, torques = [], []
    for k in range(2500):
        recorder.record(error=float(k))
        qs.append(plant.true_state().q)
        torques.append(plant.applied_torque)
        plant.step(None)
    np.testing.assert_array_equal(recorder["q"], qs)
    np.testing.assert_array_equal(recorder["torque"], torques)
    np.testing.assert_array_equal(recorder["error"], np.arange(2500.0))
    np.testing.assert_allclose(recorder.times("q"), np.arange(2500) * 1e-3, rtol=0, atol=1e-12)
    assert {"v", "com", "zmp", "wrench/left_sole"} <= set(recorder.names)


def test_a_finished_log_holds_the_recorded_numbers_exactly(plant, tmp_path):
    path = tmp_path / "log.mcap"
    with Recorder(plant, path, metadata={"scenario": "none"}) as recorder:
        for _ in range(501):
            recorder.record()
            plant.step(None)
    log = read_log(path)
    assert log.complete
    assert log.metadata == {"robot": "small_biped", "scenario": "none"}
    assert recorder.dropped == 0
    for name in ("q", "v", "torque", "com", "wrench/left_sole"):
        times, values = log.signal(name)
        np.testing.assert_array_equal(values, recorder[name][::5])
        np.testing.assert_array_equal(times, recorder.times(name)[::5])
    joints = [m for _, m in log.messages["/joints"]]
    assert tuple(joints[0]["name"]) == plant.robot.joint_names
    np.testing.assert_array_equal([m["position"] for m in joints], recorder["q"][::5, 7:])


def test_every_sample_is_logged_if_asked_for(plant, tmp_path):
    path = tmp_path / "log.mcap"
    with Recorder(plant, path, config=RecorderConfig(log_dt=0.0)) as recorder:
        for _ in range(100):
            recorder.record()
            plant.step(None)
    times, values = read_log(path).signal("com")
    np.testing.assert_array_equal(values, recorder["com"])
    assert len(times) == 100


def test_foxglove_can_show_the_robot(plant, tmp_path):
    path = tmp_path / "log.mcap"
    with Recorder(plant, path) as recorder:
        for _ in range(200):
            recorder.record()
            plant.step(None)
    log = read_log(path)
    transforms = log.messages["/tf"]
    assert len(transforms) == pytest.approx(0.2 * 30, abs=1)
    frames = {t["child_frame_id"]: t for t in transforms[0][1]["transforms"]}
    np.testing.assert_allclose(
        [frames["base"]["translation"][a] for a in "xyz"], recorder["q"][0, :3], atol=1e-12
    )
    (scene,) = log.messages["/scene"]
    assert {e["id"] for e in scene[1]["entities"]} >= {"base", "chest", "left_foot"}
    assert {e["frame_id"] for e in scene[1]["entities"]} <= set(frames)


def test_nan_is_null_in_the_log_and_nan_when_read_back(plant, tmp_path):
    path = tmp_path / "log.mcap"
    with Recorder(plant, path) as recorder:
        recorder.sample(0.0, zmp=np.array([np.nan, 1.5]), scalar=np.inf)
    log = read_log(path)
    raw = json.dumps(log.messages["/zmp"][0][1], allow_nan=False)
    assert json.loads(raw)["value"] == [None, 1.5]
    np.testing.assert_array_equal(log.signal("zmp")[1], [[np.nan, 1.5]])
    assert np.isnan(log.signal("scalar")[1]).all()


def test_status_is_logged_when_it_changes(plant, tmp_path):
    path = tmp_path / "log.mcap"
    with Recorder(plant, path) as recorder:
        for k in range(10):
            recorder.record(torque(np.zeros(plant.robot.nj)) if k > 4 else None)
            plant.step(None)
    assert [s for _, s in recorder.statuses] == ["none", "ok"]
    assert [m["value"] for _, m in read_log(path).messages["/status"]] == ["none", "ok"]


def test_a_full_queue_that_drops_counts_what_it_dropped(plant, tmp_path):
    path = tmp_path / "log.mcap"
    config = RecorderConfig(log_dt=0.0, capacity=5, on_full="drop", scene_dt=0.0)
    with Recorder(plant, path, config=config) as recorder:
        for k in range(3000):
            recorder.sample(k * 1e-3, x=float(k))
        recorder_dropped = recorder.dropped
    kept = len(read_log(path).signal("x")[0])
    assert kept + recorder_dropped == 3000
    assert len(recorder["x"]) == 3000


def test_a_full_queue_that_blocks_loses_nothing(plant, tmp_path):
    path = tmp_path / "log.mcap"
    config = RecorderConfig(log_dt=0.0, capacity=5, scene_dt=0.0)
    with Recorder(plant, path, config=config) as recorder:
        for k in range(3000):
            recorder.sample(k * 1e-3, x=float(k))
    np.testing.assert_array_equal(read_log(path).signal("x")[1], np.arange(3000.0))


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
        while reached < 2.0 and time.monotonic() < limit:
            reached = float(process.stdout.readline())
    finally:
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        process.stdout.close()
    log = read_log(path)
    assert not log.complete
    assert log.end > reached - 1.0
    times, values = log.signal("q")
    np.testing.assert_allclose(np.diff(times), 0.005, atol=1e-9)
    assert values.shape[1] == 18
    assert log.messages["/scene"]


def test_a_log_cut_anywhere_is_read_up_to_the_cut(plant, tmp_path):
    path, cut = tmp_path / "log.mcap", tmp_path / "cut.mcap"
    with Recorder(plant, path, config=RecorderConfig(flush_dt=0.02)) as recorder:
        for _ in range(1000):
            recorder.record()
            plant.step(None)
    data = path.read_bytes()
    ends = []
    for share in np.linspace(0.05, 0.999, 40):
        cut.write_bytes(data[: int(share * len(data))])
        log = read_log(cut)
        assert not log.complete
        ends.append(log.end)
    assert ends == sorted(ends)
    assert ends[-1] > 0.9
    assert ends[0] < 0.5


def test_a_signal_keeps_its_shape(plant):
    recorder = Recorder(plant)
    recorder.sample(0.0, x=np.zeros(3))
    with pytest.raises(TargetError, match="changed its shape"):
        recorder.sample(0.1, x=np.zeros(4))


def test_unknown_signals_are_named_with_choices(plant, tmp_path):
    path = tmp_path / "log.mcap"
    with Recorder(plant, path) as recorder:
        recorder.record()
    with pytest.raises(UnknownNameError, match="com"):
        _ = recorder["con"]
    with pytest.raises(UnknownNameError, match="com"):
        read_log(path).signal("con")


def test_files_that_are_no_logs_are_refused(tmp_path):
    with pytest.raises(PoiseError, match="does not exist"):
        read_log(tmp_path / "nothing.mcap")
    for content in (b"", b"MCAP", b"hello, this is no log at all"):
        (tmp_path / "bad.mcap").write_bytes(content)
        with pytest.raises(PoiseError, match="not an MCAP file"):
            read_log(tmp_path / "bad.mcap")


@pytest.mark.parametrize(
    "bad",
    [{"log_dt": -1.0}, {"scene_dt": np.nan}, {"flush_dt": 0.0}, {"capacity": 0}],
)
def test_a_recorder_that_cannot_be_is_refused(bad):
    with pytest.raises(ConfigurationError):
        RecorderConfig(**bad)


def test_a_full_disk_is_reported_when_the_log_is_closed(plant):
    full = Path("/dev/full")
    if not full.exists():
        pytest.skip("needs /dev/full")
    with pytest.raises(PoiseError, match=r"cannot be written.*space"):
        Recorder(plant, full)


def test_a_disk_that_fills_up_during_a_run_does_not_stop_it(plant, tmp_path, monkeypatch):
    recorder = Recorder(plant, tmp_path / "log.mcap", config=RecorderConfig(capacity=20))

    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(recorder._log._writer, "add_message", full)
    for _ in range(300):
        recorder.record()
        plant.step(None)
    assert len(recorder["q"]) == 300
    with pytest.raises(PoiseError, match=r"cannot be written.*space"):
        recorder.close()


def test_a_folder_that_does_not_exist_is_reported_at_once(plant, tmp_path):
    with pytest.raises(PoiseError, match="cannot be written"):
        Recorder(plant, tmp_path / "no" / "log.mcap")
