import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from poise._compiled import compiled
from poise.dynamics import rotation_vector as in_python, sine_between, turn_between

AXES = [
    (1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1),
    (1, 1, 0), (1, 0, 1), (0, 1, 1), (1, -1, 0), (1, 1, 1), (-1, 2, 3), (1e-4, 1, 0),
]  # fmt: skip


def turn(axis, angle):
    unit = np.asarray(axis, dtype=float)
    return Rotation.from_rotvec(angle * unit / np.linalg.norm(unit)).as_matrix()


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


def test_equal_orientations_have_no_rotation_between_them(rotation_vector):
    for seed in range(20):
        R = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
        assert np.abs(rotation_vector(R, R)).max() < 1e-15


@pytest.mark.parametrize("axis", AXES)
def test_half_a_turn_keeps_its_axis_and_its_length(rotation_vector, axis):
    vector = rotation_vector(turn(axis, np.pi), np.eye(3))
    assert np.linalg.norm(vector) == pytest.approx(np.pi, abs=1e-7)
    unit = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    assert abs(vector @ unit) == pytest.approx(np.pi, abs=1e-7)


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("away", [1e-1, 1e-2, 1e-3, 1e-5, 1e-7, 1e-9])
def test_near_half_a_turn_the_axis_stays_right(rotation_vector, axis, away):
    unit = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    vector = rotation_vector(turn(axis, np.pi - away), np.eye(3))
    # Rounding of a matrix near pi moves the axis by its square root at most.
    short = min(np.abs(vector - (np.pi - away) * unit).max(), np.abs(vector + np.pi * unit).max())
    assert short < 1e-6


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-8, 1e-6, 1e-4, 1e-2, 1.0, 2.0, 3.0])
def test_small_and_large_turns_are_exact(rotation_vector, axis, angle):
    unit = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    vector = rotation_vector(turn(axis, angle), np.eye(3))
    assert np.abs(vector - angle * unit).max() < 1e-12


@pytest.mark.parametrize("axis", AXES)
def test_the_sine_error_is_the_axis_times_the_sine_of_the_angle(axis):
    unit = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    at = turn((2, -1, 5), 0.7)
    for angle in (0.0, 1e-3, 1.0, 0.5 * np.pi, 3.0, np.pi):
        np.testing.assert_allclose(
            compare(turn(axis, angle) @ at, at)[1], np.sin(angle) * unit, atol=1e-12
        )


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


def test_the_vector_turns_the_actual_onto_the_target_along_the_worlds_axes(rotation_vector):
    rng = np.random.default_rng(1)
    target, actual = (Rotation.random(rng=rng).as_matrix() for _ in range(2))
    turned = Rotation.from_rotvec(rotation_vector(target, actual)).as_matrix() @ actual
    assert np.abs(turned - target).max() < 1e-12


def test_a_matrix_that_lost_a_little_of_its_orthogonality_gives_finite_numbers(rotation_vector):
    rng = np.random.default_rng(2)
    for axis in AXES:
        for _ in range(50):
            R = turn(axis, np.pi) + 1e-7 * rng.normal(size=(3, 3))
            vector = rotation_vector(R, np.eye(3))
            assert np.isfinite(vector).all()
            assert np.linalg.norm(vector) == pytest.approx(np.pi, abs=1e-2)
