"""`poise teleop`: what it prints, what it leaves, and one clean line for bad input."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from dataclasses import replace
from importlib.resources import files
from importlib.util import find_spec

import pytest
import yaml

from poise.cli._live import TeleopVerb
from poise.cli.main import main
from poise.errors import MissingExtraError

needs_page = pytest.mark.skipif(
    find_spec("websockets") is None or find_spec("mujoco") is None,
    reason="the extra teleop is not installed",
)


def refused(capsys, *arguments):
    """The one line of bad input."""
    assert main(["teleop", "--no-open", "--port", "0", "--seconds", "1", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("poise: ")
    assert err.count("\n") == 1
    return err


@pytest.fixture
def in_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def begun(monkeypatch):
    """The sessions that are begun."""
    from poise.apps import live

    seen, session = [], live.LiveSession

    def made(*arguments, **options):
        seen.append(session(*arguments, **options))
        return seen[-1]

    monkeypatch.setattr(live, "LiveSession", made)
    return seen


@needs_page
def test_it_says_where_to_drive_where_to_watch_and_how_to_step(in_folder, capsys):
    assert main(["teleop", "--no-open", "--port", "0", "--seconds", "0.5"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert re.search(r"drive: http://127\.0\.0\.1:\d+/\?token=\S{16,}", out)
    assert re.search(r"watch: http://127\.0\.0\.1:\d+/\n", out)
    assert "To step: hold Q or E" in out
    assert "nobody drove" in out


@needs_page
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--robot", "arm6"), "cannot walk on two feet"),
        (("--robot", "no_such_robot"), "no_such_robot"),
        (("--port", "99999"), "0 to 65535"),
        (("--terrain", "swamp"), "flat, obstacle, steps, bumps"),
        (("--device", "no_such_file"), "browser, gamepad, or the file"),
        (("--actuation", "velocity", "--controller", "osf"), "no such controller"),
        (("--hand-scale", "0"), "hand_scale is out of range"),
        (("--hand-scale", "nan"), "hand_scale is out of range"),
        (("--seconds", "0"), "--seconds"),
        (("--seconds", "nan"), "--seconds"),
    ],
)
def test_bad_input_is_one_line(in_folder, capsys, arguments, words):
    assert words in refused(capsys, *arguments)
    assert not list(in_folder.iterdir())


@needs_page
@pytest.mark.parametrize("asked", [None, "flat"])
def test_a_recording_is_played_on_its_own_terrain_unless_another_is_asked_for(
    in_folder, begun, asked
):
    from poise.apps.teleoperation import VELOCITY_TELEOP_PLANT, run_teleop, terrain_blocks
    from poise.locomotion import ScriptedDevice, WayPoint
    from poise.robots import load_robot

    blocks = terrain_blocks("bumps", load_robot("biped20"), seed=3)
    run_teleop(
        load_robot("biped20"),
        lambda c: ScriptedDevice([WayPoint(at=0.0, left=(0.0, 0.0, 0.0))], *c.estimator.anchors),
        replace(VELOCITY_TELEOP_PLANT, blocks=blocks),
        duration=0.1,
        recording=in_folder / "x.mcap",
    )
    line = ["teleop", "--no-open", "--port", "0", "--seconds", "0.3", "--device", "x.mcap"]
    assert main(line + ([] if asked is None else ["--terrain", asked])) == 0
    assert [each.loop.plant.config.blocks for each in begun] == [blocks if asked is None else ()]


@pytest.fixture
def recorded(in_folder):
    """The file of a short run of humanoid33 at velocity level."""
    from poise.apps.teleoperation import VELOCITY_TELEOP_PLANT, run_teleop
    from poise.locomotion import ScriptedDevice
    from poise.robots import load_robot

    run_teleop(
        load_robot("humanoid33"),
        lambda c: ScriptedDevice([], *c.estimator.anchors),
        VELOCITY_TELEOP_PLANT,
        duration=0.1,
        recording=in_folder / "x.mcap",
    )
    return in_folder / "x.mcap"


def play(capsys, *arguments):
    """Play a recording; return the text on stderr."""
    line = ["teleop", "--no-open", "--port", "0", "--seconds", "0.3", "--device", "x.mcap"]
    assert main([*line, *arguments]) == 0
    return capsys.readouterr().err


@needs_page
def test_a_recording_is_repeated_by_its_own_robot_and_actuation(recorded, capsys, begun):
    assert play(capsys) == play(capsys, "--robot", "humanoid33") == ""
    assert play(capsys, "--actuation", "velocity", "--hand-scale", "1") == ""
    for each in begun:
        plant = each.loop.plant.config
        made = (each.loop.lead.robot.name, plant.actuation, plant.self_contact)
        assert made == ("humanoid33", "velocity", False)


@needs_page
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
    assert play(capsys, *arguments) == (
        "poise: the samples of x.mcap were recorded with robot humanoid33, velocity commanded; "
        "this is no replay of that run\n"
    )
    (loop,) = (each.loop for each in begun)
    assert (loop.lead.robot.name, loop.plant.config.actuation) == (name, actuation)


@needs_page
def test_recordings_that_cannot_lead_are_one_line(recorded, capsys):
    from poise.apps.teleoperation import write_recording

    content = recorded.read_bytes()
    recorded.write_bytes(content.replace(b"poise log 3", b"poise log 1"))
    assert "written by 'poise log 1'" in refused(capsys, "--device", "x.mcap")
    recorded.write_bytes(content[:200])
    assert "x.mcap is no recording" in refused(capsys, "--device", "x.mcap")
    recorded.write_bytes(content[: len(content) - 10])
    assert "not finished" in play(capsys)
    write_recording(recorded, [], robot="biped20", dt=0.002)
    assert "x.mcap has no samples of an operator" in refused(capsys, "--device", "x.mcap")


@needs_page
def test_a_recording_of_a_robot_from_a_file_is_played_with_that(in_folder, capsys, begun):
    from poise.apps.teleoperation import VELOCITY_TELEOP_PLANT, run_teleop
    from poise.locomotion import ScriptedDevice
    from poise.robots import load_robot

    text = load_robot("biped20").source.text.replace('name="biped20"', 'name="mona"')
    (in_folder / "mona.urdf").write_text(text, encoding="utf-8")
    facts = yaml.safe_load((files("poise.robots") / "descriptions" / "biped20.yaml").read_bytes())
    del facts["catalog"]
    (in_folder / "mona.poise.yaml").write_text(yaml.safe_dump(facts), encoding="utf-8")
    run_teleop(
        load_robot("mona.urdf"),
        lambda c: ScriptedDevice([], *c.estimator.anchors),
        VELOCITY_TELEOP_PLANT,
        duration=0.1,
        recording=in_folder / "x.mcap",
    )
    line = refused(capsys, "--device", "x.mcap")
    assert "x.mcap was made with a robot that is not in the catalog; got 'mona'" in line
    assert "--robot FILE" in line
    line = ["teleop", "--no-open", "--port", "0", "--seconds", "0.3", "--device", "x.mcap"]
    assert main([*line, "--robot", "mona.urdf"]) == 0
    assert [each.loop.lead.robot.name for each in begun] == ["mona"]


@needs_page
def test_the_closing_line_names_what_this_run_has_recorded(in_folder, capsys):
    """A recording that is played leads the feet, hence is recorded."""
    from poise.apps.teleoperation import run_teleop
    from poise.locomotion import ScriptedDevice
    from poise.robots import load_robot

    run_teleop(
        load_robot("biped20"),
        lambda c: ScriptedDevice([], *c.estimator.anchors),
        duration=0.1,
        recording=in_folder / "x.mcap",
    )
    line = ["teleop", "--no-open", "--port", "0", "--seconds", "0.4", "--out", "out"]
    for take in ("take-001.mcap", "take-002.mcap"):
        assert main([*line, "--device", "x.mcap"]) == 0
        assert capsys.readouterr().out.endswith(f"recordings in out: {take}\n")
    assert main(line) == 0
    assert capsys.readouterr().out.endswith("recordings in out: none, nobody drove\n")


@needs_page
@pytest.mark.parametrize("verb", ["teleop", "drive"])
@pytest.mark.parametrize("noise", [False, True])
def test_sensors_have_noise_if_that_is_asked_for(in_folder, begun, verb, noise):
    from poise.sim import SensorConfig

    line = [verb, "--no-open", "--port", "0", "--seconds", "0.1"]
    assert main([*line, "--noise"] if noise else line) == 0
    sensors = begun[0].loop.plant.config.sensors
    assert sensors == (SensorConfig.typical() if noise else SensorConfig())


@needs_page
def test_what_finds_the_torques_is_asked_for_by_name(in_folder, begun):
    line = ["teleop", "--no-open", "--port", "0", "--seconds", "0.1", "--controller", "reduced"]
    assert main(line) == 0
    assert begun[0].loop.lead.leader.solved_by == "reduced"


@needs_page
@pytest.mark.parametrize("actuation", ["torque", "velocity"])
def test_hands_are_scaled_as_was_asked_for(in_folder, begun, actuation):
    line = ["teleop", "--no-open", "--port", "0", "--seconds", "0.1", "--actuation", actuation]
    assert main([*line, "--hand-scale", "0.5"]) == 0
    teleoperator = begun[0].loop.lead.leader
    usual = type(teleoperator)(teleoperator.robot, actuation=actuation).parameters
    assert teleoperator.parameters == replace(usual, hand_scale=0.5)


@needs_page
@pytest.mark.parametrize("actuation", ["torque", "velocity"])
def test_links_of_a_robot_that_a_person_leads_touch(in_folder, begun, actuation):
    line = ["teleop", "--no-open", "--port", "0", "--seconds", "0.1", "--actuation", actuation]
    assert main(line) == 0
    (plant,) = (each.loop.plant.config for each in begun)
    assert (plant.actuation, plant.self_contact) == (actuation, True)


@needs_page
def test_a_port_in_use_is_one_line(in_folder, capsys):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert f"cannot listen on port {port}" in refused(capsys, "--port", str(port))


@needs_page
@pytest.mark.skipif(find_spec("pygame") is None, reason="pygame is not installed")
def test_no_gamepad_is_one_line(in_folder, capsys):
    assert "no gamepad on this machine" in refused(capsys, "--device", "gamepad")


@needs_page
@pytest.mark.parametrize("content", [b"", b"no recording", b"{}" + b" " * 20000])
def test_a_file_that_is_no_recording_is_one_line(in_folder, capsys, content):
    (in_folder / "x.mcap").write_bytes(content)
    assert "x.mcap" in refused(capsys, "--device", "x.mcap")


def test_without_the_extra_the_line_says_how_to_install_it(in_folder, capsys, monkeypatch):
    def missing(options):
        raise MissingExtraError("websockets", "teleop", "Live teleoperation")

    monkeypatch.setattr(TeleopVerb, "act", missing)
    assert 'pip install "poise[teleop]"' in refused(capsys)


@needs_page
def test_a_run_that_is_terminated_leaves_a_finished_recording_that_plays(in_folder, capsys):
    pytest.importorskip("websockets")
    from websockets.sync.client import connect

    from poise.apps.teleoperation import read_recording

    command = [sys.executable, "-m", "poise", "teleop", "--no-open", "--port", "0"]
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    with subprocess.Popen(
        [*command, "--out", "out"], stdout=subprocess.PIPE, text=True, env=environment
    ) as process:
        assert process.stdout is not None
        lines = [process.stdout.readline() for _ in range(5)]
        url = lines[1].split()[-1]
        channel = url.replace("http", "ws").replace("/?", "/control?")
        with connect(channel, proxy=None, max_queue=None) as operator:
            end = time.monotonic() + 1.5
            while time.monotonic() < end:
                operator.send(json.dumps({"do": "drive", "lift": [False, True]}))
                time.sleep(0.03)
            process.send_signal(signal.SIGTERM)
            assert process.wait(timeout=60) == 0
        assert "take-001.mcap" in process.stdout.read()
    recording = read_recording(in_folder / "out" / "take-001.mcap")
    assert len(recording.samples) > 20
    assert main(
        ["teleop", "--no-open", "--port", "0", "--seconds", "1", "--device",
         "out/take-001.mcap"]
    ) == 0  # fmt: skip
