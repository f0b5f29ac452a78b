"""`poise teleop` and `poise drive`: sessions they begin, what they print and leave."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
from dataclasses import replace
from importlib.resources import files
from importlib.util import find_spec
from types import SimpleNamespace

import pytest
import yaml

if find_spec("websockets") is None or find_spec("mujoco") is None:
    pytest.skip("the extra teleop is not installed", allow_module_level=True)

from websockets.sync.client import connect

from poise.apps import live
from poise.apps.teleoperation import (
    TORQUE_TELEOP_PLANT,
    VELOCITY_TELEOP_PLANT,
    read_recording,
    run_teleop,
    terrain_blocks,
    write_recording,
)
from poise.cli.main import main
from poise.locomotion import ScriptedDevice, teleop_parameters
from poise.robots import load_robot
from poise.sim import SensorConfig

LIVE = ("--no-open", "--port", "0", "--seconds", "0.5")


class Session(SimpleNamespace):
    """A session that does not run."""

    front = SimpleNamespace(drive_url="http://x/?token=y", watch_url="http://x/")
    takes = SimpleNamespace(problem="")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def wait(self, seconds):
        pass


@pytest.fixture
def begun(monkeypatch):
    """The sessions that are begun, of which none runs."""
    seen = []

    def made(robot, folder, **options):
        seen.append(Session(robot=robot, folder=folder, **options))
        return seen[-1]

    monkeypatch.setattr(live, "LiveSession", made)
    return seen


def record(path, robot="humanoid33", plant=VELOCITY_TELEOP_PLANT):
    """A short run."""
    still = lambda teleoperator: ScriptedDevice([], *teleoperator.estimator.anchors)  # noqa: E731
    run_teleop(load_robot(robot), still, plant, duration=0.1, recording=path)
    return path


@pytest.fixture
def recorded(in_folder):
    """The file of a short run of humanoid33 at velocity level."""
    return record(in_folder / "x.mcap")


def test_it_says_where_to_drive_where_to_watch_and_how_to_step(in_folder, capsys):
    assert main(["teleop", *LIVE]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert re.search(r"drive: http://127\.0\.0\.1:\d+/\?token=\S{16,}", out)
    assert re.search(r"watch: http://127\.0\.0\.1:\d+/\n", out)
    assert "To step: hold Q or E" in out
    assert out.endswith("recordings in runs/teleop-biped20: none, nobody drove\n")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--robot", "arm6"), "cannot walk on two feet"),
        (("--port", "99999"), "0 to 65535"),
        (("--terrain", "swamp"), "flat, obstacle, steps, bumps"),
        (("--device", "no_such_file"), "browser, gamepad, or the file"),
        (("--actuation", "velocity", "--controller", "osf"), "no such controller"),
        (("--hand-scale", "nan"), "hand_scale is out of range"),
        (("--seconds", "0"), "--seconds"),
        (("--seconds", "nan"), "--seconds"),
    ],
)
def test_bad_input_is_one_line(in_folder, refused, arguments, words):
    assert words in refused("teleop", *LIVE, *arguments)
    assert not list(in_folder.iterdir())


def test_a_port_in_use_and_no_gamepad_are_one_line(in_folder, refused):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        assert f"cannot listen on port {port}" in refused("teleop", *LIVE, "--port", port)
    if find_spec("pygame") is not None:
        words = "no gamepad on this machine"
        assert words in refused("teleop", *LIVE, "--device", "gamepad")


def test_without_the_extra_the_line_says_how_to_install_it(in_folder, refused, monkeypatch):
    for name in [name for name in sys.modules if name.startswith("poise.apps.live")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert 'pip install "poise[teleop]"' in refused("teleop", *LIVE)


@pytest.mark.parametrize("verb", ["teleop", "drive"])
@pytest.mark.parametrize("noise", [False, True])
def test_sensors_have_noise_if_that_is_asked_for_and_links_touch(in_folder, begun, verb, noise):
    assert main([verb, *LIVE, *(["--noise"] if noise else [])]) == 0
    plant = begun[0].plant
    assert plant.sensors == (SensorConfig.typical() if noise else SensorConfig())
    assert plant.self_contact


@pytest.mark.parametrize("actuation", ["torque", "velocity", "position"])
def test_commands_controller_hands_and_terrain_are_as_was_asked_for(in_folder, begun, actuation):
    more = ["--actuation", actuation, "--hand-scale", "0.5", "--terrain", "bumps", "--seed", "3"]
    assert main(["teleop", *LIVE, *more, "--controller", "reduced"]) == 0
    (one,) = begun
    robot, usual = load_robot("biped20"), VELOCITY_TELEOP_PLANT
    if actuation != "velocity":
        usual = replace(TORQUE_TELEOP_PLANT, actuation=actuation)
    blocks = terrain_blocks("bumps", robot, seed=3)
    assert one.plant == replace(usual, self_contact=True, blocks=blocks)
    assert one.parameters == replace(teleop_parameters(robot, usual.commanded), hand_scale=0.5)
    assert (one.solved_by, one.seed, one.gamepad) == ("reduced", 3, False)


@pytest.mark.parametrize("asked", [None, "flat"])
def test_a_recording_is_played_on_its_own_terrain_unless_another_is_asked_for(
    in_folder, begun, asked
):
    blocks = terrain_blocks("bumps", load_robot("biped20"), seed=3)
    record(in_folder / "x.mcap", "biped20", replace(VELOCITY_TELEOP_PLANT, blocks=blocks))
    more = [] if asked is None else ["--terrain", asked]
    assert main(["teleop", *LIVE, "--device", "x.mcap", *more]) == 0
    assert begun[0].plant.blocks == (blocks if asked is None else ())


@pytest.mark.parametrize(
    "arguments",
    [(), ("--robot", "humanoid33"), ("--actuation", "velocity", "--hand-scale", "1")],
    ids=str,
)
def test_a_recording_is_repeated_by_its_own_robot_and_actuation(recorded, capsys, begun, arguments):
    assert main(["teleop", *LIVE, "--device", "x.mcap", *arguments]) == 0
    assert capsys.readouterr().err == ""
    (one,) = begun
    made = (one.robot.name, one.plant, one.recording.path.name)
    assert made == ("humanoid33", VELOCITY_TELEOP_PLANT, "x.mcap")


@pytest.mark.parametrize(
    ("arguments", "name", "actuation"),
    [
        (("--robot", "biped20"), "biped20", "velocity"),
        (("--robot", "g1", "--actuation", "torque", "--controller", "reduced"), "g1", "torque"),
        (("--actuation", "torque"), "humanoid33", "torque"),
        (("--hand-scale", "0.5"), "humanoid33", "velocity"),
        (("--noise",), "humanoid33", "velocity"),
        (("--terrain", "bumps"), "humanoid33", "velocity"),
    ],
)
def test_a_recording_leads_another_robot_or_run_and_that_is_said(
    recorded, capsys, begun, arguments, name, actuation
):
    assert main(["teleop", *LIVE, "--device", "x.mcap", *arguments]) == 0
    assert capsys.readouterr().err == (
        "poise: the samples of x.mcap were recorded with robot humanoid33, velocity commanded; "
        "this is no replay of that run\n"
    )
    assert (begun[0].robot.name, begun[0].plant.actuation) == (name, actuation)


def test_recordings_that_cannot_lead_are_one_line(recorded, refused, capsys, begun):
    line = ["teleop", *LIVE, "--device", "x.mcap"]
    content = recorded.read_bytes()
    for text, words in (
        (content.replace(b"poise log 3", b"poise log 1"), "written by 'poise log 1'"),
        (content[:200], "x.mcap is no recording"),
        (b"", "x.mcap"),
        (b"{}" + b" " * 20000, "x.mcap"),
    ):
        recorded.write_bytes(text)
        assert words in refused(*line)
    # What a run that was killed has left is played as far as it goes.
    recorded.write_bytes(content[: len(content) - 10])
    assert main(line) == 0
    assert "not finished" in capsys.readouterr().err


def test_a_recording_without_samples_is_one_line(in_folder, refused):
    write_recording(in_folder / "x.mcap", [], robot="biped20", dt=0.002)
    words = "x.mcap has no samples of an operator"
    assert words in refused("teleop", *LIVE, "--device", "x.mcap")


def test_a_recording_of_a_robot_from_a_file_is_played_with_that(in_folder, refused, begun):
    text = load_robot("biped20").source.text.replace('name="biped20"', 'name="mona"')
    (in_folder / "mona.urdf").write_text(text, encoding="utf-8")
    facts = yaml.safe_load((files("poise.robots") / "descriptions" / "biped20.yaml").read_bytes())
    del facts["catalog"]
    (in_folder / "mona.poise.yaml").write_text(yaml.safe_dump(facts), encoding="utf-8")
    record(in_folder / "x.mcap", "mona.urdf")
    line = refused("teleop", *LIVE, "--device", "x.mcap")
    assert "x.mcap was made with a robot that is not in the catalog; got 'mona'" in line
    assert "--robot FILE" in line
    assert main(["teleop", *LIVE, "--device", "x.mcap", "--robot", "mona.urdf"]) == 0
    assert [one.robot.name for one in begun] == ["mona"]


def test_a_run_that_is_terminated_leaves_a_finished_recording_that_plays(in_folder, capsys):
    line = ["teleop", "--no-open", "--port", "0", "--out", "out"]
    command = [sys.executable, "-m", "poise", *line]
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as process:
        assert process.stdout is not None
        lines = [process.stdout.readline() for _ in range(5)]
        url = lines[1].split()[-1]
        channel = url.replace("http", "ws").replace("/?", "/control?")
        with connect(channel, proxy=None, max_queue=None) as operator:
            times = []
            while len(times) < 20:
                operator.send(json.dumps({"do": "drive", "lift": [False, True]}))
                status = json.loads(operator.recv(timeout=60))
                times += [status["time"]] if "time" in status else []
            process.send_signal(signal.SIGTERM)
            assert process.wait(timeout=280) == 0
        assert "take-001.mcap" in process.stdout.read()
    assert len(read_recording(in_folder / "out" / "take-001.mcap").samples) > 5
    # A recording that is played leads the feet, hence is recorded; the closing line names it.
    assert main([*line, "--seconds", "2", "--device", "out/take-001.mcap"]) == 0
    assert capsys.readouterr().out.endswith("recordings in out: take-002.mcap\n")
