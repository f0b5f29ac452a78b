"""The simulated parts of the study of the bias acceleration, in their quick version."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest
from slow import slow

from poise.dynamics import Dynamics, RobotState
from poise.robots import load_robot
from studies.bias_acceleration.cup import (
    FORMULAS,
    KP,
    PAPER_GRAVITY,
    CupRun,
    carry_cup,
    level_start,
)
from studies.bias_acceleration.side_by_side import compare_along
from studies.bias_acceleration.simulation import ENCODER

pytest.importorskip("matplotlib")
pytest.importorskip("mujoco")

SHARE = 0.05


@pytest.fixture(scope="module")
def exact():
    return carry_cup(CupRun(formula="original", share=SHARE))


@pytest.fixture(scope="module")
def along(exact):
    return compare_along(exact, KP)


def test_the_cup_starts_level_and_left_of_the_middle():
    robot = load_robot("arm6")
    dynamics = Dynamics(robot)
    dynamics.update(RobotState(level_start(robot), np.zeros(6)))
    hand = dynamics.frame(robot.frame_id("hand"))
    assert hand.position[1] == pytest.approx(-0.2, abs=1e-12)
    assert abs(hand.rotation[2, 2]) == pytest.approx(1.0, abs=1e-12)


def test_the_task_is_met_to_rounding_right_after_each_torque(exact):
    assert exact.sigma.max() < 1e-12
    assert exact.regular
    assert exact.held == 0
    # Between ticks the torque is held, so that some error is left.
    assert 1e-9 < exact.tilt.max() < 1e-5


def test_formulas_agree_on_the_same_states(along):
    size = np.abs(along.bias["original"]).max()
    assert along.bias_difference("proposed").max() < 1e-12 * size
    assert along.torque_difference("proposed") < 1e-13
    assert along.torque_difference("fused") < 1e-13


def test_the_bias_acceleration_is_a_prediction_of_what_differences_see_a_tick_later(along):
    predicted, seen = along.bias["original"], along.bias["numerical"]
    size = np.linalg.norm(predicted, axis=1).max()
    late = np.linalg.norm(seen[1:] - predicted[:-1], axis=1)
    assert late.max() < 0.005 * size
    # At the start the acceleration jumps: there the difference knows nothing of it yet.
    assert np.linalg.norm(seen[0] - predicted[0]) == pytest.approx(size, rel=0.1)


def test_the_bias_acceleration_knows_no_gravity(exact, along):
    swept = np.linspace(PAPER_GRAVITY, 9.8, len(exact.time))
    told = compare_along(exact, KP, gravity=swept)
    size = np.abs(along.bias["original"]).max()
    assert np.abs(told.bias["original"] - along.bias["original"]).max() < 1e-12 * size
    # The torque does.
    assert np.abs(told.torque["original"] - along.torque["original"]).max() > 10.0


def test_behind_encoders_original_proposed_and_fused_carry_the_cup_alike_and_numerical_does_not():
    behind = {
        name: carry_cup(CupRun(formula=name, encoder=ENCODER, share=SHARE)) for name in FORMULAS
    }
    most = {name: trace.sigma.max() for name, trace in behind.items()}
    assert [most["proposed"], most["fused"]] == pytest.approx([most["original"]] * 2, rel=0.02)
    assert most["numerical"] > 10.0 * most["original"]
    tilts = {name: trace.tilt.max() for name, trace in behind.items()}
    assert [tilts["proposed"], tilts["fused"]] == pytest.approx([tilts["original"]] * 2, rel=0.02)
    # On the same states the torques agree to rounding, the bias acceleration of "numerical" to
    # nothing at all.
    along = compare_along(behind["original"], KP)
    size = np.abs(along.bias["original"]).max()
    assert along.bias_difference("proposed").max() < 1e-12 * size
    assert along.torque_difference("fused") < 1e-13
    assert along.bias_difference("numerical").max() > 0.1 * size


FIGURES = {"figure-6": ("[°/s²]", "[0.001°]", "time [s]")}
"""Of the simulated parts, and units that their axes have."""


@pytest.fixture(scope="module", params=["some parts", slow("all parts")])
def study(request, tmp_path_factory):
    """The quick study from the command line, in a process whose loops are not type-checked."""
    folder, parts, figures = tmp_path_factory.mktemp("study"), [], [*FIGURES]
    if request.param == "some parts":
        parts, figures = ["--part", "gravity", "--part", "model-error"], []
    start = "import sys; from studies.__main__ import main; from poise import _progress; "
    start += "_progress.LINE_EVERY = float('inf'); sys.exit(main(sys.argv[1:]))"
    command = [sys.executable, "-W", "error", "-c", start, "bias-acceleration"]
    done = subprocess.run(
        [*command, *parts, "--quick", "--json", "--out", str(folder)],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
    )
    assert done.stderr == ""
    rows = [json.loads(line) for line in done.stdout.splitlines()]
    assert rows == json.loads((folder / "study.json").read_text())
    found = {row["name"]: row for row in rows}
    assert len(found) == len(rows), "two findings of one name"
    assert not [name for name in found if name.startswith("part ")], "a part without a result"
    return folder, found, figures


def test_the_page_and_every_figure_are_there_with_units_on_the_axes(study):
    folder, _, figures = study
    page = (folder / "study.html").read_text()
    for name in figures:
        svg = (folder / f"{name}.svg").read_text()
        assert [unit for unit in FIGURES[name] if unit not in svg] == []
        assert f'<figure id="{name}"' in page


def test_what_the_paper_claims_holds(study):
    _, found, _ = study
    # How long things take depends on who else uses the machine.
    assert [name for name, row in found.items() if not row["ok"] and "time" not in name] == []


@pytest.mark.parametrize("study", [slow("all parts")], indirect=True)
def test_tables_2_and_3_stand_beside_the_papers(study):
    _, found, _ = study
    assert found["Table 2: greatest d_P"]["ours"] < 1e-10
    assert found["Table 2: greatest d_N"]["paper"] == 246.94
    assert found["Table 3: greatest σ, numerical to original"]["ours"] > 100
    assert found["Table 3: greatest tilt, numerical to original, over the gains tried"]["ours"] > 10


@pytest.mark.parametrize("study", [slow("all parts")], indirect=True)
def test_original_proposed_and_fused_carry_the_cup_alike(study):
    _, found, _ = study
    for what in ("σ", "tilt"):
        same = [found[f"Table 3: greatest {what}, {f}"]["ours"] for f in ("proposed", "fused")]
        original = found[f"Table 3: greatest {what}, original"]["ours"]
        assert same == pytest.approx([original] * 2, rel=0.02)
