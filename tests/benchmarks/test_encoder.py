"""What a controller sees of joints behind encoders."""

from itertools import pairwise

import numpy as np
import pytest

from benchmarks.bias.recording import Cubic
from benchmarks.rigid_plant import Encoder, JointSensors
from poise.errors import ConfigurationError


def test_resolution_is_that_of_17_bit_behind_100_to_1():
    assert Encoder().resolution == pytest.approx(2.0 * np.pi / (2**17 * 100.0))
    assert Encoder(bits=1, gear=1.0).resolution == pytest.approx(np.pi)


def test_angles_are_whole_steps_and_the_nearest_ones():
    encoder, rng = Encoder(bits=10, gear=3.0), np.random.default_rng(0)
    q = rng.uniform(-3.0, 3.0, 1000)
    read = encoder.read(q)
    steps = read / encoder.resolution
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-9)
    assert np.abs(read - q).max() <= 0.5 * encoder.resolution * (1 + 1e-12)
    np.testing.assert_array_equal(encoder.read(read), read)


def test_velocity_is_the_backward_difference_of_read_angles():
    encoder = Encoder()
    sensors, true_v = JointSensors(encoder), np.array([0.3])
    states = [sensors.read(true_v * t, true_v, t) for t in (0.0, 1e-3, 2e-3)]
    assert states[0].v[0] == 0.0
    for before, now in pairwise(states):
        assert now.v[0] == pytest.approx((now.q[0] - before.q[0]) / 1e-3)
        assert now.v[0] != 0.3
        assert abs(now.v[0] - 0.3) <= encoder.resolution / 1e-3


def test_without_an_encoder_everything_is_exact_and_copied():
    q, v = np.array([0.1, 0.2]), np.array([0.3, 0.4])
    state = JointSensors().read(q, v, 0.5)
    q[:] = v[:] = 0.0
    assert (state.q.tolist(), state.v.tolist(), state.time) == ([0.1, 0.2], [0.3, 0.4], 0.5)


@pytest.mark.parametrize(
    "wrong",
    [{"bits": 0}, {"bits": -1}, {"bits": 40}, {"gear": 0.0}, {"gear": -1.0}, {"gear": np.nan}],
    ids=str,
)
def test_encoders_that_cannot_be_are_refused(wrong):
    with pytest.raises(ConfigurationError, match="encoder"):
        Encoder(**wrong)


def test_the_cubic_goes_from_rest_to_rest():
    cubic = Cubic(displacement=0.4, duration=4.2)
    assert cubic.at(0.0)[:2] == (0.0, 0.0)
    assert cubic.at(4.2) == cubic.at(9.0) == (0.4, 0.0, 0.0)
    step = 1e-5
    for t in (0.5, 2.1, 3.9):
        (a, _, _), (x, v, acc), (b, _, _) = (cubic.at(t + s) for s in (-step, 0.0, step))
        assert v == pytest.approx((b - a) / (2 * step), rel=1e-6, abs=1e-9)
        assert acc == pytest.approx((b - 2 * x + a) / step**2, abs=1e-4)
