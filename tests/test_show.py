"""What things say of themselves, in a terminal and in a notebook, and what is drawn of them."""

import re
from xml.etree import ElementTree

import numpy as np
import pytest

import poise
from poise._show import brief, few, html_table
from poise.errors import UnknownNameError
from poise.stack import ComTask, FrameTask, PostureTask, Stack, SurfaceContact, TorqueLimit

pytest.importorskip("mujoco")


@pytest.fixture
def robot(get_robot):
    return get_robot("humanoid33")


@pytest.fixture
def stack():
    return Stack(
        [SurfaceContact("left_sole"), SurfaceContact("right_sole", friction=0.5)],
        [
            [ComTask(kp=36.0), FrameTask("pelvis", "orientation", weight=2.0)],
            [PostureTask(kp=25.0, kd=3.0)],
        ],
        torque_limit=TorqueLimit(0.8),
    )


def well_formed(html):
    """Parses a piece of HTML, which has to have one end for each beginning."""
    return ElementTree.fromstring(f"<div>{html}</div>")


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (40.0, "40"),
        ([1.0, 1.0, 1.0], "1"),
        (np.array([1.0, 2.5]), "[1, 2.5]"),
        (2.0 * np.sqrt(40.0), "12.65"),
    ],
)
def test_numbers_are_said_in_few_letters(value, said):
    assert brief(value) == said


def test_what_stands_in_a_table_is_text():
    assert "&lt;b&gt;" in html_table("<b>", ["<i>"], [["<u>", 1]])
    cells = [e.text for e in well_formed(html_table("t", ["a"], [["<u>"], [2]])).iter("td")]
    assert cells == ["<u>", "2"]


def test_tasks_and_contacts_say_their_gains(robot, stack):
    com, contact = stack.task("com"), stack.contact("right_sole")
    assert repr(com) == "ComTask('com', kp=36, kd=12)"
    assert repr(stack.task("posture")) == "PostureTask('posture', kp=25, kd=3)"
    assert repr(stack.task("pelvis orientation")).endswith("kp=100, kd=20, weight=2)")
    assert repr(contact) == "SurfaceContact('right_sole', friction=0.5, loaded)"
    stack.bind(robot)
    com.set_gains([1.0, 4.0, 9.0])
    assert repr(com) == "ComTask('com', kp=[1, 4, 9], kd=[2, 4, 6])"
    contact.release(0.0)
    contact.advance(0.0)
    contact.advance(1.0)
    assert repr(contact).endswith("free)")


def test_a_stack_shows_its_levels_under_the_physics(stack):
    assert repr(stack).splitlines() == [
        "Stack",
        "  level 1  dynamics, torque limit 80%",
        "  level 2  contacts left_sole, right_sole, joint limit",
        "  level 3  com (kp=36, kd=12); pelvis orientation (kp=100, kd=20, weight=2)",
        "  level 4  posture (kp=25, kd=3)",
    ]
    cells = [e.text for e in well_formed(stack._repr_html_()).iter("td")]
    assert cells[::2] == ["1", "2", "3", "4"]
    assert repr(Stack()).splitlines()[2] == "  level 2  contacts none, joint limit"


def test_a_controller_shows_how_it_stands(robot, stack):
    controller = poise.WholeBodyController(robot, stack)
    assert repr(controller) == ("WholeBodyController of humanoid33: 4 levels, commands torque, ok")
    assert "torque limit 80%" in controller._repr_html_()
    controller.step(poise.RobotState(robot.q_home, np.zeros(robot.nv)))
    cells = [e.text for e in well_formed(controller._repr_html_()).iter("td")]
    assert cells[:2] == ["3", "com"]
    controller.step(poise.RobotState(robot.q_home * np.nan, np.zeros(robot.nv)))
    assert repr(controller).endswith("bad_state")
    assert "entry 0 of the base is nan" in controller._repr_html_()


def test_a_plant_says_where_it_is(robot):
    plant = poise.Plant(robot, poise.sim.PlantConfig(control_dt=0.002))
    plant.step(None)
    assert repr(plant) == "Plant of humanoid33: torque every 2 ms, t = 0.002 s, up"
    names = [e.text for e in well_formed(plant._repr_html_()).iter("td")][::2]
    assert names == ["load of left_sole", "load of right_sole", "CoM", "torque"]


def test_a_robot_says_what_it_has_and_is_drawn(robot, get_robot):
    assert repr(robot) == (
        "Robot('humanoid33': 33 joints, 100.0 kg, left_sole, right_sole, left_hand, right_hand)"
    )
    pytest.importorskip("matplotlib")
    front, side = robot.show().axes
    assert (front.get_xlabel(), side.get_xlabel()) == ("y [m]", "x [m]")
    # It looks at the reader: its left hand is on the right.
    (left,) = [m for m in front.lines if m.get_marker() == "s"][:1]
    assert left.get_xdata()[0] > 0.1
    low, high = front.get_ylim()
    assert low < 0.0 < 1.5 < high < 2.0
    raised = robot.q_home.copy()
    raised[2] += 1.0
    assert robot.show(raised.tolist()).axes[0].get_ylim()[0] > 0.5
    assert len(get_robot("arm6").show().axes) == 2


@pytest.fixture(scope="module")
def run():
    text = """
name: short
duration: 0.05
checks: [{metric: com_error_max, at_most: 0.0}, {metric: com_error_max, at_most: 1.0e9}]
"""
    from poise.apps.scenarios import parse_scenario, run_scenario

    return run_scenario(parse_scenario(text, "s.yaml"))


def test_a_run_is_plotted_with_the_moments_of_failed_checks(run):
    pytest.importorskip("matplotlib")
    axes = run.plot().axes
    titles = [ax.get_ylabel() for ax in axes]
    assert titles[0] == "CoM error [m]"
    assert "torque / limit" in titles
    (failed,) = [c for c in run.checks if not c.ok]
    dashed = [line for line in axes[0].lines if line.get_linestyle() == "--"]
    assert [float(line.get_xdata()[0]) for line in dashed] == [failed.time]
    np.testing.assert_allclose(axes[0].lines[0].get_xdata(), run.signals.time)


def test_a_run_shows_its_checks_failed_ones_first(run):
    cells = [e.text for e in well_formed(run._repr_html_()).iter("td")]
    assert cells[0] == "failed"
    assert re.fullmatch(r"0\.\d\d s", cells[4])


def test_signals_of_a_record_are_plotted(run):
    pytest.importorskip("matplotlib")
    record = run.record
    assert repr(record).startswith("RunRecord(humanoid33, short: ")
    assert [ax.get_ylabel() for ax in record.plot("com", "torque").axes] == [
        "com\n[m]",
        "torque\n[N m]",
    ]
    assert len(record.plot("com").axes[0].lines) == 3
    assert record.plot().axes[0].get_ylabel().startswith(("com", "zmp", "error/"))
    with pytest.raises(UnknownNameError, match="com"):
        record.plot("con")


def test_a_record_is_a_table(run):
    pytest.importorskip("pandas")
    frame = run.record.to_pandas()
    assert {"com[0]", "com[1]", "com[2]"} <= set(frame.columns)
    np.testing.assert_allclose(frame["com[0]"].dropna(), run.record["com"][:, 0])


def test_of_many_names_a_sentence_has_the_first_and_how_many_more():
    assert few([]) == ""
    assert few(["a", "b", "c", "d"]) == "a, b, c, d"
    assert few(("a", "b", "c", "d", "e", "f")) == "a, b, c, d and 2 more"
