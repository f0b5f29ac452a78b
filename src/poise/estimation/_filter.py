"""`InvariantFilter`: base pose and velocity from an inertial unit and points at rest.

The right-invariant extended Kalman filter of Hartley, Ghaffari, Eustice and Grizzle (2020),
"Contact-aided invariant extended Kalman filtering for robot state estimation", with the biases of
the inertial unit and contact points that come and go. Its error does not depend on where the robot
is nor how it moves, so a bad first guess does not spoil the covariance, and what cannot be seen
(absolute position and yaw) stays unseen.
"""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from jaxtyping import Float64, Int64

from poise._compiled import Block, allocate, compiled, part, view
from poise._schema import Bounds, checked
from poise.estimation._group import fill_gamma, hat, right_error, turn
from poise.robots import GRAVITY

Deviation = Annotated[float, Bounds(least=0.0, most=1e6)]
"""A standard deviation, or the density of a noise."""

VELOCITY, POSITION, CONTACTS = 0, 1, 2
"""Rows of the vectors of the group's element; contact points are the last ones."""


@checked()
@dataclass(frozen=True, kw_only=True)
class ImuNoise:
    """Densities of an inertial unit's noise, as data sheets give them.

    White noise of standard deviation s in samples dt apart has the density s sqrt(dt).

    Attributes:
        gyro: of the angular velocity [rad/s/sqrt(Hz)].
        accelerometer: of the specific force [m/s^2/sqrt(Hz)].
        gyro_bias: of the walk of the gyro's bias [rad/s^2/sqrt(Hz)].
        accelerometer_bias: of the walk of the accelerometer's bias [m/s^3/sqrt(Hz)].
    """

    gyro: Deviation = 3e-4
    accelerometer: Deviation = 5e-3
    gyro_bias: Deviation = 1e-5
    accelerometer_bias: Deviation = 1e-4


@checked()
@dataclass(frozen=True, kw_only=True)
class InitialDeviation:
    """How well a state is known when a filter starts, as standard deviations an axis.

    Attributes:
        tilt: of the orientation about horizontal axes [rad].
        yaw: of the orientation about the vertical [rad].
        velocity: of the velocity [m/s].
        position: of the position [m].
        gyro_bias: of the gyro's bias [rad/s].
        accelerometer_bias: of the accelerometer's bias [m/s^2].
    """

    tilt: Deviation = 0.01
    yaw: Deviation = 0.0
    velocity: Deviation = 0.1
    position: Deviation = 0.0
    gyro_bias: Deviation = 0.005
    accelerometer_bias: Deviation = 0.03


class _Memory(Block):
    """What the compiled functions work on.

    The error's coordinates stand in blocks of three: orientation, velocity, position, contact
    points, gyro bias, accelerometer bias.

    Attributes:
        R: world_R_imu.
        x: rows: velocity, position, contact points, along the world's axes [m/s, m].
        bias: rows: of the gyro [rad/s], of the accelerometer [m/s^2].
        P: covariance of the error.
        active: which contact points are held.
        imu: angular velocity [rad/s], then specific force [m/s^2], along the unit's axes.
        density: of the noise: gyro, accelerometer, their biases.
        contact_density: of each contact point's walk [m/s/sqrt(Hz)].
        offset: a contact point seen from the unit, along its axes [m].
        spread: covariance of that [m^2].
        turned: scratch: rotations.
        G: scratch: how the gyro's noise reaches the error.
        W: scratch: covariance of the error with what is observed.
        S: scratch: covariance of the innovation, its inverse.
        r: scratch: innovation, and its inverse's image.
        K: scratch: the gain.
        delta: scratch: the correction.
    """

    R: Float64[np.ndarray, "3 3"]
    x: Float64[np.ndarray, "m 3"]
    bias: Float64[np.ndarray, "2 3"]
    P: Float64[np.ndarray, "n n"]
    active: Int64[np.ndarray, " contacts"]
    imu: Float64[np.ndarray, "2 3"]
    density: Float64[np.ndarray, "4"]
    contact_density: Float64[np.ndarray, " contacts"]
    offset: Float64[np.ndarray, "3"]
    spread: Float64[np.ndarray, "3 3"]
    turned: Float64[np.ndarray, "4 3 3"]
    G: Float64[np.ndarray, "n 3"]
    W: Float64[np.ndarray, "n 3"]
    S: Float64[np.ndarray, "2 3 3"]
    r: Float64[np.ndarray, "3"]
    K: Float64[np.ndarray, "n 3"]
    delta: Float64[np.ndarray, " n"]


# --- propagation --------------------------------------------------------------------------------


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
    """Fills in hat([x, y, z]) R: what a turn about the unit does to a vector."""
    for k in range(3):
        out[0, k] = y * R[2, k] - z * R[1, k]
        out[1, k] = z * R[0, k] - x * R[2, k]
        out[2, k] = x * R[1, k] - y * R[0, k]


@part
def _spread_covariance(m: _Memory, dt: float) -> None:
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
def _add_noise(m: _Memory, dt: float) -> None:
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
def _move(m: _Memory, dt: float) -> None:
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
    for i in range(3):
        for k in range(3):
            T[1, i, k] = R[i, 0] * T[0, 0, k] + R[i, 1] * T[0, 1, k] + R[i, 2] * T[0, 2, k]
    _set_rotation(R, T[1])


@part
def _set_rotation(R: Float64[np.ndarray, "3 3"], new: Float64[np.ndarray, "3 3"]) -> None:
    """R = new (3 I - new^T new) / 2: a step towards the nearest rotation, as rounding piles up."""
    for i in range(3):
        for k in range(3):
            total = 3.0 * new[i, k]
            for j in range(3):
                dot = new[0, j] * new[0, k] + new[1, j] * new[1, k] + new[2, j] * new[2, k]
                total -= new[i, j] * dot
            R[i, k] = 0.5 * total


@compiled
def _propagate(address: int, dt: float) -> None:
    """Time passes, under what `imu` measured."""
    m = view(_Memory, address)
    _add_noise(m, dt)
    _spread_covariance(m, dt)
    _move(m, dt)


# --- contacts -----------------------------------------------------------------------------------


@part
def _world_spread(m: _Memory, out: Float64[np.ndarray, "3 3"]) -> None:
    """Covariance of the offset along the world's axes: R spread R^T."""
    T = m.turned[0]
    for i in range(3):
        for k in range(3):
            T[i, k] = 0.0
            for j in range(3):
                T[i, k] += m.R[i, j] * m.spread[j, k]
    for i in range(3):
        for k in range(3):
            out[i, k] = T[i, 0] * m.R[k, 0] + T[i, 1] * m.R[k, 1] + T[i, 2] * m.R[k, 2]


@compiled
def _hold(address: int, contact: int) -> None:
    """A contact point comes to the state where the kinematics see it now.

    d = p + R offset, and in the invariant error xi_d = xi_p + R (noise of the offset): the new
    block of the covariance is that of the position and the noise.
    """
    m = view(_Memory, address)
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


@compiled
def _release(address: int, contact: int) -> None:
    """A contact point leaves: its rows and columns of the covariance go."""
    m = view(_Memory, address)
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


@compiled
def _innovate(address: int, contact: int) -> float:
    """How far the kinematics put a contact point from where it is held.

    In the world's axes r = R offset + p - d = xi_p - xi_d + R noise, whatever the state: so the
    rows of H are constant, 0 but for the blocks of position and contact.

    Returns:
        The square of the Mahalanobis distance, r^T S^-1 r; NaN where S is singular.
    """
    m = view(_Memory, address)
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


@compiled
def _innovate_bias(address: int) -> float:
    """How far the gyro's bias is from what `offset` says of it, with the covariance `spread`.

    Returns:
        The square of the Mahalanobis distance, as `_innovate`.
    """
    m = view(_Memory, address)
    at = len(m.P) - 6
    for k in range(3):
        m.r[k] = m.offset[k] - m.bias[0, k]
        for i in range(len(m.P)):
            m.W[i, k] = m.P[i, at + k]
        for i in range(3):
            m.S[0, i, k] = m.P[at + i, at + k] + m.spread[i, k]
    return _distance(m)


@part
def _distance(m: _Memory) -> float:
    """r^T S^-1 r, NaN where S is singular; the inverse stays in `S[1]`."""
    r = m.r
    if not _invert(m.S[0], m.S[1]):
        return math.nan
    x, y, z = turn(m.S[1], r[0], r[1], r[2])
    return r[0] * x + r[1] * y + r[2] * z


@compiled
def _correct(address: int) -> None:
    """Applies the correction of the last innovation: X <- exp(K r) X, biases += K r.

    The covariance as P - K W^T - W K^T + K S K^T, Joseph's form, which stays positive.
    """
    m = view(_Memory, address)
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
def _shift(m: _Memory) -> None:
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
    for i in range(3):
        for k in range(3):
            T[2, i, k] = T[0, i, 0] * m.R[0, k] + T[0, i, 1] * m.R[1, k] + T[0, i, 2] * m.R[2, k]
    _set_rotation(m.R, T[2])
    at = len(delta) - 6
    for i in range(3):
        m.bias[0, i] += delta[at + i]
        m.bias[1, i] += delta[at + 3 + i]


@compiled
def _is_sound(address: int) -> bool:
    """Whether all is finite and no variance is negative; NaN fails every comparison."""
    m = view(_Memory, address)
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


class InvariantFilter:
    """The filter by itself: told what an inertial unit and the kinematics measure, nothing else.

    Arrays that it shows are its own and change with it. Nothing here raises on numbers: what is
    not finite makes `sound` false.

    Args:
        contacts: how many points can be in contact at once.
        noise: of the inertial unit.

    Attributes:
        rotation: world_R_imu.
        velocity: of the unit, in the world [m/s].
        position: of the unit, in the world [m].
        points: contact points, in the world; of use where `held` [m].
        held: which contact points are held.
        gyro_bias: along the unit's axes [rad/s].
        accelerometer_bias: along the unit's axes [m/s^2].
        covariance: of the right-invariant error, in blocks of three: orientation, velocity,
            position, contact points (zero where none is held), gyro bias, accelerometer bias. All
            but the biases are along the world's axes and about its origin.
    """

    def __init__(self, contacts: int, noise: ImuNoise | None = None) -> None:
        noise = noise if noise is not None else ImuNoise()
        sizes = {"contacts": contacts, "m": 2 + contacts, "n": 15 + 3 * contacts}
        m = self._memory = allocate(_Memory, sizes | {"2": 2, "3": 3, "4": 4})
        m.density[:] = noise.gyro, noise.accelerometer, noise.gyro_bias, noise.accelerometer_bias
        self.rotation, self.velocity, self.position = m.R, m.x[VELOCITY], m.x[POSITION]
        self.points, self.held = m.x[CONTACTS:], m.active
        self.gyro_bias, self.accelerometer_bias = m.bias
        self.covariance = m.P
        self.start(np.eye(3), np.zeros(3))
        self._compile()

    def start(
        self,
        rotation: Float64[np.ndarray, "3 3"],
        position: Float64[np.ndarray, "3"],
        *,
        gyro_bias: Float64[np.ndarray, "3"] | None = None,
        deviation: InitialDeviation | None = None,
    ) -> None:
        """At rest somewhere, with no contact point.

        Args:
            rotation: world_R_imu.
            position: of the unit [m].
            gyro_bias: of the gyro, zero if not given [rad/s].
            deviation: how well all that is known, see `InitialDeviation`.
        """
        d = deviation if deviation is not None else InitialDeviation()
        m = self._memory
        m.R[:], m.x[:], m.bias[:], m.active[:], m.P[:] = rotation, 0.0, 0.0, 0, 0.0
        m.x[POSITION] = position
        m.bias[0] = 0.0 if gyro_bias is None else gyro_bias
        n = len(m.P)
        np.fill_diagonal(m.P[:9, :9], np.repeat([d.tilt, d.velocity, d.position], 3) ** 2)
        m.P[2, 2] = d.yaw**2
        biases = np.repeat([d.gyro_bias, d.accelerometer_bias], 3) ** 2
        np.fill_diagonal(m.P[n - 6 :, n - 6 :], biases)
        self._tip(m.P[:3, :3].copy())

    def _tip(self, about: Float64[np.ndarray, "3 3"]) -> None:
        """P becomes that of an orientation with such a covariance about the unit.

        The invariant error is about the world's origin, so velocity and position go along.
        """
        lever = np.vstack([np.eye(3), hat(self.velocity), hat(self.position)])
        self._memory.P[:3, :3] -= about
        self._memory.P[:9, :9] += lever @ about @ lever.T

    def propagate(
        self,
        angular_velocity: Float64[np.ndarray, "3"],
        specific_force: Float64[np.ndarray, "3"],
        dt: float,
        walk: Float64[np.ndarray, " contacts"] | float = 0.0,
    ) -> None:
        """Time passes.

        Args:
            angular_velocity: as measured, along the unit's axes [rad/s].
            specific_force: as measured: acceleration less gravity, along the unit's axes [m/s^2].
            dt: how much time, of which these are means [s].
            walk: density of the noise with which contact points move [m/s/sqrt(Hz)].
        """
        m = self._memory
        m.imu[0], m.imu[1], m.contact_density[:] = angular_velocity, specific_force, walk
        _propagate(m.address, dt)

    def hold(
        self,
        contact: int,
        offset: Float64[np.ndarray, "3"],
        spread: Float64[np.ndarray, "3 3"],
    ) -> None:
        """Takes a contact point into the state, or puts one down anew.

        Args:
            contact: its number.
            offset: where the kinematics see it from the unit, along the unit's axes [m].
            spread: covariance of that [m^2].
        """
        m = self._memory
        m.offset[:], m.spread[:] = offset, spread
        if m.active[contact]:
            _release(m.address, contact)
        _hold(m.address, contact)

    def release(self, contact: int) -> None:
        """Takes a contact point out of the state.

        Args:
            contact: its number.
        """
        _release(self._memory.address, contact)

    def innovate(
        self,
        contact: int,
        offset: Float64[np.ndarray, "3"],
        spread: Float64[np.ndarray, "3 3"],
    ) -> float:
        """Compares where the kinematics see a held contact point with where it is.

        Args:
            contact: its number.
            offset: where the kinematics see it from the unit, along the unit's axes [m].
            spread: covariance of that [m^2].

        Returns:
            The square of the Mahalanobis distance: chi-squared with three degrees of freedom where
            the point is at rest. NaN where it is not to be had.
        """
        m = self._memory
        m.offset[:], m.spread[:] = offset, spread
        return _innovate(m.address, contact)

    def innovate_bias(
        self, bias: Float64[np.ndarray, "3"], spread: Float64[np.ndarray, "3 3"]
    ) -> float:
        """Compares the gyro's bias with what is known of it otherwise.

        Where a foot at rest does not turn, the kinematics say how the unit turns, and the gyro's
        reading less that is its bias. Without this the bias about the vertical hides behind yaw.

        Args:
            bias: as known, along the unit's axes [rad/s].
            spread: covariance of that [rad^2/s^2].

        Returns:
            The square of the Mahalanobis distance, as `innovate`.
        """
        m = self._memory
        m.offset[:], m.spread[:] = bias, spread
        return _innovate_bias(m.address)

    def correct(self) -> None:
        """Corrects the state by the innovation that was asked for last."""
        _correct(self._memory.address)

    def loosen(self, *, tilt: float = 0.0, velocity: float = 0.0) -> None:
        """Makes the state less certain than it was, about the unit.

        Args:
            tilt: further deviation of the orientation about horizontal axes [rad].
            velocity: further deviation of the velocity [m/s].
        """
        P, about = self._memory.P, np.diag([tilt**2, tilt**2, 0.0])
        P[:3, :3] += about
        P[3:6, 3:6] += velocity**2 * np.eye(3)
        self._tip(about)

    @property
    def sound(self) -> bool:
        """Whether all numbers are finite and no variance is negative."""
        return _is_sound(self._memory.address)

    def error(
        self,
        rotation: Float64[np.ndarray, "3 3"],
        velocity: Float64[np.ndarray, "3"],
        position: Float64[np.ndarray, "3"],
    ) -> Float64[np.ndarray, "9"]:
        """The right-invariant error against the truth, of which `covariance` speaks.

        Args:
            rotation: world_R_imu.
            velocity: of the unit, in the world [m/s].
            position: of the unit, in the world [m].

        Returns:
            Orientation [rad], velocity [m/s], position [m].
        """
        truth = np.array([velocity, position])
        return right_error((self.rotation, self._memory.x[:CONTACTS]), (rotation, truth))

    def _compile(self) -> None:
        """Compiled now, not in the first tick."""
        if not len(self.held):
            return
        at, spread = np.zeros(3), np.eye(3)
        self.propagate(at, at, 1e-3)
        self.hold(0, at, spread)
        self.innovate(0, at, spread)
        self.innovate_bias(at, spread)
        self.correct()
        self.release(0)
        _ = self.sound
        self.start(np.eye(3), np.zeros(3))
