"""The operator who leads feet, hands, head, body and stick."""

import numpy as np
import pytest

from poise.locomotion import StepTeleoperator

pytest.importorskip("mujoco")

from studies.torque_teleoperation.everything import EverythingOperator

SECONDS = 30.0


def said(get_robot, seed):
    """What the operator says of a robot that stays where it is."""
    teleoperator = StepTeleoperator(get_robot("biped20"))
    operator = EverythingOperator(teleoperator, seed)
    times = np.arange(0.0, SECONDS, teleoperator.dt)
    return [(time, operator.sample(float(time))) for time in times]


@pytest.fixture(scope="module")
def heard(get_robot):
    return said(get_robot, 4)


def test_all_of_it_is_led_and_no_faster_than_it_says(heard):
    samples = [(time, s) for time, s in heard if s is not None]
    body = np.array([[s.body.height, *s.body.torso, *s.body.turns] for _, s in samples])
    sticks = np.array([s.velocity for _, s in samples])
    heads = np.array([s.head.orientation for _, s in samples])
    assert (np.ptp(body, axis=0) > 0.02).all()
    assert body[:, 0].min() >= -0.1
    assert body[:, 0].max() <= 0.05
    assert np.abs(body[:, 1:4]).max() <= 0.4
    times = np.array([time for time, _ in samples])
    rates = np.abs(np.diff(body, axis=0)) / np.diff(times)[:, None]
    assert (rates.max(axis=0) <= np.array([0.1, 0.6, 0.6, 0.6, 0.6, 0.6]) + 1e-9).all()
    assert 0.05 < np.mean(sticks.any(axis=1)) < 0.8
    np.testing.assert_allclose(np.linalg.norm(heads, axis=1), 1.0, atol=1e-12)
    assert len(np.unique(heads[:, 0])) > 2
    for hand in (0, 1):
        clutches = [s.hands[hand].clutch for _, s in samples]
        assert any(clutches)
        assert not all(clutches)
        assert np.ptp([s.hands[hand].position for _, s in samples], axis=0).min() > 0.1
    feet = np.array([[s.place(0), s.place(1)] for _, s in samples])
    assert (np.ptp(feet[np.isfinite(feet).all(axis=(1, 2))], axis=0) > 0.02).all()
    assert any(s is None for _, s in heard)
