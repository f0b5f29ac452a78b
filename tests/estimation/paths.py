"""Synthetic walks: a body that moves smoothly between points at rest, measured with noise."""

import numpy as np
import pinocchio as pin

from poise._compiled import compiled
from poise.estimation import InvariantFilter
from poise.estimation._config import ImuNoise, InitialDeviation
from poise.estimation._group import fill_gamma, right_error

DT = 0.002
NOISE = ImuNoise(gyro=1e-3, accelerometer=1e-2, gyro_bias=1e-4, accelerometer_bias=1e-3)
START = InitialDeviation(tilt=0.02, velocity=0.05, gyro_bias=0.01, accelerometer_bias=0.05)
POINT = 1e-3
"""Deviation of what the kinematics see [m]."""
WALK = 0.01
"""Density of the walk of the points [m/s/sqrt(Hz)]."""
STANCE = 0.3
"""A foot stands this long [s]."""


class Path:
    """The truth of a walk of a body over two feet, integrated as the filter integrates.

    The start of the filter is drawn about the truth with `START`.
    """

    def __init__(self, seed, noise=NOISE, walk=WALK):
        self.noise, self.walk = noise, walk
        self.rng = rng = np.random.default_rng(seed)
        self.R = gamma(0, np.array([0.05, -0.03, 0.4]))
        self.v, self.p = np.zeros(3), np.array([0.3, -0.2, 0.8])
        self.points = self.p + np.array([[0.0, 0.1, -0.8], [0.0, -0.1, -0.8]])
        self.gyro_bias = START.gyro_bias * rng.standard_normal(3)
        self.force_bias = START.accelerometer_bias * rng.standard_normal(3)
        self.phases = rng.uniform(0.0, 2.0 * np.pi, 6)
        self.time, self.standing = 0.0, [True, True]

    def filter(self, deviation=START):
        f = InvariantFilter(2, self.noise)
        rng = self.rng
        spread = [deviation.tilt, deviation.tilt, deviation.yaw, *[deviation.velocity] * 3]
        xi = np.concatenate([spread * rng.standard_normal(6), np.zeros(3)])
        if deviation is not START:
            xi[:] = 0.0
        # About the body, as `start` takes deviations.
        S, _ = exponential(xi)
        f.start(S @ self.R, self.p, deviation=deviation)
        f.velocity[:] = self.v + xi[3:6]
        for foot in range(2):
            f.hold(foot, self.seen(foot), POINT**2 * np.eye(3))
        return f

    def step(self):
        """One period: what the unit measures in it."""
        rng, root = self.rng, np.sqrt(DT)
        t, a = self.time, self.phases
        rate = 0.4 * np.sin(2.0 * np.pi * np.array([1.0, 1.3, 0.7]) * t + a[:3])
        pull = np.array([0.8, 1.0, 1.5]) * np.sin(
            2.0 * np.pi * np.array([1.1, 0.9, 2.0]) * t + a[3:]
        )
        force = self.R.T @ (pull + [0.0, 0.0, 9.81])
        delta, g = DT * rate, np.array([0.0, 0.0, -9.81])
        self.p = self.p + DT * self.v + DT**2 * (self.R @ gamma(2, delta) @ force + 0.5 * g)
        self.v = self.v + DT * (self.R @ gamma(1, delta) @ force + g)
        self.R = self.R @ gamma(0, delta)
        self.points = self.points + self.walk * root * rng.standard_normal((2, 3))
        self.time += DT
        measured = (
            rate + self.gyro_bias + self.noise.gyro / root * rng.standard_normal(3),
            force + self.force_bias + self.noise.accelerometer / root * rng.standard_normal(3),
        )
        self.gyro_bias = self.gyro_bias + self.noise.gyro_bias * root * rng.standard_normal(3)
        self.force_bias = (
            self.force_bias + self.noise.accelerometer_bias * root * rng.standard_normal(3)
        )
        return measured

    def seen(self, foot):
        """A point as the kinematics see it."""
        return self.R.T @ (self.points[foot] - self.p) + POINT * self.rng.standard_normal(3)

    def error(self, f):
        """Orientation, velocity, position, held points, biases."""
        held = [i for i in range(2) if f.held[i]]
        estimate = np.vstack([f.velocity, f.position, f.points[held]])
        truth = np.vstack([self.v, self.p, self.points[held]])
        xi = right_error((f.rotation.copy(), estimate), (self.R, truth))
        biases = [f.gyro_bias - self.gyro_bias, f.accelerometer_bias - self.force_bias]
        return np.concatenate([xi, *biases])

    def covariance(self, f):
        held = [i for i in range(2) if f.held[i]]
        rows = [*range(9), *(9 + 3 * i + k for i in held for k in range(3)), *range(15, 21)]
        return f.covariance[np.ix_(rows, rows)]


def drive(f, path, ticks):
    """The filter along a path whose feet are lifted in turns and put down elsewhere."""
    for _ in range(ticks):
        lifted = int(path.time / STANCE) % 3
        for foot in range(2):
            stands = lifted != foot + 1
            if stands and not path.standing[foot]:
                path.points[foot] = path.p + path.rng.uniform(-0.2, 0.2, 3) - [0.0, 0.0, 0.8]
                f.hold(foot, path.seen(foot), POINT**2 * np.eye(3))
            elif not stands and path.standing[foot]:
                f.release(foot)
            path.standing[foot] = stands
        rate, force = path.step()
        f.propagate(rate, force, DT, path.walk)
        for foot in range(2):
            if path.standing[foot]:
                f.innovate(foot, path.seen(foot), POINT**2 * np.eye(3))
                f.correct()


hat = pin.skew


@compiled
def _fill_gamma(order, phi, out):
    fill_gamma(order, phi, 1.0, out)


def gamma(order, phi):
    """Gamma_k(phi), as the filter has it."""
    out = np.empty((3, 3))
    _fill_gamma(order, phi, out)
    return out


def exponential(xi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The element of a tangent vector: (Gamma_0(phi), Gamma_1(phi) rho_i)."""
    rows = xi.reshape(-1, 3)
    return gamma(0, rows[0]), rows[1:] @ gamma(1, rows[0]).T
