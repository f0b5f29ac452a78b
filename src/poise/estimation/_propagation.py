"""Time passes in an invariant filter: mean, covariance, and the noise that comes in."""

import numpy as np
from jaxtyping import Float64

from poise._compiled import part
from poise.estimation._group import fill_gamma, multiply, turn
from poise.estimation._memory import CONTACTS, POSITION, VELOCITY, FilterMemory, set_rotation
from poise.robots import GRAVITY


@part
def _add_product(
    P: Float64[np.ndarray, "n n"],
    to: int,
    A: Float64[np.ndarray, "3 3"],
    scale: float,
    source: int,
) -> None:
    """Rows of a block of P += scale A times rows of another; then the same for columns.

    A block row may not be a source after it was changed, see `_spread_covariance`.
    """
    n = len(P)
    for k in range(n):
        a, b, c = turn(A, P[source, k], P[source + 1, k], P[source + 2, k])
        P[to, k] += scale * a
        P[to + 1, k] += scale * b
        P[to + 2, k] += scale * c
    for k in range(n):
        a, b, c = turn(A, P[k, source], P[k, source + 1], P[k, source + 2])
        P[k, to] += scale * a
        P[k, to + 1] += scale * b
        P[k, to + 2] += scale * c


@part
def _bias_column(
    R: Float64[np.ndarray, "3 3"], x: float, y: float, z: float, out: Float64[np.ndarray, "3 3"]
) -> None:
    """Fill in hat([x, y, z]) R: what a turn about the unit does to a vector."""
    for k in range(3):
        out[0, k] = y * R[2, k] - z * R[1, k]
        out[1, k] = z * R[0, k] - x * R[2, k]
        out[2, k] = x * R[1, k] - y * R[0, k]


@part
def _spread_covariance(m: FilterMemory, dt: float) -> None:
    """P <- Phi (P + G Q G^T dt) Phi^T with Phi = exp(A dt), A at the state before the step.

    A has no fourth power:  orientation' = -R zeta_g
                            velocity'    = hat(g) orientation - hat(v) R zeta_g - R zeta_a
                            position'    = velocity - hat(p) R zeta_g
                            contact'     = -hat(d) R zeta_g
    Phi is applied as a product of elementary steps P <- (I + E) P (I + E)^T, position first, so
    that each reads what none before it has written.
    """
    P, R, T = m.P, m.R, m.turned
    half, third = 0.5 * dt * dt, dt * dt * dt / 6.0
    gyro, accelerometer = len(P) - 6, len(P) - 3
    gravity, hat_g, one, cross = T[0], T[1], T[2], T[3]
    for i in range(3):
        for k in range(3):
            one[i, k] = 1.0 if i == k else 0.0
            hat_g[i, k] = 0.0
    hat_g[0, 1], hat_g[1, 0] = GRAVITY, -GRAVITY
    # hat(g) R, with g = (0, 0, -GRAVITY).
    _bias_column(R, 0.0, 0.0, -GRAVITY, gravity)
    v = m.x[VELOCITY]
    _bias_column(R, v[0], v[1], v[2], cross)
    _add_product(P, 6, one, dt, 3)
    _add_product(P, 6, hat_g, half, 0)
    _add_product(P, 6, cross, -half, gyro)
    _add_product(P, 6, gravity, -third, gyro)
    _add_product(P, 6, R, -half, accelerometer)
    _add_product(P, 3, hat_g, dt, 0)
    _add_product(P, 3, cross, -dt, gyro)
    _add_product(P, 3, gravity, -half, gyro)
    _add_product(P, 3, R, -dt, accelerometer)
    _add_product(P, 0, R, -dt, gyro)
    for i in range(POSITION, len(m.x)):
        if i == POSITION or m.active[i - CONTACTS]:
            x = m.x[i]
            _bias_column(R, x[0], x[1], x[2], cross)
            _add_product(P, 3 * i + 3, cross, -dt, gyro)


@part
def _add_noise(m: FilterMemory, dt: float) -> None:
    """P += G Q G^T dt: the unit's noise through Ad_X, the walks of contact points and biases."""
    P, R, G = m.P, m.R, m.G
    n, held = len(P), 3 + 3 * len(m.x)
    for i in range(3):
        for k in range(3):
            G[i, k] = R[i, k]
    for i in range(len(m.x)):
        if i < CONTACTS or m.active[i - CONTACTS]:
            x = m.x[i]
            _bias_column(R, x[0], x[1], x[2], G[3 * i + 3 : 3 * i + 6])
        else:
            for row in range(3 * i + 3, 3 * i + 6):
                for k in range(3):
                    G[row, k] = 0.0
    scale = dt * m.density[0] * m.density[0]
    for i in range(held):
        for k in range(held):
            P[i, k] += scale * (G[i, 0] * G[k, 0] + G[i, 1] * G[k, 1] + G[i, 2] * G[k, 2])
    for i in range(3):
        # R R^T is the identity.
        P[3 + i, 3 + i] += dt * m.density[1] * m.density[1]
        P[n - 6 + i, n - 6 + i] += dt * m.density[2] * m.density[2]
        P[n - 3 + i, n - 3 + i] += dt * m.density[3] * m.density[3]
    for c in range(len(m.active)):
        if m.active[c]:
            walk = dt * m.contact_density[c] * m.contact_density[c]
            for i in range(9 + 3 * c, 12 + 3 * c):
                P[i, i] += walk


@part
def _move(m: FilterMemory, dt: float) -> None:
    """The mean, exactly, for a specific force and an angular velocity that are constant in dt."""
    R, x, T = m.R, m.x, m.turned
    w, f = m.delta[:3], m.delta[3:6]
    for i in range(3):
        w[i] = m.imu[0, i] - m.bias[0, i]
        f[i] = m.imu[1, i] - m.bias[1, i]
    fill_gamma(2, w, dt, T[2])
    a, b, c = turn(T[2], f[0], f[1], f[2])
    a, b, c = turn(R, a, b, c)
    v, p = x[VELOCITY], x[POSITION]
    square = dt * dt
    p[0] += dt * v[0] + square * a
    p[1] += dt * v[1] + square * b
    p[2] += dt * v[2] + square * (c - 0.5 * GRAVITY)
    fill_gamma(1, w, dt, T[1])
    a, b, c = turn(T[1], f[0], f[1], f[2])
    a, b, c = turn(R, a, b, c)
    v[0] += dt * a
    v[1] += dt * b
    v[2] += dt * (c - GRAVITY)
    fill_gamma(0, w, dt, T[0])
    multiply(R, T[0], T[1])
    set_rotation(R, T[1])


@part
def propagate(m: FilterMemory, dt: float) -> None:
    """Advance mean and covariance by `dt` under what `imu` measured."""
    _add_noise(m, dt)
    _spread_covariance(m, dt)
    _move(m, dt)
