"""What the commanded velocity of the COM begins anew from when contacts change."""

import numpy as np
import pytest
from standing import PARAMETERS, footing

from poise.locomotion import Mode
from poise.locomotion._pendulum import ComShifter
from poise.locomotion._stepping._velocity_level import ComMotion

STILL = np.zeros(2)


def motion():
    return ComMotion(ComShifter(0.765), PARAMETERS.dt, 5.0)


def test_the_shock_of_a_landing_is_not_taken_for_the_velocity_of_the_com():
    ours = motion()
    for _ in range(20):
        ours.observe(STILL)
    ours.observe(np.array([0.2, -0.3]))
    ours.observe(np.array([-0.2, 0.3]))
    ours.restart()
    assert np.abs(ours.velocity).max() < 0.02


def test_a_velocity_that_lasts_is_taken_over():
    ours, sways = motion(), np.array([0.1, -0.2])
    for _ in range(100):
        ours.observe(sways)
    ours.restart()
    assert ours.velocity == pytest.approx(sways, rel=1e-3)


def test_what_is_commanded_is_expected_and_lags_nothing(get_robot):
    ours, stands = motion(), footing(get_robot("biped20"), Mode.TL)
    measured = STILL.copy()
    for _ in range(20):
        measured = measured + PARAMETERS.dt * ours.acceleration
        ours.observe(measured)
        ours.drive(stands)
    assert np.linalg.norm(measured) > 0.03
    assert ours.observed == pytest.approx(measured, abs=1e-9)
