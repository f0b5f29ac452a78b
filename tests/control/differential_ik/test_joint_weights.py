"""Chan and Dubey's weights (23), and what the paper leaves open: joints at or beyond a limit."""

import numpy as np
import pytest

from poise.control._differential_ik._bounds import LARGEST_WEIGHT, limit_weights


def weight(q, rate, q_min=-1.0, q_max=3.0):
    return limit_weights(*(np.array([x]) for x in (q, rate, q_min, q_max)))[0]


@pytest.mark.parametrize("q", [-0.9, 0.0, 0.5, 1.5, 2.7])
def test_a_joint_that_leaves_the_middle_has_the_weight_of_the_formula(q):
    outwards = np.sign(q - 1.0)
    assert weight(q, outwards) == pytest.approx(16.0 / (4.0 * (3.0 - q) * (q + 1.0)), rel=1e-12)
    assert weight(q, -outwards) == 1.0
    assert weight(q, 0.0) == 1.0


def test_in_the_middle_the_weight_is_one():
    for rate in (-1.0, 0.0, 1.0):
        assert weight(1.0, rate) == 1.0


@pytest.mark.parametrize("q", [3.0, 3.0 + 1e-12, 3.5, 100.0])
def test_at_and_beyond_a_limit_a_joint_may_come_back_but_hardly_go_on(q):
    assert weight(q, 1.0) == LARGEST_WEIGHT
    assert weight(q, -1.0) == 1.0
    assert weight(2.0 - q, -1.0) == LARGEST_WEIGHT
    assert weight(2.0 - q, 1.0) == 1.0


def test_weights_grow_towards_a_limit_without_a_jump():
    q = np.linspace(1.0, 3.2, 20001)
    n = len(q)
    found = limit_weights(q, np.ones(n), np.full(n, -1.0), np.full(n, 3.0))
    assert (np.diff(found) >= 0.0).all()
    assert found.max() == LARGEST_WEIGHT
    # By a factor, because it grows by four decades on the way.
    finer = limit_weights(
        np.linspace(2.99, 3.0, 200001), *(np.full(200001, x) for x in (1.0, -1.0, 3.0))
    )
    assert (finer[1:] / finer[:-1]).max() < 1.01
