"""`poise describe`: files, words, exit status."""

import json
import re

import pytest

pytest.importorskip("mujoco")

from poise.cli.main import main
from poise.robots import load_robot
from poise.robots._catalog import find_entry, open_entry


@pytest.fixture
def model(in_folder):
    """A humanoid's URDF without a description, in the folder to work in."""
    path = in_folder / "newcomer.urdf"
    path.write_text(open_entry(find_entry("humanoid33"))[0])
    return path


def test_a_new_robot_is_described_stands_squats_and_reaches(model, capsys):
    assert main(["describe", "newcomer.urdf", "--out", "out", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert [attempt["name"] for attempt in printed["trial"]] == ["stand", "squat", "reach"]
    assert all(attempt["ok"] for attempt in printed["trial"])
    robot = load_robot(model, model.parent / "out" / "newcomer.poise.yaml")
    assert robot.soles["left_sole"].length == pytest.approx(0.28, abs=2e-3)
    page = (model.parent / "out" / "describe.html").read_text()
    for words in ("largest rectangle on the flat lower face", "Soles from above", "rotor", "squat"):
        assert words in page


def test_an_arm_holds_still_and_reaches(model, capsys):
    model.with_name("arm.urdf").write_text(open_entry(find_entry("arm6"))[0])
    assert main(["describe", "arm.urdf", "--out", "out"]) == 0
    printed = capsys.readouterr().out
    assert "base fixed, hand on " in printed
    assert "taken as fixed" in printed
    assert "ok    hold" in printed
    assert "ok    reach" in printed
    page = (model.parent / "out" / "describe.html").read_text()
    assert "Soles from above" not in page


def test_saved_beside_the_model_it_is_found_and_another_is_written_over_only_by_force(
    model, capsys
):
    line = ["describe", "newcomer.urdf", "--save", "--no-trial"]
    assert main(line) == 0
    assert "left_sole 280 x 140 mm on left_foot_link" in capsys.readouterr().out
    # Without a warning.
    assert load_robot(model).hands == ("left_hand", "right_hand")
    assert main(line) == 0
    saved = model.parent / "newcomer.poise.yaml"
    proposed = saved.read_text()
    saved.write_text(proposed + "# measured by hand\n")
    capsys.readouterr()
    assert main(line) == 2
    assert "--force" in capsys.readouterr().err
    assert saved.read_text().endswith("# measured by hand\n")
    assert main([*line, "--force"]) == 0
    assert saved.read_text() == proposed


@pytest.mark.parametrize(
    ("text", "words"), [("", "has no mass"), ("<robot name='r'/>", "no links")]
)
def test_a_file_that_is_no_robot_is_one_line_and_status_two(model, refused, text, words):
    bare = re.sub(r"<inertial>.*?</inertial>", "", model.read_text(), flags=re.DOTALL)
    model.write_text(text or bare)
    assert words in refused("describe", "newcomer.urdf", "--no-trial")


def test_a_robot_that_falls_is_told_in_words_with_status_one(model, capsys):
    model.write_text(re.sub(r'effort="[^"]*"', 'effort="0.5"', model.read_text()))
    assert main(["describe", "newcomer.urdf", "--out", "out"]) == 1
    out = capsys.readouterr().out
    assert "FAIL  stand: robot fell after" in out
    assert "at its limit" in out


def test_a_description_that_does_not_load_yet_is_written_with_what_to_mend(model, capsys):
    for link in ("right_wrist_roll_link", "right_hand_link"):
        bare = rf'(<link name="{link}">.*?)<inertial>.*?</inertial>'
        model.write_text(re.sub(bare, r"\1", model.read_text(), count=1, flags=re.DOTALL))
    assert main(["describe", "newcomer.urdf", "--out", "out", "--no-trial"]) == 1
    out = capsys.readouterr().out
    assert (
        "FAIL  load: newcomer.urdf has moving links without mass; got ['right_wrist_roll']" in out
    )
    assert "`locked`" in out
    saved = model.parent / "out" / "newcomer.poise.yaml"
    saved.write_text(saved.read_text() + "locked: [right_wrist_roll]\n")
    assert load_robot(model, saved).nj == 32
