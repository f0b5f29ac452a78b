"""The simulated parts of the study of the bias acceleration, in their quick version."""

import numpy as np
import pytest

from studies.bias_acceleration.cup import (
    FORMULAS,
    KP,
    CupRun,
    carry_cup,
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
