"""Steps of an invariant filter: propagation, contact points, innovation and correction."""

import math

import numpy as np
from jaxtyping import Float64

from poise._compiled import factor_leading, part, solve_leading
from poise.estimation._group import fill_gamma, multiply, turn
from poise.estimation._memory import CONTACTS, POSITION, VELOCITY, FilterMemory
from poise.robots import GRAVITY


@part
def _add_product(
    P: Float64[np.ndarray, "n n"],
    to: int,
    A: Float64[np.ndarray, "3 3"],
    scale: float,
    source: int,
) -> None:
    """Add scale A times block row `source` to block row `to` of P; the same for columns."""
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
    """Fill in hat([x, y, z]) R, the motion of a vector with a turn about the unit."""
    for k in range(3):
        out[0, k] = y * R[2, k] - z * R[1, k]
        out[1, k] = z * R[0, k] - x * R[2, k]
        out[2, k] = x * R[1, k] - y * R[0, k]


@part
def _spread_covariance(m: FilterMemory, dt: float) -> None:
    """Set P <- Phi P Phi^T with Phi = exp(A dt), A at the state before the step."""
    # A has no fourth power:  orientation' = -R zeta_g
    #                         velocity'    = hat(g) orientation - hat(v) R zeta_g - R zeta_a
    #                         position'    = velocity - hat(p) R zeta_g
    #                         contact'     = -hat(d) R zeta_g
    # Phi is a product of elementary steps P <- (I + E) P (I + E)^T, position first, so that none
    # reads a block that one before it has changed.
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
    """Add G Q G^T dt to P: the unit's noise through Ad_X, walks of contact points and biases."""
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
    """Advance the mean, exactly for readings that are constant in dt."""
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
    _set_rotation(R, T[1])


@part
def propagate(m: FilterMemory, dt: float) -> None:
    """Advance mean and covariance by `dt` under the readings `imu`."""
    _add_noise(m, dt)
    _spread_covariance(m, dt)
    _move(m, dt)


@part
def _world_spread(m: FilterMemory, out: Float64[np.ndarray, "3 3"]) -> None:
    """Fill in the offset's covariance along the world's axes, R spread R^T."""
    T = m.turned[0]
    multiply(m.R, m.spread, T)
    for i in range(3):
        out[i, 0], out[i, 1], out[i, 2] = turn(m.R, T[i, 0], T[i, 1], T[i, 2])


@part
def hold(m: FilterMemory, contact: int) -> None:
    """Add a contact point to the state where the kinematics see it."""
    # d = p + R offset, and in the invariant error xi_d = xi_p + R (noise of the offset): the new
    # block of the covariance is that of the position and the noise.
    P, R, o = m.P, m.R, m.offset
    a, b, c = turn(R, o[0], o[1], o[2])
    d, p = m.x[CONTACTS + contact], m.x[POSITION]
    d[0], d[1], d[2] = p[0] + a, p[1] + b, p[2] + c
    at = 9 + 3 * contact
    for i in range(3):
        for k in range(len(P)):
            P[at + i, k] = P[6 + i, k]
    for i in range(3):
        for k in range(len(P)):
            P[k, at + i] = P[k, 6 + i]
    _world_spread(m, m.S[0])
    for i in range(3):
        for k in range(3):
            P[at + i, at + k] += m.S[0, i, k]
    m.active[contact] = 1


@part
def release(m: FilterMemory, contact: int) -> None:
    """Remove a contact point and its rows and columns of the covariance."""
    at = 9 + 3 * contact
    for i in range(at, at + 3):
        for k in range(len(m.P)):
            m.P[i, k] = m.P[k, i] = 0.0
        m.x[CONTACTS + contact, i - at] = 0.0
    m.active[contact] = 0


@part
def innovate(m: FilterMemory, contact: int) -> float:
    """Innovate by the distance of a contact point from its place in the state."""
    # In the world's axes r = R offset + p - d = xi_p - xi_d + R noise in every state: so the rows
    # of H are constant, 0 but for the blocks of position and contact.
    P, R, o, r, S = m.P, m.R, m.offset, m.r, m.S[0]
    d, p, at = m.x[CONTACTS + contact], m.x[POSITION], 9 + 3 * contact
    a, b, c = turn(R, o[0], o[1], o[2])
    r[0], r[1], r[2] = a + p[0] - d[0], b + p[1] - d[1], c + p[2] - d[2]
    for i in range(len(P)):
        for k in range(3):
            m.W[i, k] = P[i, at + k] - P[i, 6 + k]
    _world_spread(m, S)
    for i in range(3):
        for k in range(3):
            S[i, k] += m.W[at + i, k] - m.W[6 + i, k]
    return _distance(m)


@part
def innovate_bias(m: FilterMemory) -> float:
    """Innovate by `offset` as the gyro's bias, with the covariance `spread`."""
    at = len(m.P) - 6
    for k in range(3):
        m.r[k] = m.offset[k] - m.bias[0, k]
        for i in range(len(m.P)):
            m.W[i, k] = m.P[i, at + k]
        for i in range(3):
            m.S[0, i, k] = m.P[at + i, at + k] + m.spread[i, k]
    return _distance(m)


@part
def _distance(m: FilterMemory) -> float:
    """Return r^T S^-1 r, NaN where S is singular; its factor stays in `S[1]`."""
    S, L, r, x = m.S[0], m.S[1], m.r, m.delta
    for i in range(3):
        x[i] = r[i]
        for k in range(3):
            L[i, k] = S[i, k]
    if not factor_leading(L, 3):
        return math.nan
    solve_leading(L, 3, x)
    return r[0] * x[0] + r[1] * x[1] + r[2] * x[2]


@part
def correct(m: FilterMemory) -> None:
    """Correct by the last innovation: X <- exp(K r) X, biases += K r, P in Joseph's form."""
    # P - K W^T - W K^T + K S K^T stays positive.
    P, W, K, S, r = m.P, m.W, m.K, m.S[0], m.r
    n = len(P)
    for i in range(n):
        for k in range(3):
            K[i, k] = W[i, k]
        solve_leading(m.S[1], 3, K[i])
        m.delta[i] = K[i, 0] * r[0] + K[i, 1] * r[1] + K[i, 2] * r[2]
        for k in range(3):
            m.G[i, k] = K[i, 0] * S[0, k] + K[i, 1] * S[1, k] + K[i, 2] * S[2, k] - W[i, k]
    for i in range(n):
        for k in range(i + 1):
            change = 0.0
            for j in range(3):
                change += m.G[i, j] * K[k, j] - K[i, j] * W[k, j]
            P[i, k] += change
            P[k, i] = P[i, k]
    _shift(m)


@part
def _shift(m: FilterMemory) -> None:
    """Set X <- exp(delta) X, biases += delta."""
    T, x, delta = m.turned, m.x, m.delta
    phi = delta[:3]
    fill_gamma(0, phi, 1.0, T[0])
    fill_gamma(1, phi, 1.0, T[1])
    for i in range(len(x)):
        at = 3 * i + 3
        a, b, c = turn(T[0], x[i, 0], x[i, 1], x[i, 2])
        u, v, w = turn(T[1], delta[at], delta[at + 1], delta[at + 2])
        x[i, 0], x[i, 1], x[i, 2] = a + u, b + v, c + w
    multiply(T[0], m.R, T[2])
    _set_rotation(m.R, T[2])
    at = len(delta) - 6
    for i in range(3):
        m.bias[0, i] += delta[at + i]
        m.bias[1, i] += delta[at + 3 + i]


@part
def _set_rotation(R: Float64[np.ndarray, "3 3"], new: Float64[np.ndarray, "3 3"]) -> None:
    """Set R <- new (3 I - new^T new) / 2, a step towards the nearest rotation."""
    for i in range(3):
        for k in range(3):
            total = 3.0 * new[i, k]
            for j in range(3):
                dot = new[0, j] * new[0, k] + new[1, j] * new[1, k] + new[2, j] * new[2, k]
                total -= new[i, j] * dot
            R[i, k] = 0.5 * total


@part
def is_sound(m: FilterMemory) -> bool:
    """Test that all is finite and no variance negative."""
    # NaN fails every comparison.
    for i in range(len(m.P)):
        if not 0.0 <= m.P[i, i] < math.inf:
            return False
    for i in range(3):
        if not (abs(m.bias[0, i]) < math.inf and abs(m.bias[1, i]) < math.inf):
            return False
        for k in range(3):
            if not abs(m.R[i, k]) <= 1.1:
                return False
    for i in range(len(m.x)):
        for k in range(3):
            if not abs(m.x[i, k]) < math.inf:
                return False
    return True
