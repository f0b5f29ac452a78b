import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from poise._compiled import compiled
from poise.dynamics import rotation_vector as in_python, sine_between, turn_between

AXES = [
    (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1),
    (1, 1, 0), (1, 0, 1), (0, 1, 1), (1, -1, 0), (1, 1, 1), (-1, 2, 3), (1e-4, 1, 0),
]  # fmt: skip
UNITS = [np.array(axis) / np.linalg.norm(axis) for axis in AXES]


def turn(unit, angle):
    return Rotation.from_rotvec(angle * unit).as_matrix()


@compiled
def _compare(matrices, out):
    turn_between(matrices, 0, matrices, 9, out, 0)
    sine_between(matrices, 0, matrices, 9, out, 3)


def compare(target, actual):
    """Rotation vector and sine as compiled code has them."""
    out = np.zeros(6)
    _compare(np.append(target, actual), out)
    return out[:3], out[3:]


@pytest.fixture(params=["python", "compiled"])
def rotation_vector(request):
    return in_python if request.param == "python" else lambda *pair: compare(*pair)[0]


@pytest.mark.parametrize("away", [0.0, 1e-9, 1e-7, 1e-5, 1e-3, 1e-2, 1e-1])
def test_near_half_a_turn_the_axis_stays_right(rotation_vector, away):
    for unit in UNITS:
        vector = rotation_vector(turn(unit, np.pi - away), np.eye(3))
        # Rounding of a matrix near pi moves the axis by its square root at most.
        either = (np.pi - away) * unit, -np.pi * unit
        assert min(np.abs(vector - one).max() for one in either) < 1e-6


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-8, 1e-6, 1e-4, 1e-2, 1.0, 2.0, 3.0])
def test_small_and_large_turns_and_sines_are_exact(rotation_vector, angle):
    at = turn(UNITS[11], 0.7)
    for unit in UNITS:
        vector = rotation_vector(turn(unit, angle), np.eye(3))
        assert np.abs(vector - angle * unit).max() < 1e-12
        sine = compare(turn(unit, angle) @ at, at)[1]
        np.testing.assert_allclose(sine, np.sin(angle) * unit, atol=1e-12)


def test_random_pairs_equal_scipy(rotation_vector):
    rng = np.random.default_rng(0)
    for target, actual in zip(
        Rotation.random(2000, rng=rng), Rotation.random(2000, rng=rng), strict=True
    ):
        expected = (target * actual.inv()).as_rotvec()
        vector = rotation_vector(target.as_matrix(), actual.as_matrix())
        if np.linalg.norm(expected) < np.pi - 1e-4:
            assert np.abs(vector - expected).max() < 1e-9
        assert np.linalg.norm(vector) <= np.pi + 1e-9


def test_a_matrix_that_lost_a_little_of_its_orthogonality_gives_finite_numbers(rotation_vector):
    rng = np.random.default_rng(2)
    for unit in UNITS:
        for _ in range(50):
            R = turn(unit, np.pi) + 1e-7 * rng.normal(size=(3, 3))
            vector = rotation_vector(R, np.eye(3))
            assert np.isfinite(vector).all()
            assert np.linalg.norm(vector) == pytest.approx(np.pi, abs=1e-2)
