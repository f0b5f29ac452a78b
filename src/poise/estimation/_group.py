"""The group SE_m(3): a rotation and m vectors that turn with it, as its filter needs them.

An element is the rotation `R` (3 x 3) and its vectors as rows of one array (m x 3): velocity,
position, contact points. In matrix form

    X = [ R  x_1 ... x_m ]        X Y = (R S, x_i + R y_i)        X^-1 = (R^T, -R^T x_i)
        [ 0       I      ]

A tangent vector is [phi; rho_1; ...; rho_m], as Hartley, Ghaffari, Eustice and Grizzle (2020,
"Contact-aided invariant extended Kalman filtering for robot state estimation") order it.
"""

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._compiled import part

Rotation = Float64[np.ndarray, "3 3"]
Vectors = Float64[np.ndarray, "m 3"]


@part
def _coefficient(order: int, square: float) -> float:
    """sum_j (-square)^j / (2 j + order)!, to rounding for angles up to 5 rad."""
    term, total = 1.0, 0.0
    for k in range(2, order + 1):
        term /= k
    for k in range(order, order + 36, 2):
        total += term
        term *= -square / ((k + 1) * (k + 2))
    return total


@part
def fill_gamma(
    order: int, phi: Float64[np.ndarray, "3"], scale: float, out: Float64[np.ndarray, "3 3"]
) -> None:
    """Fill in Gamma_k(phi scale) = sum_n hat(phi scale)^n / (n + k)! for an order k of 0 to 2."""
    # Gamma_0 is the rotation of phi, Gamma_1 its left Jacobian, and Gamma_2 what a constant
    # specific force becomes in position while the body turns (Hartley et al. 2020, eq. (60)).
    x, y, z = scale * phi[0], scale * phi[1], scale * phi[2]
    square = x * x + y * y + z * z
    a, b = _coefficient(order + 1, square), _coefficient(order + 2, square)
    c = (0.5 if order == 2 else 1.0) - b * square
    out[0, 0], out[0, 1], out[0, 2] = c + b * x * x, b * x * y - a * z, b * x * z + a * y
    out[1, 0], out[1, 1], out[1, 2] = b * x * y + a * z, c + b * y * y, b * y * z - a * x
    out[2, 0], out[2, 1], out[2, 2] = b * x * z - a * y, b * y * z + a * x, c + b * z * z


@part
def turn(R: Rotation, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return R times a vector."""
    return (
        R[0, 0] * x + R[0, 1] * y + R[0, 2] * z,
        R[1, 0] * x + R[1, 1] * y + R[1, 2] * z,
        R[2, 0] * x + R[2, 1] * y + R[2, 2] * z,
    )


@part
def turn_back(R: Rotation, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return R^T times a vector."""
    return (
        R[0, 0] * x + R[1, 0] * y + R[2, 0] * z,
        R[0, 1] * x + R[1, 1] * y + R[2, 1] * z,
        R[0, 2] * x + R[1, 2] * y + R[2, 2] * z,
    )


@part
def multiply(A: Rotation, B: Rotation, out: Rotation) -> None:
    """Fill in the product A B."""
    for k in range(3):
        out[0, k], out[1, k], out[2, k] = turn(A, B[0, k], B[1, k], B[2, k])


def right_error(
    estimate: tuple[Rotation, Vectors], truth: tuple[Rotation, Vectors]
) -> Float64[np.ndarray, " n"]:
    """Return log(estimate truth^-1), the right-invariant error, of an angle in [0, pi]."""
    R = estimate[0] @ truth[0].T
    phi = pin.log3(R)
    # The left Jacobian is the right one transposed.
    rho = np.linalg.solve(pin.Jexp3(phi).T, (estimate[1] - truth[1] @ R.T).T).T
    return np.concatenate([phi, rho.ravel()])
