"""The CoM shifter against its transfer functions, and what the gain rule is good for."""

import numpy as np
import pytest
from scipy import signal

from poise.errors import ConfigurationError
from poise.locomotion import ComShifter, natural_frequency, pole_zero_damping
from studies.step_teleoperation.cart_table import CartFlywheelTable

HEIGHT, MASS = 0.765, 65.0
DT = 1e-4


def respond(kp, kd, reference=1e-3, duration=1.5, substeps=1):
    """Time, CoM and CT-ZMP of a step of the reference, without saturation."""
    shifter = ComShifter(HEIGHT, kp=kp, kd=kd, acceleration_max=1e3)
    table = CartFlywheelTable(HEIGHT, MASS, np.zeros(1))
    target, still = np.array([reference]), np.zeros(1)
    count = round(duration / DT)
    com, zmp = np.zeros(count), np.zeros(count)
    for i in range(count):
        acceleration = shifter.acceleration(target, table.position, table.velocity)
        com[i] = table.position[0]
        zmp[i] = shifter.cart_table_zmp(table.position, acceleration)[0]
        table.step(acceleration, still, DT)
    return np.arange(count) * DT, com / reference, zmp / reference


def test_com_and_zmp_follow_their_transfer_functions():
    kp, kd, omega = 40.0, 9.0, natural_frequency(HEIGHT)
    time, com, zmp = respond(kp, kd)
    below = [1.0, kd, kp]
    # (27) and (28), integrated by another program; the rest is the sampling at 0.1 ms.
    _, expected = signal.step(signal.TransferFunction([kp], below), T=time)
    np.testing.assert_allclose(com, expected, atol=1e-3)
    _, expected = signal.step(signal.TransferFunction([-kp / omega**2, 0.0, kp], below), T=time)
    np.testing.assert_allclose(zmp, expected, atol=1e-3)


def test_transfer_functions_hold_at_frequencies():
    """(27), (28) and (31) to 1e-6: sine in, sine out, the loop closed exactly."""
    kp, omega = 40.0, natural_frequency(HEIGHT)
    for kd in (9.0, pole_zero_damping(kp, omega)):
        shifter = ComShifter(HEIGHT, kp=kp, kd=kd, acceleration_max=1e9)
        for frequency in (0.3, 1.0, 3.58, 10.0):
            s = 1j * frequency
            com = kp / (kp + kd * s + s * s)
            # The controller's own law, on complex amplitudes: it is linear while not saturated.
            parts = [
                shifter.acceleration(np.array([r]), np.array([p]), np.array([v]))[0]
                for r, p, v in (
                    (1.0, com.real, (s * com).real),
                    (0.0, com.imag, (s * com).imag),
                )
            ]
            acceleration = complex(*parts)
            assert abs(acceleration - s * s * com) < 1e-6 * abs(acceleration)
            zmp = com - acceleration / shifter.omega**2
            assert abs(zmp - kp * (1 - s * s / omega**2) / (kp + kd * s + s * s)) < 1e-6 * abs(zmp)
            if kd != 9.0:
                assert abs(zmp - kp * (1 - s / omega) / (kp + omega * s)) < 1e-6 * abs(zmp)


def test_gain_rule_gives_a_first_order_zmp():
    kp, omega = 40.0, natural_frequency(HEIGHT)
    time, _, zmp = respond(kp, None)
    # (31): a jump to -kp/omega^2 ... then one exponential with the pole kp / omega.
    expected = 1.0 - (1.0 + kp / omega**2) * np.exp(-kp / omega * time)
    np.testing.assert_allclose(zmp, expected, atol=2e-3)


def settling_time(zmp, time, band=0.02):
    outside = np.flatnonzero(np.abs(zmp - 1.0) > band)
    return time[outside[-1]]


def test_gain_rule_is_the_fastest_that_does_not_overshoot():
    kp, omega = 40.0, natural_frequency(HEIGHT)
    rule = pole_zero_damping(kp, omega)
    time, _, zmp = respond(kp, rule)
    assert zmp.max() < 1.0 + 1e-3
    _, _, soft = respond(kp, 0.8 * rule)
    assert soft.max() > 1.01
    _, _, stiff = respond(kp, 1.2 * rule)
    assert stiff.max() < 1.0 + 1e-3
    assert settling_time(stiff, time) > 1.2 * settling_time(zmp, time)


@pytest.mark.parametrize("kp", [12.0, 9.81 / HEIGHT])
def test_a_stiffness_that_breaks_the_rule_is_refused(kp):
    with pytest.raises(ConfigurationError, match="k_p of the CoM shifter"):
        ComShifter(HEIGHT, kp=kp)


@pytest.mark.parametrize("change", [{"acceleration_max": 0.0}, {"kd": -1.0}, {"gravity": np.nan}])
def test_numbers_that_cannot_be_right_are_refused(change):
    with pytest.raises(ConfigurationError):
        ComShifter(HEIGHT, **change)


def test_acceleration_is_limited_axis_by_axis():
    shifter = ComShifter(HEIGHT)
    wanted = shifter.acceleration(np.array([1.0, 0.001]), np.zeros(2), np.zeros(2))
    np.testing.assert_allclose(wanted, [0.8, 0.04])


def test_an_unlimited_answer_is_the_dual_regulators_in_the_divergent_component():
    shifter = ComShifter(HEIGHT, kp=40.0)
    r, p, v = np.array([0.1]), np.array([0.03]), np.array([0.2])
    zmp = shifter.cart_table_zmp(p, shifter.unlimited(r, p, v))
    xi = p + v / shifter.omega
    np.testing.assert_allclose(zmp, r + (1.0 + 40.0 / shifter.omega**2) * (xi - r), atol=1e-12)
