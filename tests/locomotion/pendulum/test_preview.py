"""Preview control against brute force, and the steady error of a window that is too short."""

import numpy as np
import pytest

from poise.errors import ConfigurationError
from poise.locomotion import PreviewControl


def test_gains_are_those_of_the_least_squares_problem():
    """Over a long horizon the first optimal jerk is what the gains say."""
    control = PreviewControl(0.765, 0.02, 60, R=1e-4)
    rng = np.random.default_rng(0)
    state, ahead = 0.05 * rng.standard_normal(3), 150
    reference = np.concatenate((0.1 * rng.standard_normal(60), np.zeros(ahead - 60)))
    # ZMP over the horizon as a linear function of the jerks.
    free, response = np.zeros(ahead), np.zeros((ahead, ahead))
    x = state.copy()
    impulse = control.b.copy()
    impulses = []
    for k in range(ahead):
        x = control.A @ x
        free[k] = control.c @ x
        impulses.append(control.c @ impulse)
        impulse = control.A @ impulse
    for k in range(ahead):
        response[k, : k + 1] = impulses[k::-1]
    A = np.concatenate((response, np.sqrt(1e-4) * np.eye(ahead)))
    b = np.concatenate((reference - free, np.zeros(ahead)))
    best = np.linalg.lstsq(A, b, rcond=None)[0][0]
    jerk = control.jerk(state[:, None], reference[:60, None])[0]
    # What lies beyond the horizon weighs little; the rest is the least squares' own rounding.
    assert jerk == pytest.approx(best, rel=1e-4)


@pytest.mark.parametrize(("length", "gain"), [(240, 0.972), (120, 0.756)])
def test_a_short_window_leaves_a_steady_error(length, gain):
    control = PreviewControl(0.765, 0.005, length)
    assert control.dc_gain == pytest.approx(gain, abs=5e-4)
    state, reference = np.zeros((3, 1)), np.full((length, 1), 0.21)
    for _ in range(4000):
        state = control.advance(state, control.jerk(state, reference))
    assert (control.c @ state)[0] == pytest.approx(0.21 * control.dc_gain, abs=1e-6)


def test_the_dc_gain_is_where_the_zmp_settles_with_any_weights():
    control = PreviewControl(0.6, 0.01, 80, Q=3.0, R=1e-5)
    state, reference = np.zeros((3, 1)), np.ones((80, 1))
    for _ in range(3000):
        state = control.advance(state, control.jerk(state, reference))
    assert (control.c @ state)[0] == pytest.approx(control.dc_gain, abs=1e-9)
    # At rest the ZMP is under the CoM.
    np.testing.assert_allclose(state[:, 0], [control.dc_gain, 0.0, 0.0], atol=1e-9)


@pytest.mark.parametrize("change", [{"length": 0}, {"dt": 0.0}, {"Q": -1.0}, {"height": np.nan}])
def test_bad_numbers_are_refused(change):
    arguments = {"height": 0.765, "dt": 0.005, "length": 100} | change
    with pytest.raises(ConfigurationError):
        PreviewControl(**arguments)
