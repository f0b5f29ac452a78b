"""The paper's weights, as the study has them."""

import pytest

pytest.importorskip("mujoco")

from studies.step_teleoperation.literal import momentum_weights


def test_each_axis_of_the_momentum_counts_by_the_zmps_error_across_it():
    # (39c): k_1 = 4500 with r_y about x, k_2 = 7000 with r_x about y.
    assert momentum_weights([0.1, 0.0], 1e-3) == pytest.approx([1e-3, 70.0])
    assert momentum_weights([0.0, -0.1], 1e-3) == pytest.approx([45.0, 1e-3])
