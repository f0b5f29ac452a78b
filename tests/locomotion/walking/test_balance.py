"""Feedback on the linear inverted pendulum by itself."""

import math

import numpy as np
import pytest

from poise.locomotion._support import SupportPolygon
from poise.locomotion._walking._dcm import DcmFeedback

OMEGA, DT = 3.5, 0.002
SOLE = SupportPolygon([(-0.1, -0.05), (0.1, -0.05), (0.1, 0.05), (-0.1, 0.05)], 0.01)
REST = ((0.0, 0.0),) * 3


def test_an_error_dies_out_with_the_gain_while_the_zmp_is_free():
    feedback = DcmFeedback(OMEGA, 4.0)
    c, v = np.array([0.01, -0.005]), np.zeros(2)
    first = c + v / OMEGA
    for _ in range(round(0.5 / DT)):
        a = np.array(feedback.acceleration(tuple(c), tuple(v), REST, SOLE.nearest))
        c, v = c + DT * v + 0.5 * DT**2 * a, v + DT * a
    np.testing.assert_allclose(c + v / OMEGA, first * math.exp(-4.0 * 0.5), rtol=0.02)


def test_the_zmp_stays_inside_the_soles():
    feedback = DcmFeedback(OMEGA, 4.0)
    a = feedback.acceleration((0.3, 0.2), (0.5, 0.0), REST, SOLE.nearest)
    assert feedback.zmp == pytest.approx((0.09, 0.04))
    assert a == pytest.approx((OMEGA**2 * (0.3 - 0.09), OMEGA**2 * (0.2 - 0.04)))


def test_it_continues_from_a_zmp_and_fades_into_its_own():
    ours, theirs = DcmFeedback(OMEGA, 4.0), (0.05, -0.03)
    c, v, zmps = np.array([0.01, -0.005]), np.zeros(2), []
    ours.continue_from(theirs)
    for _ in range(round(0.3 / DT)):
        a = np.array(ours.acceleration(tuple(c), tuple(v), REST, SOLE.nearest, DT))
        c, v = c + DT * v + 0.5 * DT**2 * a, v + DT * a
        zmps.append(ours.zmp)
    np.testing.assert_allclose(zmps[0], theirs)
    assert np.linalg.norm(np.diff(zmps, axis=0), axis=1).max() < 0.1 * np.linalg.norm(theirs)
    assert np.linalg.norm(zmps[-1]) < 0.01
    ours.continue_from(theirs)
    ours.begin()
    ours.acceleration(tuple(c), tuple(v), REST, SOLE.nearest, DT)
    np.testing.assert_allclose(ours.zmp, zmps[-1], atol=1e-3)
