"""Steps of an invariant filter: propagation, contact points, innovation and correction."""

import math

import numpy as np
from jaxtyping import Float64

from poise._compiled import factor_leading, part, solve_lower
from poise.estimation._group import fill_gamma, multiply, turn
from poise.estimation._memory import CONTACTS, POSITION, VELOCITY, FilterMemory
from poise.robots import GRAVITY


@part
def _spread_covariance(m: FilterMemory, dt: float) -> None:
    """Set P <- Phi (P + G Q G^T dt) Phi^T with Phi = exp(A dt), A at the state before the step."""
    # A has no fourth power:  orientation' = -R zeta_g
    #                         velocity'    = hat(g) orientation - hat(v) R zeta_g - R zeta_a
    #                         position'    = velocity - hat(p) R zeta_g
    #                         contact'     = -hat(d) R zeta_g
    # The noise of the gyro enters as its bias does, by G = [R; hat(v) R; hat(p) R; hat(d) R]; the
    # place d of a contact point that is not held is zero.
    P, A, R, G, Y = m.P, m.A, m.R, m.G, m.Y
    n, gyro = len(P), len(P) - 6
    A[3, 1], A[4, 0] = GRAVITY, -GRAVITY
    for k in range(3):
        A[6 + k, 3 + k] = 1.0
        for i in range(3):
            G[i, k], A[3 + i, n - 3 + k] = R[i, k], -R[i, k]
        for i in range(len(m.x)):
            x, y, z, at = m.x[i, 0], m.x[i, 1], m.x[i, 2], 3 * i + 3
            G[at, k] = y * R[2, k] - z * R[1, k]
            G[at + 1, k] = z * R[0, k] - x * R[2, k]
            G[at + 2, k] = x * R[1, k] - y * R[0, k]
    variance = dt * m.density[0] * m.density[0]
    for i in range(gyro):
        for k in range(3):
            A[i, gyro + k] = -G[i, k]
        for k in range(gyro):
            P[i, k] += variance * (G[i, 0] * G[k, 0] + G[i, 1] * G[k, 1] + G[i, 2] * G[k, 2])
    for i in range(3):
        # R R^T is the identity.
        P[3 + i, 3 + i] += dt * m.density[1] * m.density[1]
        P[gyro + i, gyro + i] += dt * m.density[2] * m.density[2]
        P[gyro + 3 + i, gyro + 3 + i] += dt * m.density[3] * m.density[3]
        for c in range(len(m.active)):
            if m.active[c]:
                P[9 + 3 * c + i, 9 + 3 * c + i] += dt * m.contact_density[c] * m.contact_density[c]
    for _ in range(2):
        # P <- (Phi P)^T by Horner's rule: a row reads rows above it, and of the biases, alone.
        for i in range(n):
            for j in range(n):
                Y[i, j] = P[i, j]
        for order in range(3, 0, -1):
            for i in range(gyro - 1, -1, -1):
                for j in range(n):
                    Y[i, j] = P[i, j]
                # A has no columns of position and contact points.
                for k in range(12):
                    column = k if k < 6 else gyro - 6 + k
                    rate = dt / order * A[i, column]
                    if rate != 0.0:
                        for j in range(n):
                            Y[i, j] += rate * Y[column, j]
        for i in range(n):
            for j in range(n):
                P[j, i] = Y[i, j]


@part
def _accelerated(m: FilterMemory, order: int, dt: float) -> tuple[float, float, float]:
    """Return R Gamma_k(w dt) f in the world, for an order k."""
    w, f = m.delta[:3], m.delta[3:6]
    fill_gamma(order, w, dt, m.turned[0])
    a, b, c = turn(m.turned[0], f[0], f[1], f[2])
    return turn(m.R, a, b, c)


@part
def propagate(m: FilterMemory, dt: float) -> None:
    """Advance mean and covariance by `dt`, the mean exactly for readings that are constant."""
    _spread_covariance(m, dt)
    x, T, w = m.x, m.turned, m.delta[:3]
    for i in range(3):
        m.delta[i] = m.imu[0, i] - m.bias[0, i]
        m.delta[3 + i] = m.imu[1, i] - m.bias[1, i]
    second, first = _accelerated(m, 2, dt), _accelerated(m, 1, dt)
    for i in range(3):
        fall = GRAVITY if i == 2 else 0.0
        x[POSITION, i] += dt * x[VELOCITY, i] + dt * dt * (second[i] - 0.5 * fall)
        x[VELOCITY, i] += dt * (first[i] - fall)
    fill_gamma(0, w, dt, T[0])
    multiply(m.R, T[0], T[1])
    _set_rotation(m.R, T[1])


@part
def _world_spread(m: FilterMemory) -> None:
    """Set S to the offset's covariance along the world's axes, R spread R^T."""
    T = m.turned[0]
    multiply(m.R, m.spread, T)
    for i in range(3):
        m.S[i, 0], m.S[i, 1], m.S[i, 2] = turn(m.R, T[i, 0], T[i, 1], T[i, 2])


@part
def hold(m: FilterMemory, contact: int) -> None:
    """Add a contact point to the state where the kinematics see it."""
    # d = p + R offset, and in the invariant error xi_d = xi_p + R (noise of the offset): the new
    # block of the covariance is that of the position and the noise.
    P, o, at = m.P, m.offset, 9 + 3 * contact
    place = turn(m.R, o[0], o[1], o[2])
    _world_spread(m)
    for i in range(3):
        m.x[CONTACTS + contact, i] = m.x[POSITION, i] + place[i]
        for k in range(len(P)):
            P[at + i, k] = P[6 + i, k]
    for i in range(3):
        for k in range(len(P)):
            P[k, at + i] = P[k, 6 + i]
    for i in range(3):
        for k in range(3):
            P[at + i, at + k] += m.S[i, k]
    m.active[contact] = 1


@part
def release(m: FilterMemory, contact: int) -> None:
    """Remove a contact point and its rows and columns of the covariance."""
    at = 9 + 3 * contact
    m.P[at : at + 3], m.P[:, at : at + 3], m.x[CONTACTS + contact] = 0.0, 0.0, 0.0
    m.active[contact] = 0


@part
def innovate(m: FilterMemory, contact: int) -> float:
    """Innovate by the distance of a contact point from its place in the state."""
    # In the world's axes r = R offset + p - d = xi_p - xi_d + R noise in every state: so the rows
    # of H are constant, 0 but for the blocks of position and contact.
    P, W, o, at = m.P, m.W, m.offset, 9 + 3 * contact
    place = turn(m.R, o[0], o[1], o[2])
    _world_spread(m)
    for k in range(3):
        m.r[k] = place[k] + m.x[POSITION, k] - m.x[CONTACTS + contact, k]
        for i in range(len(P)):
            W[i, k] = P[i, at + k] - P[i, 6 + k]
    for i in range(3):
        for k in range(3):
            m.S[i, k] += W[at + i, k] - W[6 + i, k]
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
            m.S[i, k] = m.P[at + i, at + k] + m.spread[i, k]
    return _distance(m)


@part
def _distance(m: FilterMemory) -> float:
    """Set S = L L^T and r <- L^-1 r; return r^T S^-1 r, NaN where S is singular."""
    if not factor_leading(m.S, 3):
        return math.nan
    solve_lower(m.S, 0, 3, m.r)
    return m.r[0] * m.r[0] + m.r[1] * m.r[1] + m.r[2] * m.r[2]


@part
def correct(m: FilterMemory) -> None:
    """Correct by the last innovation: X <- exp(W S^-1 r) X, the biases alike, P -= W S^-1 W^T."""
    P, W, r = m.P, m.W, m.r
    for i in range(len(P)):
        solve_lower(m.S, 0, 3, W[i])
        m.delta[i] = W[i, 0] * r[0] + W[i, 1] * r[1] + W[i, 2] * r[2]
        for k in range(i + 1):
            P[i, k] -= W[i, 0] * W[k, 0] + W[i, 1] * W[k, 1] + W[i, 2] * W[k, 2]
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
    multiply(T[0], m.R, T[1])
    _set_rotation(m.R, T[1])
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
    total = 0.0
    for i in range(len(m.P)):
        if not m.P[i, i] >= 0.0:
            return False
        total += m.P[i, i]
    for k in range(3):
        total += abs(m.bias[0, k]) + abs(m.bias[1, k])
        for i in range(3):
            if not abs(m.R[i, k]) <= 1.1:
                return False
        for i in range(len(m.x)):
            total += abs(m.x[i, k])
    return total < math.inf
