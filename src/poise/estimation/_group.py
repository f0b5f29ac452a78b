"""The group SE_m(3): a rotation and m vectors that turn with it, and what its filter needs of it.

An element is written as the rotation `R` (3 x 3) and its vectors as rows of one array (m x 3):
velocity, position, contact points. In matrix form

    X = [ R  x_1 ... x_m ]        X Y = (R S, x_i + R y_i)        X^-1 = (R^T, -R^T x_i)
        [ 0       I      ]

A tangent vector is [phi; rho_1; ...; rho_m], as Hartley, Ghaffari, Eustice and Grizzle (2020,
"Contact-aided invariant extended Kalman filtering for robot state estimation") order it.

`fill_gamma`, `turn`, `turn_back`, `multiply`: compiled, for loops. `gamma`, `logarithm`: with
arrays of their own.
"""

import math

import numpy as np
from jaxtyping import Float64

from poise._compiled import compiled, part

Rotation = Float64[np.ndarray, "3 3"]
Vectors = Float64[np.ndarray, "m 3"]

_SERIES_BELOW = 1.0
"""Angles below this [rad] take the power series: the closed forms lose 1 / angle^4 of their digits
there, and `_TERMS` terms leave nothing out."""

_TERMS = 10


@part
def _coefficient(order: int, angle: float) -> float:
    """sum_j (-1)^j angle^(2 j) / (2 j + order)!, for an order of 1 to 4."""
    square = angle * angle
    if angle < _SERIES_BELOW:
        term = 1.0
        for k in range(2, order + 1):
            term /= k
        total = term
        for j in range(1, _TERMS):
            term *= -square / ((2 * j + order - 1) * (2 * j + order))
            total += term
        return total
    if order == 1:
        return math.sin(angle) / angle
    if order == 2:
        return (1.0 - math.cos(angle)) / square
    if order == 3:
        return (angle - math.sin(angle)) / (square * angle)
    return (0.5 * square + math.cos(angle) - 1.0) / (square * square)


@part
def fill_gamma(
    order: int, phi: Float64[np.ndarray, "3"], scale: float, out: Float64[np.ndarray, "3 3"]
) -> None:
    """Gamma_k(phi) = sum_n hat(phi)^n / (n + k)!: the exponential, and its integrals.

    Gamma_0 is the rotation of phi, Gamma_1 its left Jacobian, and Gamma_2 what a constant specific
    force becomes in position while the body turns (Hartley et al. 2020, eq. (60)).

    `scale` is a factor on phi, such as a time; the order k is 0 to 2.
    """
    x, y, z = scale * phi[0], scale * phi[1], scale * phi[2]
    square = x * x + y * y + z * z
    angle = math.sqrt(square)
    a, b = _coefficient(order + 1, angle), _coefficient(order + 2, angle)
    c = (0.5 if order == 2 else 1.0) - b * square
    out[0, 0], out[0, 1], out[0, 2] = c + b * x * x, b * x * y - a * z, b * x * z + a * y
    out[1, 0], out[1, 1], out[1, 2] = b * x * y + a * z, c + b * y * y, b * y * z - a * x
    out[2, 0], out[2, 1], out[2, 2] = b * x * z - a * y, b * y * z + a * x, c + b * z * z


@part
def turn(R: Float64[np.ndarray, "3 3"], x: float, y: float, z: float) -> tuple[float, float, float]:
    """R times a vector."""
    return (
        R[0, 0] * x + R[0, 1] * y + R[0, 2] * z,
        R[1, 0] * x + R[1, 1] * y + R[1, 2] * z,
        R[2, 0] * x + R[2, 1] * y + R[2, 2] * z,
    )


@part
def turn_back(
    R: Float64[np.ndarray, "3 3"], x: float, y: float, z: float
) -> tuple[float, float, float]:
    """R^T times a vector."""
    return (
        R[0, 0] * x + R[1, 0] * y + R[2, 0] * z,
        R[0, 1] * x + R[1, 1] * y + R[2, 1] * z,
        R[0, 2] * x + R[1, 2] * y + R[2, 2] * z,
    )


@part
def multiply(
    A: Float64[np.ndarray, "3 3"], B: Float64[np.ndarray, "3 3"], out: Float64[np.ndarray, "3 3"]
) -> None:
    """Fill in the product A B."""
    for k in range(3):
        out[0, k], out[1, k], out[2, k] = turn(A, B[0, k], B[1, k], B[2, k])


def hat(x: Float64[np.ndarray, "3"]) -> Float64[np.ndarray, "3 3"]:
    """The skew-symmetric matrix of a cross product with x from the left."""
    a, b, c = x.tolist()
    return np.array([[0.0, -c, b], [c, 0.0, -a], [-b, a, 0.0]])


@compiled
def _fill_gamma(order: int, phi: Float64[np.ndarray, "3"], out: Float64[np.ndarray, "3 3"]) -> None:
    fill_gamma(order, phi, 1.0, out)


def gamma(order: int, phi: Float64[np.ndarray, "3"]) -> Float64[np.ndarray, "3 3"]:
    """As `fill_gamma`, in an array of its own."""
    out = np.empty((3, 3))
    _fill_gamma(order, phi, out)
    return out


def logarithm(R: Rotation, vectors: Vectors) -> Float64[np.ndarray, " n"]:
    """The tangent vector of an element, of angles in [0, pi]."""
    phi = _rotation_logarithm(R)
    rho = np.linalg.solve(gamma(1, phi), vectors.T).T
    return np.concatenate([phi, rho.ravel()])


def right_error(
    estimate: tuple[Rotation, Vectors], truth: tuple[Rotation, Vectors]
) -> Float64[np.ndarray, " n"]:
    """log(estimate truth^-1), the error that a right-invariant filter speaks of."""
    R = estimate[0] @ truth[0].T
    return logarithm(R, estimate[1] - truth[1] @ R.T)


def _rotation_logarithm(R: Rotation) -> Float64[np.ndarray, "3"]:
    """By the unit quaternion's largest component, so that no angle loses digits."""
    trace = float(np.trace(R))
    K = np.array(
        [
            [trace, R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]],
            [0.0, 2.0 * R[0, 0] - trace, R[0, 1] + R[1, 0], R[0, 2] + R[2, 0]],
            [0.0, 0.0, 2.0 * R[1, 1] - trace, R[1, 2] + R[2, 1]],
            [0.0, 0.0, 0.0, 2.0 * R[2, 2] - trace],
        ]
    )
    K = K + np.triu(K, 1).T + np.eye(4)
    # Each column is the quaternion times four times one of its components.
    quaternion = K[:, int(np.argmax(np.diag(K)))]
    quaternion = quaternion / np.linalg.norm(quaternion)
    w, axis = float(quaternion[0]), quaternion[1:]
    if w < 0.0:
        w, axis = -w, -axis
    sine = float(np.linalg.norm(axis))
    return axis * (2.0 if sine == 0.0 else 2.0 * math.atan2(sine, w) / sine)
