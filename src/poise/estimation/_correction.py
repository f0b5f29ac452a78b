"""Contact points of an invariant filter come, correct it, and go."""

import math

import numpy as np
from jaxtyping import Float64

from poise._compiled import part
from poise.estimation._group import fill_gamma, multiply, turn
from poise.estimation._memory import CONTACTS, POSITION, FilterMemory, set_rotation


@part
def _world_spread(m: FilterMemory, out: Float64[np.ndarray, "3 3"]) -> None:
    """Covariance of the offset along the world's axes: R spread R^T."""
    T = m.turned[0]
    multiply(m.R, m.spread, T)
    for i in range(3):
        out[i, 0], out[i, 1], out[i, 2] = turn(m.R, T[i, 0], T[i, 1], T[i, 2])


@part
def hold(m: FilterMemory, contact: int) -> None:
    """A contact point comes to the state where the kinematics see it now.

    d = p + R offset, and in the invariant error xi_d = xi_p + R (noise of the offset): the new
    block of the covariance is that of the position and the noise.
    """
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
    """A contact point leaves: its rows and columns of the covariance go."""
    at = 9 + 3 * contact
    for i in range(at, at + 3):
        for k in range(len(m.P)):
            m.P[i, k] = m.P[k, i] = 0.0
        m.x[CONTACTS + contact, i - at] = 0.0
    m.active[contact] = 0


@part
def _invert(S: Float64[np.ndarray, "3 3"], out: Float64[np.ndarray, "3 3"]) -> bool:
    """The inverse of a symmetric positive matrix; False where it has none."""
    a = S[1, 1] * S[2, 2] - S[1, 2] * S[1, 2]
    b = S[0, 2] * S[1, 2] - S[0, 1] * S[2, 2]
    c = S[0, 1] * S[1, 2] - S[0, 2] * S[1, 1]
    det = S[0, 0] * a + S[0, 1] * b + S[0, 2] * c
    if not det > 0.0:
        return False
    out[0, 0], out[0, 1], out[0, 2] = a / det, b / det, c / det
    out[1, 0], out[2, 0] = out[0, 1], out[0, 2]
    out[1, 1] = (S[0, 0] * S[2, 2] - S[0, 2] * S[0, 2]) / det
    out[2, 2] = (S[0, 0] * S[1, 1] - S[0, 1] * S[0, 1]) / det
    out[1, 2] = out[2, 1] = (S[0, 1] * S[0, 2] - S[0, 0] * S[1, 2]) / det
    return True


@part
def innovate(m: FilterMemory, contact: int) -> float:
    """How far the kinematics put a contact point from where it is held.

    In the world's axes r = R offset + p - d = xi_p - xi_d + R noise, whatever the state: so the
    rows of H are constant, 0 but for the blocks of position and contact.
    """
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
    """Innovate the gyro's bias by `offset` with the covariance `spread`, as `innovate`."""
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
    """r^T S^-1 r, NaN where S is singular; the inverse stays in `S[1]`."""
    r = m.r
    if not _invert(m.S[0], m.S[1]):
        return math.nan
    x, y, z = turn(m.S[1], r[0], r[1], r[2])
    return r[0] * x + r[1] * y + r[2] * z


@part
def correct(m: FilterMemory) -> None:
    """Apply the correction of the last innovation: X <- exp(K r) X, biases += K r.

    The covariance as P - K W^T - W K^T + K S K^T, Joseph's form, which stays positive.
    """
    P, W, K, S, inverse, r = m.P, m.W, m.K, m.S[0], m.S[1], m.r
    n = len(P)
    for i in range(n):
        for k in range(3):
            K[i, k] = W[i, 0] * inverse[0, k] + W[i, 1] * inverse[1, k] + W[i, 2] * inverse[2, k]
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
    """X <- exp(delta) X, biases += delta."""
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
    set_rotation(m.R, T[2])
    at = len(delta) - 6
    for i in range(3):
        m.bias[0, i] += delta[at + i]
        m.bias[1, i] += delta[at + 3 + i]
