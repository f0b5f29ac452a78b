"""Files `.teleop` of earlier versions become logs that play the same."""

import json
from dataclasses import asdict

import numpy as np
import pytest

pytest.importorskip("mcap")
pytest.importorskip("mujoco")

from poise.apps.teleoperation import (
    VELOCITY_TELEOP_PLANT,
    RecordedPush,
    RecordingError,
    convert_recording,
    read_recording,
)
from poise.cli.main import main
from poise.locomotion import TeleopParameters

ROW = np.dtype(
    [("tick", "<i8"), ("kind", "u1"), ("flags", "u1"), ("time", "<f8"), ("numbers", "<f8", (6,))]
)
NAN = float("nan")
ROWS = [
    # Tick, kind, flags, time, numbers: a sample, its hands, body, velocity, turns and rates.
    (0, 0, 1, 0.25, (0.0, 0.1, 0.2, 0.3, -0.0, 0.5)),
    (0, 2, 1 | 2 | 8 | 16, 0.25, (1.0, 1.1, 1.2, 2.0, 2.1, 2.2)),
    (0, 3, 0, 0.25, (0.01, 0.02, 0.03, 0.04, 0.05, 0.06)),
    (0, 4, 0, 0.25, (0.7, 0.8, 0.9, 0.0, 0.0, 0.0)),
    (0, 5, 2, 0.25, (0.0, 0.6, 0.0, 0.8, 0.0, 0.0)),
    (0, 5, 4 | 8, 0.25, (0.0, 0.0, 0.6, 0.8, 0.0, 0.0)),
    (0, 6, 0, 0.25, (NAN, NAN, NAN, 3.0, 3.1, 3.2)),
    (0, 6, 1, 0.25, (4.0, 4.1, 4.2, NAN, NAN, NAN)),
    (7, 1, 0, 0.0, (50.0, -20.0, 0.0, 0.1, 0.0, 0.0)),
    (9, 0, 0, 0.1, (NAN, 0.1, 0.2, 0.3, 0.4, 0.5)),
]


def write(path, rows=ROWS, promised=None, **changes):
    """A file as earlier versions wrote it."""
    header = {
        "format": "poise teleoperation",
        "version": 1,
        "robot": "g1",
        "dt": 0.002,
        "rows": len(rows) if promised is None else promised,
        "setup": {},
    }
    text = json.dumps(header | changes).encode()
    path.write_bytes(text.ljust(16383) + b"\n" + np.array(rows, ROW).tobytes())
    return path


def test_samples_and_pushes_are_those_of_the_file(tmp_path):
    setup = {"parameters": asdict(TeleopParameters()), "plant": asdict(VELOCITY_TELEOP_PLANT)}
    setup |= {"rotator": False, "seed": 3, "duration": 1.5, "q_start": None, "solved_by": None}
    assert convert_recording(write(tmp_path / "x.teleop", setup=setup), tmp_path / "x.mcap")
    recording = read_recording(tmp_path / "x.mcap")
    made = recording.setup
    assert (made.rotator, made.seed, recording.duration) == (False, 3, 1.5)
    assert (made.plant, made.parameters) == (VELOCITY_TELEOP_PLANT, TeleopParameters())
    assert (recording.robot, recording.dt) == ("g1", 0.002)
    assert recording.pushes == [RecordedPush(7, (50.0, -20.0, 0.0), 0.1)]
    (tick, first), (later, second) = recording.samples
    assert (tick, later) == (0, 9)
    assert (first.time, first.upright, first.rest) == (0.25, True, True)
    assert first.place(0) == (0.0, 0.1, 0.2)
    assert first.place(1) == (0.3, 0.0, 0.5)
    assert np.signbit(first.place(1)[1])
    left, right = first.hands
    assert (left.clutch, right.clutch) == (False, True)
    np.testing.assert_array_equal(left.position, [1.0, 1.1, 1.2])
    np.testing.assert_array_equal(right.position, [2.0, 2.1, 2.2])
    assert left.orientation is None
    np.testing.assert_array_equal(right.orientation, [0.0, 0.6, 0.0, 0.8])
    np.testing.assert_array_equal(left.velocity, [4.0, 4.1, 4.2])
    assert right.velocity is None
    assert (first.body.height, first.body.turns) == (0.01, (0.02, 0.03))
    assert first.body.torso == (0.04, 0.05, 0.06)
    assert first.velocity == (0.7, 0.8, 0.9)
    assert first.head.clutch
    np.testing.assert_array_equal(first.head.orientation, [0.0, 0.0, 0.6, 0.8])
    assert first.feet[0].velocity is None
    assert first.feet[1].velocity == (3.0, 3.1, 3.2)
    np.testing.assert_array_equal(second.place(0), [np.nan, 0.1, 0.2])
    assert (second.hands, second.head) == ((None, None), None)
    assert [part.velocity for part in second.feet] == [None, None]


@pytest.mark.parametrize("lost", [0, 10])
def test_an_unfinished_file_is_converted_as_far_as_it_goes(tmp_path, lost):
    path = write(tmp_path / "x.teleop", promised=-1, setup={"duration": 1e9})
    path.write_bytes(path.read_bytes()[: -lost or None])
    assert not convert_recording(path, tmp_path / "x.mcap")
    recording = read_recording(tmp_path / "x.mcap")
    assert len(recording.samples) == (1 if lost else 2)
    assert recording.duration == pytest.approx(0.002 * (8 if lost else 10))


@pytest.mark.parametrize(
    ("content", "changes"),
    [
        (b"", {}), (b"hello", {}), (b"[" * 20000, {}), (b"{}" + b" " * 20000, {}),
        (b"\xff\xfe" * 100, {}), (None, {"version": 2}), (None, {"dt": "x"}), (None, {"setup": 3}),
    ],
    ids=["empty", "text", "nested", "json", "binary", "version", "tick", "set-up"],
)  # fmt: skip
def test_what_is_no_such_file_is_said(tmp_path, content, changes):
    path = write(tmp_path / "x.teleop", **changes)
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(RecordingError, match=r"no \.teleop file"):
        convert_recording(path, tmp_path / "x.mcap")
    assert not (tmp_path / "x.mcap").exists()


@pytest.mark.parametrize("row", [(3, 0, 0, 0.0, (0.0,) * 6), (12, 9, 0, 0.0, (0.0,) * 6)])
def test_rows_that_cannot_be_are_said(tmp_path, row):
    with pytest.raises(RecordingError, match="backwards, or of no known kind"):
        convert_recording(write(tmp_path / "x.teleop", [*ROWS, row]), tmp_path / "x.mcap")


def test_the_command_line_converts_beside_the_file_and_writes_over_nothing(tmp_path, capsys):
    path = write(tmp_path / "x.teleop", promised=-1)
    with pytest.raises(RecordingError, match="poise convert"):
        read_recording(path)
    assert main(["convert", str(path)]) == 0
    out, err = capsys.readouterr()
    assert out == f"{tmp_path / 'x.mcap'}\n"
    assert "x.teleop was not finished" in err
    assert len(read_recording(tmp_path / "x.mcap").samples) == 2
    assert main(["convert", str(path)]) == 2
    assert "is there already" in capsys.readouterr().err
    assert main(["convert", str(tmp_path / "no.teleop")]) == 2
    assert "No such file" in capsys.readouterr().err
