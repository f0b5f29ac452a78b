"""The filter against a batch smoother of another house, GTSAM, on the same measurements."""

import numpy as np
import pytest
from paths import DT, POINT, Path, gamma, hat

from poise.estimation import InvariantFilter
from poise.estimation._config import ImuNoise, InitialDeviation

gtsam = pytest.importorskip("gtsam")

NOISE = ImuNoise(gyro=1e-3, accelerometer=1e-2, gyro_bias=0.0, accelerometer_bias=0.0)
KNOWN = InitialDeviation(
    tilt=0.02, yaw=1e-3, velocity=0.05, position=1e-3, gyro_bias=0.01, accelerometer_bias=0.05
)
KEY_TICKS, KEYS = 10, 120
"""The points are seen every fiftieth of a second only: GTSAM makes a node of each look."""

STANCE = 30
"""Looks for which a foot stands."""


def measure(seed):
    """Readings, and what is seen of which foothold at each look."""
    path = Path(seed, NOISE, walk=0.0)
    start = path.R.copy(), path.p.copy()
    readings, looks, foothold = [], [], [0, 1]
    looks.append([(foot, foothold[foot], path.seen(foot)) for foot in range(2)])
    for key in range(1, KEYS):
        readings.append([path.step() for _ in range(KEY_TICKS)])
        if key % STANCE == 0:
            foot = key // STANCE % 2
            foothold[foot] = max(foothold) + 1
            path.points[foot] = path.p + path.rng.uniform(-0.2, 0.2, 3) - [0.0, 0.0, 0.8]
        looks.append([(foot, foothold[foot], path.seen(foot)) for foot in range(2)])
    return path, start, readings, looks


def filtered(start, readings, looks):
    f = InvariantFilter(2, NOISE)
    f.start(*start, deviation=KNOWN)
    spread, standing = POINT**2 * np.eye(3), {}
    for key, look in enumerate(looks):
        for rate, force in readings[key - 1] if key else ():
            f.propagate(rate, force, DT)
        for foot, foothold, seen in look:
            if standing.get(foot) == foothold:
                f.innovate(foot, seen, spread)
                f.correct()
            else:
                f.hold(foot, seen, spread)
                standing[foot] = foothold
    return f


def smoothed(start, readings, looks):
    """The last state of the batch: (R, v, p), and its covariance along the body's axes."""
    X, V, L = (gtsam.symbol_shorthand.X, gtsam.symbol_shorthand.V, gtsam.symbol_shorthand.L)
    B, sigmas = gtsam.symbol_shorthand.B(0), gtsam.noiseModel.Diagonal.Sigmas
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    R, p = start
    d = KNOWN
    # GTSAM turns about the body's axes.
    turn = R.T @ np.diag([d.tilt**2, d.tilt**2, d.yaw**2]) @ R
    prior = np.zeros((6, 6))
    prior[:3, :3], prior[3:, 3:] = turn, d.position**2 * np.eye(3)
    pose = gtsam.Pose3(gtsam.Rot3(R), p)
    graph.add(gtsam.PriorFactorPose3(X(0), pose, gtsam.noiseModel.Gaussian.Covariance(prior)))
    graph.add(gtsam.PriorFactorVector(V(0), np.zeros(3), sigmas(np.full(3, d.velocity))))
    bias = gtsam.imuBias.ConstantBias()
    spread = np.repeat([d.accelerometer_bias, d.gyro_bias], 3)
    graph.add(gtsam.PriorFactorConstantBias(B, bias, sigmas(spread)))
    values.insert(B, bias)
    params = gtsam.PreintegrationParams.MakeSharedU(9.81)
    params.setGyroscopeCovariance(NOISE.gyro**2 * np.eye(3))
    params.setAccelerometerCovariance(NOISE.accelerometer**2 * np.eye(3))
    params.setIntegrationCovariance(1e-16 * np.eye(3))
    state, known = gtsam.NavState(pose, np.zeros(3)), set()
    for key, look in enumerate(looks):
        if key:
            measured = gtsam.PreintegratedImuMeasurements(params, bias)
            for rate, force in readings[key - 1]:
                measured.integrateMeasurement(force, rate, DT)
            graph.add(gtsam.ImuFactor(X(key - 1), V(key - 1), X(key), V(key), B, measured))
            state = measured.predict(state, bias)
        values.insert(X(key), state.pose())
        values.insert(V(key), state.velocity())
        for _, foothold, seen in look:
            length = float(np.linalg.norm(seen))
            model = sigmas(np.array([POINT / length, POINT / length, POINT]))
            graph.add(
                gtsam.BearingRangeFactor3D(X(key), L(foothold), gtsam.Unit3(seen), length, model)
            )
            if foothold not in known:
                known.add(foothold)
                values.insert(L(foothold), state.pose().transformFrom(seen))
    found = gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()
    last = len(looks) - 1
    pose, marginals = found.atPose3(X(last)), gtsam.Marginals(graph, found)
    return (
        (pose.rotation().matrix(), found.atVector(V(last)), pose.translation()),
        marginals.marginalCovariance(X(last)),
        marginals.marginalCovariance(V(last)),
        found.atConstantBias(B),
    )


@pytest.mark.parametrize("seed", range(2))
def test_the_filter_ends_where_the_batch_does(seed):
    """A fraction of a standard deviation apart, and as sure of itself."""
    path, start, readings, looks = measure(seed)
    # The filter starts beside the truth, by as much as it says.
    off = path.rng.standard_normal(3) * [KNOWN.tilt, KNOWN.tilt, 0.0]
    start = gamma(0, off) @ start[0], start[1]
    f = filtered(start, readings, looks)
    (R, v, p), pose, velocity, bias = smoothed(start, readings, looks)
    error = f.error(R, v, p)
    deviation = np.sqrt(np.diag(f.covariance))
    assert np.abs(error / deviation[:9]).max() < 0.3
    gyro = np.abs(f.gyro_bias - bias.gyroscope()) / deviation[15:18]
    force = np.abs(f.accelerometer_bias - bias.accelerometer()) / deviation[18:21]
    assert max(gyro.max(), force.max()) < 0.3
    turn = R @ pose[:3, :3] @ R.T
    np.testing.assert_allclose(np.sqrt(np.diag(turn)), deviation[:3], rtol=0.05)
    # The velocity by itself: what the turn about the world's origin adds is taken out.
    map_to_own = np.hstack([-hat(v), np.eye(3)])
    own = map_to_own @ f.covariance[:6, :6] @ map_to_own.T
    np.testing.assert_allclose(np.sqrt(np.diag(own)), np.sqrt(np.diag(velocity)), rtol=0.05)
