"""The model, the body rotator and the saturation."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from poise.dynamics import saturate
from poise.errors import ConfigurationError
from poise.locomotion import BodyRotator, ComShifter
from studies.step_teleoperation.cart_table import CartFlywheelTable


def test_rotator_puts_the_zmp_on_its_reference():
    """(29): with shifter and rotator together r = r_ref, whatever the state."""
    table = CartFlywheelTable(0.765, 65.0, np.array([0.02, -0.05]))
    shifter, rotator = ComShifter(0.765), BodyRotator(table.weight)
    reference = np.array([0.1, 0.03])
    for _ in range(50):
        acceleration = shifter.acceleration(reference, table.position, table.velocity)
        about_x, about_y = rotator.momentum_rate(
            reference, shifter.cart_table_zmp(table.position, acceleration)
        )
        # (2): the sense in which momentum about y and about x moves the ZMP.
        table.step(acceleration, np.array([about_y, -about_x]), 0.005)
        np.testing.assert_allclose(table.zmp, reference, atol=1e-12)
    assert np.abs(table.momentum).max() > 1.0


def test_the_printed_sign_of_25b_doubles_the_error():
    """By (24c) u_2 = W (r_ref - rhat) gives r = 2 rhat - r_ref; (29) has it the other way round."""
    table, reference = (
        CartFlywheelTable(0.765, 65.0, np.array([0.02, -0.05])),
        np.array([0.1, 0.03]),
    )
    shifter = ComShifter(0.765)
    acceleration = shifter.acceleration(reference, table.position, table.velocity)
    cart_table_zmp = shifter.cart_table_zmp(table.position, acceleration)
    table.step(acceleration, table.weight * (reference - cart_table_zmp), 0.005)
    np.testing.assert_allclose(table.zmp, 2.0 * cart_table_zmp - reference, atol=1e-12)
    assert np.abs(table.zmp - reference).min() > 0.1


def test_steps_add_up():
    rng = np.random.default_rng(0)
    whole = CartFlywheelTable(0.8, 50.0, np.zeros(2))
    parts = CartFlywheelTable(0.8, 50.0, np.zeros(2))
    for _ in range(20):
        u1, u2 = rng.standard_normal((2, 2))
        whole.step(u1, u2, 0.01)
        for _ in range(10):
            parts.step(u1, u2, 0.001)
    np.testing.assert_allclose(whole.position, parts.position, atol=1e-14)
    np.testing.assert_allclose(whole.velocity, parts.velocity, atol=1e-14)
    np.testing.assert_allclose(whole.momentum, parts.momentum, atol=1e-14)


@given(
    st.floats(1e-3, 1e3),
    st.lists(st.floats(-1e6, 1e6, allow_subnormal=False), min_size=1, max_size=6),
)
def test_saturation_shortens_and_does_not_turn(limit, values):
    value = np.array(values)
    answer = saturate(limit, value)
    assert np.linalg.norm(answer) <= limit * (1.0 + 1e-12)
    if np.linalg.norm(value) <= limit:
        np.testing.assert_array_equal(answer, value)
    else:
        cosine = answer @ value / np.linalg.norm(answer) / np.linalg.norm(value)
        assert cosine == pytest.approx(1.0)


@pytest.mark.parametrize(("height", "mass"), [(0.0, 65.0), (np.nan, 65.0), (0.7, -1.0)])
def test_a_table_that_cannot_be_is_refused(height, mass):
    with pytest.raises(ConfigurationError):
        CartFlywheelTable(height, mass, np.zeros(1))
