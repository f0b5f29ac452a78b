"""An operator walks the robot in a scenario: the shipped one, own way-points, bad input."""

import numpy as np
import pytest
from dry_run import forbid_ticks

from poise.apps.scenarios import parse_scenario, run_scenario
from poise.apps.teleoperation import RecordingError, write_recording
from poise.errors import PoiseError
from poise.locomotion import ScriptedDevice, StepTeleoperator, WayPoint
from poise.sim import read_log

OWN = """
name: one foot up
robot: biped20
controller: step_teleoperation
duration: 2.0
plant: {control_dt: 0.005, servo: {stiffness: 70.0, damping: 2.5}}
devices:
  points:
    - {at: 0.2, right: [0.0, 0.0, 0.0]}
    - {at: 0.8, right: [0.0, 0.0, 0.08]}
"""


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["biped20", "humanoid33", "g1"])
def test_the_robot_is_walked_over_the_obstacle_by_torques(shipped_run, robot):
    """On biped20 it is the main job, which `.ci/run` runs with its checks."""
    outcome = shipped_run("over_an_obstacle", robot)
    assert outcome.status == 0, outcome.out + outcome.err
    assert outcome.summary["fell"] is False
    assert outcome.summary["missed_ticks"] == 0
    assert max(outcome.summary["residual_max"][:2]) < 1e-6
    # However far the foot in the air is from the ground, the pelvis stays upright.
    record = read_log(outcome.folder / "log.mcap")
    assert np.abs(record["error/pelvis orientation"]).max() < 0.1


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["biped20", "g1"])
def test_the_robot_is_walked_over_the_obstacle_by_velocities(shipped_run, robot):
    outcome = shipped_run("over_an_obstacle_velocity", robot)
    assert outcome.status == 0, outcome.out + outcome.err
    summary = outcome.summary
    assert (summary["controller"], summary["robot"]) == ("step_teleoperation", robot)
    assert summary["fell"] is False
    assert summary["missed_ticks"] == 0
    # Level 2 of the paper gives way by design; what is above it holds exactly.
    assert max(summary["residual_max"][:3]) < 1e-9
    assert len([c for c in summary["checks"] if "residual" in c["name"]]) == 2
    page = (outcome.folder / "report.html").read_text()
    assert all(mode in page for mode in ("TL", "SL", "TR", "SR"))
    log = read_log(outcome.folder / "log.mcap")
    assert log.complete
    _, clearance = log.signal("clearance")
    assert 0.005 <= float(clearance.min()) < 0.2


@pytest.fixture(scope="module")
def own():
    return run_scenario(parse_scenario(OWN, "own.yaml"))


def test_way_points_of_ones_own_lift_a_foot(own):
    signals = own.signals
    assert own.ok
    assert [mode for _, mode in signals.modes] == ["D", "TL", "SL"]
    assert signals.soles["right_sole"].position[-1, 2] > 0.05
    assert {"estimator", "leader", "solve"} <= set(signals.tick_us)
    # The devices are in the replay, where the operator held them as the robot knows the world.
    device = signals.targets["right device"]
    assert device[-1, 2] - device[0, 2] == pytest.approx(0.08, abs=1e-4)
    assert np.isfinite(signals.zmp_reference).all()


def changed(old, new):
    assert old in OWN
    return OWN.replace(old, new)


POINTS = OWN[OWN.index("  points:") :]

CASES = {
    "no devices": (OWN[: OWN.index("devices:")], "needs devices"),
    "devices that nobody heeds": (
        changed("controller: step_teleoperation\n", ""),
        "does not heed the devices",
    ),
    "another period": (changed("0.005", "0.001"), "control period.*0.001.*0.005"),
    "a robot without feet": (changed("biped20", "arm6"), "feet|walked|soles"),
    "a strategy": (
        changed("step_teleoperation", "{name: step_teleoperation, strategy: hqp}"),
        "strategy.*hqp.*com_shifter",
    ),
    "motions": (
        OWN + "motions: [{task: com, at: 0, over: 1, by: [0, 0, 0]}]\n",
        "takes no motions",
    ),
    "an unknown script": (OWN.replace(POINTS, "  script: dance\n"), "dance.*over_an_obstacle"),
    "script and points": (
        changed("devices:\n", "devices:\n  script: switch_feet\n"),
        "led in one way",
    ),
    "time that goes back": (changed("at: 0.8", "at: 0.1"), "order of time.*0.2.*0.1"),
    "no device": (changed("right: [0.0, 0.0, 0.08]", ""), "moves no device"),
}


@pytest.mark.parametrize("case", CASES)
def test_bad_devices_are_refused_before_the_first_tick(case, monkeypatch):
    text, message = CASES[case]
    forbid_ticks(monkeypatch)
    with pytest.raises(PoiseError, match=rf"(?s){message}"):
        run_scenario(parse_scenario(text, "own.yaml"))


def recorded(path, robot):
    """The samples of the scenario's devices, recorded."""
    teleoperator = StepTeleoperator(robot, actuation="velocity")
    points = [WayPoint(at=0.2, right=(0.0, 0.0, 0.0)), WayPoint(at=0.8, right=(0.0, 0.0, 0.08))]
    device = ScriptedDevice(points, *teleoperator.estimator.anchors)
    samples = [(tick, device.sample(0.005 * tick)) for tick in range(400)]
    write_recording(path, samples, robot=robot.name, dt=0.005)
    return OWN.replace(POINTS, f"  recording: {path}\n")


def test_a_recording_leads_the_feet_as_way_points_do(own, get_robot, tmp_path):
    text = recorded(tmp_path / "lift.mcap", get_robot("biped20"))
    led = run_scenario(parse_scenario(text, "led.yaml"))
    assert led.signals.modes == own.signals.modes
    np.testing.assert_array_equal(
        led.signals.targets["right device"], own.signals.targets["right device"]
    )


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, r"x\.mcap.*does not exist"),
        (b"", r"x\.mcap is no recording"),
        ([], r"x\.mcap has no samples"),
    ],
    ids=["missing", "empty", "no samples"],
)
def test_a_recording_that_cannot_lead_is_said(tmp_path, monkeypatch, content, words):
    forbid_ticks(monkeypatch)
    path = tmp_path / "x.mcap"
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif content is not None:
        write_recording(path, content, robot="biped20", dt=0.005)
    text = OWN.replace(POINTS, f"  recording: {path}\n")
    with pytest.raises(RecordingError, match=words):
        run_scenario(parse_scenario(text, "x.yaml"))
