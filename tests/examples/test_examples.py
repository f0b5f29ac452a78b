"""Every example runs, shortened, and prints what it is there to show."""

import re
import runpy
import subprocess
import sys
from html import unescape
from pathlib import Path

import nbclient
import nbformat
import pytest

FOLDER = Path(__file__).parents[2] / "examples"

SHORT = {
    "01_stand.py": ["--seconds", "0.3"],
    "02_reach.py": ["--seconds", "0.5"],
    "03_priorities.py": ["--seconds", "0.1"],
    "04_hierarchical_qp.py": [],
    "05_dynamics.py": [],
    "06_own_robot.py": ["--seconds", "0.4"],
    "07_push_and_log.py": ["--seconds", "0.3"],
    "08_scenario.py": ["--out", "run"],
    "09_own_task.py": ["--seconds", "0.2"],
    "10_operational_space.py": [],
    "11_walk.py": ["--steps", "1"],
    "12_batch.py": ["--count", "400"],
    "13_own_mujoco_loop.py": ["--seconds", "0.2"],
    "14_coming_from.py": [],
    "15_state_estimation.py": ["--seconds", "0.8"],
    "17_drive.py": ["--seconds", "0.6"],
    "18_lead_by_websocket.py": ["--steps", "1"],
    "20_force_feedback.py": [],
    "19_hands.py": ["--seconds", "2.6"],
    "21_robot_loop.py": ["--seconds", "0.1", "--record", "run.parquet"],
    "22_own_device.py": ["--seconds", "2.0"],
    "23_own_simulator.py": ["--seconds", "1.0"],
    "24_balance_client.py": ["--seconds", "0.3"],
}


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    def run_example(name: str, *arguments: str) -> str:
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "argv", [name, *(arguments or SHORT[name])])
        runpy.run_path(str(FOLDER / name), run_name="__main__")
        return capsys.readouterr().out

    return run_example


def numbers(pattern: str, text: str) -> list[float]:
    found = re.search(pattern, text)
    assert found is not None, text
    return [float(n) for n in found.groups()]


def test_every_example_is_tested():
    assert sorted(SHORT) == sorted(path.name for path in FOLDER.glob("*.py"))


@pytest.mark.parametrize("robot", ["humanoid33", "g1"])
def test_stand_prints_each_task_with_its_level_and_a_small_error(run, get_robot, robot):
    get_robot(robot)
    printed = run("01_stand.py", "--robot", robot, "--seconds", "0.3")
    assert printed.startswith("status: ok")
    assert numbers(r"3  com +(\S+) m ", printed)[0] < 1e-4
    assert numbers(r"4  right_hand pose +(\S+) m, rad", printed)[0] < 1e-4
    assert re.search(r"5  posture", printed)


def test_the_estimated_base_is_that_of_the_truth(run):
    printed = run("15_state_estimation.py")
    assert numbers(r"within (\S+) mm/s", printed)[0] < 30.0


def test_the_loop_of_a_robot_runs_to_the_end_twice_and_leaves_a_table(run):
    printed = run("21_robot_loop.py")
    assert printed.count("stopped: the end") == 2
    assert "50 ticks, last status ok" in printed
    assert Path("run.parquet").is_file()


def test_a_device_of_ones_own_is_tried_on_a_hard_plant(run):
    assert run("22_own_device.py").startswith("fell: False")


def test_a_simulator_of_ones_own_catches_the_arm(run):
    assert numbers(r"ends (\S+) mm", run("23_own_simulator.py"))[0] < 1.0


def test_a_batch_says_what_hands_at_rest_cost(run):
    printed = run("12_batch.py")
    for name in ("ahead", "back", "aside"):
        most, still = numbers(rf"{name}: (\S+) m/s\^2, .* (\S+) m/s\^2", printed)
        assert 0.5 < still < 3.0 < most < 8.0


def test_reach_follows_the_moving_target(run):
    hand, com = numbers(r"hand (\S+) mm, CoM (\S+) mm", run("02_reach.py"))
    assert hand < 1.0
    assert com < 1.0


def test_priorities_prints_both_orders(run):
    printed = run("03_priorities.py")
    below, above = printed.split("hand above balance")
    assert re.search(r"level 4  com .*\n  level 5  hand ", below)
    assert re.search(r"level 4  hand .*\n  level 5  com ", above)


def test_hierarchical_qp_gives_the_strict_answer_and_says_why(run):
    printed = run("04_hierarchical_qp.py")
    assert re.search(r"direct +x = \[1\. 4\.\]", printed)
    assert "'hand x' misses 1 of its rows" in printed
    assert "elbow limit" in printed


def test_operational_space_switches_within_its_bound(run):
    printed = run("10_operational_space.py")
    assert printed.startswith("status: ok")
    assert numbers(r"in a tick: (\S+) N m", printed)[0] <= 5.0
    assert numbers(r"left sole: (\S+) N", printed)[0] > 400.0


def test_dynamics_falls_freely_with_gravity(run):
    printed = run("05_dynamics.py")
    x, y, z = numbers(r"free fall: \[ *(\S+) +(\S+) +(\S+?)\]", printed)
    assert (x, y) == pytest.approx((0.0, 0.0), abs=1e-6)
    assert z == pytest.approx(-9.81, abs=1e-6)


def test_own_robot_stands_with_its_description(run):
    printed = run("06_own_robot.py")
    assert "walker12: 12 joints, 32.0 kg, soles left_sole, right_sole" in printed
    assert "status: ok" in printed


def test_own_robot_prints_a_template_that_names_its_links_and_joints(run, capsys):
    with pytest.raises(SystemExit) as end:
        run("06_own_robot.py", "--template")
    assert end.value.code is None
    printed = capsys.readouterr().out
    assert re.search(r"Links: .*left_foot", printed)
    assert re.search(r"Joints: .*left_knee", printed)


def test_push_and_log_leaves_a_log_that_reads_back(run, tmp_path):
    printed = run("07_push_and_log.py")
    assert "fallen: False" in printed
    assert numbers(r"push.mcap: (\d+) samples", printed)[0] == 300
    assert (tmp_path / "push.mcap").is_file()


@pytest.mark.slow
def test_scenario_holds_its_checks_and_leaves_a_report(tmp_path):
    # A process of its own, without the checks of shapes that make a whole run slow.
    command = [sys.executable, str(FOLDER / "08_scenario.py"), *SHORT["08_scenario.py"]]
    done = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "FAIL" not in done.stdout
    left = {path.name for path in (tmp_path / "run").iterdir()}
    assert {"report.html", "log.mcap", "summary.json"} <= left


def test_walk_makes_its_steps_and_says_how_well(run):
    printed = run("11_walk.py")
    assert "walk standing after 2 steps" in printed
    assert numbers(r"CoM within (\S+) mm", printed)[0] < 10.0


@pytest.fixture
def patient(monkeypatch):
    """An operator who is not thought gone when a busy machine stops all of this for a while."""
    monkeypatch.setattr("poise.locomotion._stepping._guard.LOST_AFTER", 10.0)


@pytest.mark.slow
def test_lead_by_websocket_makes_a_step(run, patient):
    pytest.importorskip("websockets")
    printed = run("18_lead_by_websocket.py")
    assert "I am the operator" in printed
    assert "['D', 'SR', 'TR']" in printed
    left, right = numbers(r"feet at (-?[\d.]+) and (-?[\d.]+) m", printed)
    assert left > 0.04
    assert abs(right) < 0.02


@pytest.mark.slow
def test_force_feedback_lets_the_hand_feel_the_landing(run, patient):
    pytest.importorskip("websockets")
    printed = run("20_force_feedback.py")
    felt, after = numbers(r"felt ([\d.]+) N upwards, after ([\d.]+) s", printed)
    assert 0.5 < felt <= 6.0
    assert after > 2.5
    assert numbers(r"and ([\d.]+) N in the two", printed)[0] < 0.3
    left, right = numbers(r"feet at (-?[\d.]+) and (-?[\d.]+) m", printed)
    assert right > 0.04
    assert abs(left) < 0.02


@pytest.mark.slow
def test_drive_says_what_was_asked_for(run):
    printed = run("17_drive.py")
    assert "0.5 s: asked for (0.3, 0.0, 0.0); nothing cut" in printed
    assert "walking after 0 steps" in printed


def test_own_task_brings_the_hands_closer(run):
    assert numbers(r"hands (\S+) mm apart", run("09_own_task.py"))[0] < 500.0  # from 590 mm


@pytest.mark.parametrize("robot", ["humanoid33", "g1"])
@pytest.mark.parametrize("actuators", ["motor", "position"])
def test_own_mujoco_loop_squats_with_motors_and_servos(run, get_robot, robot, actuators):
    get_robot(robot)
    arguments = ("--robot", robot, "--actuators", actuators, "--seconds", "2")
    printed = run("13_own_mujoco_loop.py", *arguments)
    assert printed.startswith("status: ok")
    assert numbers(r"3  com +(\S+) m ", printed)[0] < 1e-3
    depth, rejected = numbers(r"down by (\S+) mm, rejected (\d+)", printed)
    assert depth == pytest.approx(80.0, abs=1.0)
    assert rejected == 0


ELSEWHERE = {"left_hip_roll": -0.0472, "left_knee": 1.1494, "right_ankle_pitch": -0.5445}
"""Final joint angles of the programs in `examples/coming_from`: TSID 1.7.1, pink 4.4.0, mink 1.3.0
and placo 0.10.2."""


@pytest.mark.parametrize("by", ["torque", "velocity"])
def test_coming_from_ends_where_the_others_programs_end(run, by):
    printed = run("14_coming_from.py", "--by", by)
    moved = numbers(r"moved by (\S+) (\S+) (\S+) mm", printed)
    assert moved == pytest.approx([0.0, 20.0, -50.0], abs=0.1)
    for joint, angle in ELSEWHERE.items():
        assert numbers(rf"{joint} (\S+) rad", printed)[0] == pytest.approx(angle, abs=5e-4)


@pytest.mark.slow
def test_the_notebook_describes_a_new_robot_that_stands_through_a_push(tmp_path):
    notebook = nbformat.read(FOLDER / "16_onboarding.ipynb", as_version=4)
    done = nbclient.NotebookClient(notebook, resources={"metadata": {"path": tmp_path}}).execute()
    outputs = [out for cell in done.cells for out in cell.get("outputs", [])]
    printed = "".join(out.text for out in outputs if out.output_type == "stream")
    assert "left_sole 166 x 83 mm" in printed
    assert "soles.left_sole: the largest rectangle on the flat lower face" in printed
    assert "fallen: False" in printed
    shown = [out.data for out in outputs if "data" in out]
    assert sum("image/png" in data for data in shown) == 2
    assert "posture" in shown[1]["text/html"]
    assert "com" in shown[2]["text/html"]
    assert "<canvas" in unescape(shown[-1]["text/html"])


@pytest.mark.slow
def test_hands_prints_what_a_load_costs_and_who_is_at_the_edge(run, get_robot):
    get_robot("g1")
    printed = run("19_hands.py")
    numbers(r"load unknown: CoM ([\d.]+) mm off\n.*\nload known: CoM ([\d.]+) mm off", printed)
    assert printed.count("hands: at the edge of its reach: it comes no further, follows") == 2


def test_a_client_swings_the_arms_of_a_robot_that_stands(run, get_robot):
    get_robot("g1")
    pytest.importorskip("zmq", reason="the extra zmq is not installed: no pyzmq")
    printed = run("24_balance_client.py")
    assert "command ok, 0 messages refused" in printed
