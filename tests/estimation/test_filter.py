"""The filter against its true nonlinear error, Monte Carlo runs and what cannot be observed."""

import numpy as np
import pytest
from paths import DT, Path, drive, exponential, gamma, hat
from scipy.linalg import expm
from scipy.stats import chi2

from poise.estimation import InvariantFilter
from poise.estimation._config import ImuNoise, InitialDeviation
from poise.estimation._group import right_error

G = np.array([0.0, 0.0, -9.81])
NOISELESS = ImuNoise(gyro=0.0, accelerometer=0.0, gyro_bias=0.0, accelerometer_bias=0.0)
SURE = InitialDeviation(tilt=0.0, velocity=0.0, gyro_bias=0.0, accelerometer_bias=0.0)


def element(f):
    return f.rotation.copy(), np.vstack([f.velocity, f.position, f.points])


def place(f, R, x):
    f.rotation[:], f.velocity[:], f.position[:] = R, x[0], x[1]
    f.points[:] = x[2:]


def at_a_random_state(seed, noise=NOISELESS, deviation=SURE):
    """With both contact points held."""
    rng = np.random.default_rng(seed)
    f = InvariantFilter(2, noise)
    f.start(gamma(0, rng.standard_normal(3)), np.zeros(3), deviation=deviation)
    place(f, f.rotation.copy(), rng.standard_normal((4, 3)))
    f.held[:] = 1
    f.gyro_bias[:], f.accelerometer_bias[:] = 0.1 * rng.standard_normal((2, 3))
    return f, rng


# --- propagation --------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(3))
def test_the_mean_is_exact_for_constant_readings(seed):
    f, rng = at_a_random_state(seed)
    w, a = 3.0 * rng.standard_normal((2, 3))
    R, x = element(f)
    rate, force, t = w - f.gyro_bias, a - f.accelerometer_bias, 0.3
    f.propagate(w, a, t)
    # The motion as one linear system of R's columns, velocity and position.
    A = np.zeros((3 + 2, 3 + 2))
    A[:3, :3], A[:3, 3], A[3, 4] = hat(rate), force, 1.0
    E = expm(A * t)
    np.testing.assert_allclose(f.rotation, R @ E[:3, :3], atol=1e-13)
    np.testing.assert_allclose(f.velocity, x[0] + R @ E[:3, 3] + G * t, atol=1e-13)
    position = x[1] + x[0] * t + R @ E[:3, 4] + 0.5 * G * t * t
    np.testing.assert_allclose(f.position, position, atol=1e-13)
    np.testing.assert_array_equal(f.points, x[2:])


@pytest.mark.parametrize("seed", range(3))
def test_without_biases_the_error_is_linear_however_large_it_is(seed):
    """The log-linear property: the group's error moves by the same matrix at any size."""
    f, rng = at_a_random_state(seed)
    g, _ = at_a_random_state(seed)
    g.gyro_bias[:], g.accelerometer_bias[:] = f.gyro_bias, f.accelerometer_bias
    xi = 0.7 * rng.standard_normal(15)
    R, x = element(f)
    S, y = exponential(xi)
    place(g, S @ R, x @ S.T + y)
    readings = rng.standard_normal((20, 2, 3)) * 3.0
    for w, a in readings:
        f.propagate(w, a, DT)
        g.propagate(w, a, DT)
    A = np.zeros((15, 15))
    A[3:6, :3], A[6:9, 3:6] = hat(G), np.eye(3)
    expected = expm(A * DT * len(readings)) @ xi
    np.testing.assert_allclose(right_error(element(g), element(f)), expected, atol=1e-11)


@pytest.mark.parametrize("seed", range(3))
def test_the_covariance_moves_as_finite_differences_of_the_true_error_do(seed):
    """Column by column, biases among them."""
    step, dt = 1e-6, 1e-4
    w, a = np.random.default_rng(seed + 50).standard_normal((2, 3)) * 3.0
    truth, _ = at_a_random_state(seed)
    R, x = element(truth)
    biases = np.vstack([truth.gyro_bias, truth.accelerometer_bias])
    truth.propagate(w, a, dt)
    after = element(truth)
    transition = np.zeros((21, 21))
    for k in range(21):
        f, _ = at_a_random_state(seed)
        xi = np.zeros(21)
        xi[k] = step
        S, y = exponential(xi[:15])
        place(f, S @ R, x @ S.T + y)
        f.gyro_bias[:], f.accelerometer_bias[:] = biases + xi[15:].reshape(2, 3)
        f.propagate(w, a, dt)
        transition[:15, k] = right_error(element(f), after) / step
        transition[15:, k] = xi[15:] / step
    f, rng = at_a_random_state(seed)
    root = rng.standard_normal((21, 21))
    f.covariance[:] = root @ root.T
    f.propagate(w, a, dt)
    expected = transition @ root @ root.T @ transition.T
    np.testing.assert_allclose(f.covariance, expected, atol=2e-5)
    # And not by the size of the step alone.
    assert np.abs(expected - root @ root.T).max() > 1e-3


# --- contacts -----------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(3))
def test_a_contact_point_comes_with_the_covariance_of_the_joint_error(seed):
    """xi_d = xi_p + R noise: sampled, and against the block that `hold` makes."""
    f, rng = at_a_random_state(seed)
    f.release(1)
    root = 0.01 * rng.standard_normal((21, 21))
    root[12:15] = 0.0
    f.covariance[:] = root @ root.T
    before = f.covariance.copy()
    offset, wide = rng.standard_normal(3), 0.02 * rng.standard_normal((3, 3))
    f.hold(1, offset, wide @ wide.T)
    np.testing.assert_allclose(f.points[1], f.position + f.rotation @ offset, atol=1e-15)
    J = np.eye(21)
    J[12:15] = 0.0
    J[12:15, 6:9] = np.eye(3)
    expected = J @ before @ J.T
    expected[12:15, 12:15] += f.rotation @ wide @ wide.T @ f.rotation.T
    np.testing.assert_allclose(f.covariance, expected, atol=1e-15)


def test_a_contact_point_that_leaves_takes_nothing_of_the_others_along():
    f, rng = at_a_random_state(3)
    root = rng.standard_normal((21, 21))
    f.covariance[:] = root @ root.T
    before = f.covariance.copy()
    f.release(0)
    kept = [i for i in range(21) if not 9 <= i < 12]
    np.testing.assert_array_equal(f.covariance[np.ix_(kept, kept)], before[np.ix_(kept, kept)])
    assert not f.covariance[9:12].any()
    assert not f.covariance[:, 9:12].any()
    assert not f.held[0]
    f.propagate(np.ones(3), np.ones(3), DT)
    assert not f.covariance[9:12].any()


@pytest.mark.parametrize("seed", range(3))
def test_a_correction_is_that_of_a_kalman_filter_in_the_textbook(seed):
    f, rng = at_a_random_state(seed)
    root = 0.05 * rng.standard_normal((21, 21))
    P = root @ root.T
    f.covariance[:] = P
    R, x = element(f)
    seen = R.T @ (x[2] - x[1]) + 0.01 * rng.standard_normal(3)
    spread = np.diag([1e-4, 2e-4, 3e-4])
    H = np.zeros((3, 21))
    H[:, 6:9], H[:, 9:12] = -np.eye(3), np.eye(3)
    S = H @ P @ H.T + R @ spread @ R.T
    K = P @ H.T @ np.linalg.inv(S)
    r = R @ seen + x[1] - x[2]
    distance = f.innovate(0, seen, spread)
    assert distance == pytest.approx(r @ np.linalg.solve(S, r))
    biases = np.vstack([f.gyro_bias, f.accelerometer_bias])
    f.correct()
    np.testing.assert_allclose(f.covariance, (np.eye(21) - K @ H) @ P, atol=1e-12)
    Q, y = exponential((K @ r)[:15])
    np.testing.assert_allclose(f.rotation, Q @ R, atol=1e-12)
    np.testing.assert_allclose(element(f)[1], x @ Q.T + y, atol=1e-12)
    corrected = biases + (K @ r)[15:].reshape(2, 3)
    np.testing.assert_allclose([f.gyro_bias, f.accelerometer_bias], corrected, atol=1e-12)


def test_what_is_observed_does_not_depend_on_the_state():
    """The invariant observation: innovations of two states with one error are the same."""
    f, rng = at_a_random_state(1)
    xi, offset, distances = 0.01 * rng.standard_normal(15), rng.standard_normal(3), []
    for R, p in ((np.eye(3), np.zeros(3)), (gamma(0, np.ones(3)), 5.0 * np.ones(3))):
        x = np.zeros((4, 3))
        x[1], x[2] = p, p + R @ offset
        S, y = exponential(xi)
        place(f, S @ R, x @ S.T + y)
        f.covariance[:] = np.eye(21) * 1e-4
        distances.append(f.innovate(0, offset, 1e-6 * np.eye(3)))
    assert distances[0] == pytest.approx(distances[1], rel=1e-9)


# --- runs ---------------------------------------------------------------------------------------


def test_the_error_is_as_large_as_the_covariance_says():
    """NEES over thirty synthetic walks: the mean over runs lies within its chi-squared bounds."""
    runs, dofs = 30, 0
    values = []
    for seed in range(runs):
        path = Path(seed)
        f = path.filter()
        drive(f, path, 260)
        error = path.error(f)
        # Absolute position and yaw are known at the start, so they count as well.
        values.append(error @ np.linalg.solve(path.covariance(f), error))
        dofs = len(error)
    low, high = chi2.ppf([0.001, 0.999], runs * dofs) / runs
    assert low < np.mean(values) < high


def test_yaw_and_position_cannot_be_observed():
    """Their variance never falls; that of tilt and velocity does."""
    wide = InitialDeviation(tilt=0.05, yaw=0.1, velocity=0.3, position=0.2)
    path = Path(0)
    f = path.filter(wide)
    before = f.covariance[:9, :9].copy()
    drive(f, path, 800)
    after = f.covariance
    assert after[2, 2] >= before[2, 2] * (1.0 - 1e-9)
    # Position as it is seen from the robot: the lever of yaw about the origin taken out.
    lever = np.hstack([hat(f.position), np.zeros((3, 3)), -np.eye(3)])
    here = lever @ after[:9, :9] @ lever.T
    assert np.linalg.eigvalsh(here)[0] >= 0.2**2 * (1.0 - 1e-9)
    assert after[0, 0] < 0.5 * before[0, 0]
    assert after[3, 3] < 0.05 * before[3, 3]


@pytest.mark.parametrize("tilt", [0.2, 0.8])
def test_it_converges_from_a_bad_start(tilt):
    path = Path(1)
    f = path.filter(InitialDeviation(tilt=tilt, velocity=1.0, gyro_bias=0.01))
    S, y = exponential(np.concatenate([[tilt, -0.5 * tilt, 0.0], 0.5 * np.ones(3), np.zeros(9)]))
    R, x = element(f)
    place(f, S @ R, x @ S.T + y)
    drive(f, path, 1500)
    error = path.error(f)
    assert np.abs(error[:2]).max() < 0.01
    assert np.abs(error[3:6]).max() < 0.03


def test_numbers_that_are_not_finite_make_it_unsound_and_nothing_is_raised():
    f, _ = at_a_random_state(0)
    assert f.sound
    f.propagate(np.full(3, np.nan), np.zeros(3), DT)
    assert not f.sound
    f.start(np.eye(3), np.zeros(3))
    assert f.sound
