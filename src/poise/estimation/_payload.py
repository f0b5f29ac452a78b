"""`PayloadEstimator`: mass, centre of mass, masses in the hands, error of the attitude."""

import math
from dataclasses import replace

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._compiled import MemoryBlock, allocate, compiled, part, view
from poise.dynamics import (
    KINEMATICS,
    ROTATION,
    VELOCITY,
    Frames,
    Motion,
    PayloadEstimate,
    RobotState,
    frames_of,
    motion_of,
    place_frame,
    turn_to_world,
)
from poise.errors import ConfigurationError
from poise.estimation._config import LONGEST_STEP, PayloadBelief
from poise.robots import GRAVITY, Robot

_PERIOD = 0.02
"""Of the filter, whose unknowns are slow [s]."""

_SETTLED = 2.0
"""Time constants of the low-pass after which masses are learned: until then it has the first
sample, in which soles may not yet carry their share."""

_STEP = 0.03
"""Smallest change of the output over its likely deviation: each costs the controllers an update of
their model."""

_AT_REST = 0.05
"""Motion in the torso that counts as none: resting arms swing as much when a robot walks [m]."""


_BODY, _TILT, _HELD = slice(0, 6), slice(4, 6), slice(6, None)
"""Unknowns: mass, first moment and error of the attitude; that error; masses in the hands."""


class PayloadEstimator:
    """Masses and the error of the attitude by the soles' wrenches, as slow random walks.

    With m, c, h = [p; L] the mass, the centre of mass and the centroidal momentum of the
    description, F and N the soles' forces and their moment about c, sigma m the mass beyond the
    description's, e m the first moment beyond it, in the axes of the torso R, and phi the small
    rotation of the base in the state from its true attitude, in the axes of the base B,

        F - (p' - m g) = sigma (p' - m g) + F_z (B phi) x z
        N - L'         = sigma L' + m R e x (a - g)                a = p' / m

    A Kalman filter estimates sigma, e, and with `attitude` also phi about the base's x and y. In
    one posture gravity makes three of the four numbers sigma and e observable; the fourth stays
    near zero until the torso has leaned. Both sides pass the same low-pass filter, and rates are
    differences to its output, h' = (h - h_low) / smoothing, without numerical differentiation.

    A mass mu in a hand, at the place r with velocity v, takes mu (a - g) of force and, about c,
    mu (r - c) x (a - g) of moment. With hands at rest this cannot be distinguished from an offset
    of the body; when a hand moves, its moment changes and the body's does not. So the residual
    moment y and the columns B of unit masses both pass a high-pass filter in the torso's axes, and
    the filter estimates mu from y - y_slow = (B - B_slow) mu. At rest mu is constant: the variance
    of its random walk grows with the distance that the hand moves. Its weight is reduced while the
    force changes, until the high-pass filter has decayed. With
    (r - c) x a = ((r - c) x v)' + c' x v nothing is differentiated there either.

    Measurements are skipped where a sole has no reading, where the load of the soles is too low, or
    where accelerations are too high. Their weight falls with the horizontal residual force, which
    no mass and no offset explains. A steady push is estimated as an error of the attitude, and a
    hand that rests on a table as a lower mass. Without `attitude` base and torso have to be upright
    in the state: 0.2 degrees of tilt shift the centre of mass by 2 to 3 mm. Wrenches estimated from
    the motors' torques contain the description's own masses, and cannot be used.

    It is an estimator of `rollout` by itself, for states whose base is known, or a part of
    `StateEstimator`.

    Args:
        robot: with a floating base and soles that measure their wrenches.
        belief: about robot and sensors.
        attitude: estimate phi, too; the caller passes states whose attitude is `corrected`.

    Attributes:
        belief: about robot and sensors.
        payload: mass and offset for controllers, at the rates of `belief`; None before the first.
        tilt: phi, about the base's x and y; zero without `attitude` [rad].

    Raises:
        ConfigurationError: the robot has no floating base or no sole.
    """

    def __init__(
        self, robot: Robot, belief: PayloadBelief | None = None, *, attitude: bool = False
    ) -> None:
        if not (robot.floating_base and robot.soles):
            raise ConfigurationError(
                f"the payload of robot {robot.name!r} cannot be estimated",
                got="no soles" if robot.floating_base else "a fixed base",
                wanted="a floating base and soles",
            )
        self.belief = b = belief if belief is not None else PayloadBelief()
        self._model, self._data, self._mass = robot.model, robot.model.createData(), robot.mass
        self._shapes = (robot.nq,), (robot.nv,)
        self._soles, self._torso = tuple(robot.soles), robot.frame_id(robot.torso)
        self._frames = [robot.frame_id(name) for name in robot.hands]
        hands = len(self._frames)
        frame_ids = [*map(robot.frame_id, self._soles), *self._frames]
        self._memory = allocate(
            _PayloadMemory,
            {"soles": len(self._soles), "6": 6, "room": KINEMATICS, "k": _SOLES + _HAND * hands},
            motion=motion_of(robot.model, self._data),
            frames=frames_of(robot.model, frame_ids),
            momentum=self._data.hg.vector,
        )
        self._rows = list(self._memory.wrenches)

        def each(mass: float, offset: float, tilt: float, held: float) -> Float64[np.ndarray, " n"]:
            return np.repeat([mass, offset, tilt, held], [1, 3, 2, hands])

        self._attitude, tilts = attitude, float(attitude)
        self._likely = each(b.likely_mass, b.likely_offset, tilts * b.likely_tilt, b.likely_held)
        self._walk = each(b.mass_walk, b.offset_walk, tilts * b.tilt_walk, 0.0) ** 2
        self._least = each(-b.lost_mass, -b.offset_max, -b.tilt_max, 0.0)
        self._most = each(b.added_mass, b.offset_max, b.tilt_max, b.held_max)
        self._rates = each(b.mass_rate, b.offset_rate, b.tilt_rate, b.held_rate)
        self._noise = np.repeat([b.force_noise, b.moment_noise], 3) * GRAVITY
        if attitude:
            self._noise[:2] = b.tilt_noise * GRAVITY
        # Compiled now, not in the first tick.
        _measure(self._memory.address, 1.0)
        self.reset()

    def reset(self) -> None:
        """Restart with the robot as described and an attitude that is right."""
        self.payload: PayloadEstimate | None = None
        self._time, self._since, self._settling = math.nan, 0.0, 0.0
        # By the robot's mass.
        self._mean, self._covariance = np.zeros(len(self._likely)), np.diag(self._likely**2)
        self.tilt, self._on_hands = self._mean[_TILT], self._mean[_HELD]
        self._told, self._last = self._mean.copy(), self._mean.copy()
        self._restart_hands()

    def _restart_hands(self) -> None:
        """Discard the motion of the hands."""
        self._anchors: list[list[float] | None] = [None] * len(self._frames)
        self._slow: Float64[np.ndarray, "6 k"] | None = None
        self._pushed = 0.0

    @property
    def mass(self) -> float:
        """Mass beyond the description's and without the hands', ahead of `payload` [kg]."""
        return float(self._mean[0]) * self._mass

    @property
    def offset(self) -> Float64[np.ndarray, "3"]:
        """Offset of the centre of mass along the torso's axes, ahead of `payload` [m]."""
        return self._mean[1:4] / (1.0 + self._mean[0])

    @property
    def held(self) -> Float64[np.ndarray, " h"]:
        """Mass in each hand, ahead of `payload` [kg]."""
        return self._on_hands * self._mass

    def corrected(self, quaternion: Float64[np.ndarray, "4"]) -> Float64[np.ndarray, "4"]:
        """Return an attitude of the base less its error `tilt`.

        Args:
            quaternion: x, y, z, w.
        """
        back = pin.exp3(np.array([-self.tilt[0], -self.tilt[1], 0.0]))
        return (pin.Quaternion(quaternion) * pin.Quaternion(back)).coeffs()

    def update(self, state: RobotState) -> RobotState:
        """Return the state with the payload.

        Args:
            state: with the base known or estimated; one without the soles' wrenches, or with
                unusable numbers, changes nothing.
        """
        dt = state.time - self._time
        goes_on = 0.0 < dt <= LONGEST_STEP
        gain = -math.expm1(-dt / self.belief.smoothing) if goes_on else 1.0
        # The low-pass goes on where the next usable state comes soon.
        if dt != 0.0 and self._measure(state, gain):
            self._time = state.time
            if not goes_on:
                self._since, self._settling = 0.0, _SETTLED * self.belief.smoothing
                self._restart_hands()
            else:
                self._since += dt
                if self._since >= _PERIOD:
                    self._correct(self._since)
                    self._output(self._since)
                    self._settling -= self._since
                    self._since = 0.0
        return state if state.payload is self.payload else replace(state, payload=self.payload)

    def _measure(self, state: RobotState, gain: float) -> bool:
        """Smooth wrenches and motion; return False where they are missing or unusable."""
        if state.q.shape != self._shapes[0] or state.v.shape != self._shapes[1]:
            return False
        for row, name in zip(self._rows, self._soles, strict=True):
            wrench = state.wrench(name)
            if wrench is None:
                return False
            row[:] = wrench
        pin.computeCentroidalMomentum(self._model, self._data, state.q, state.v)
        return _measure(self._memory.address, gain)

    def _correct(self, dt: float) -> None:
        """Advance the filter, all by the robot's mass."""
        b, measured, low = self.belief, self._memory.measured, self._memory.low
        settled = self._settling < 0.5 * _PERIOD
        if not (settled or self._attitude):
            return
        rate = (measured[6:12] - low[6:12]) / b.smoothing
        self._covariance.flat[:: len(self._mean) + 1] += self._walk * dt
        if low[2] < b.least_load * GRAVITY:
            self._restart_hands()
            return
        if max(map(abs, rate[:3].tolist())) > b.shock:
            return
        torso = pin.updateFramePlacement(self._model, self._data, self._torso)
        reaction = rate[:3] + np.array([0.0, 0.0, GRAVITY])
        left = np.concatenate((low[:3] - reaction, low[3:6] - rate[3:]))
        if settled and self._frames:
            left -= self._correct_hands(left, rate, torso, dt)
        H = np.zeros((6, 6))
        H[:3, 0], H[3:, 0] = reaction, rate[3:]
        H[3:, 1:4] = pin.skew(-reaction).dot(torso.rotation)
        # The state's attitude is corrected by `tilt` already.
        left -= H[:, :4].dot(self._mean[:4])
        if not settled:
            H[:, :4] = 0.0
        world_R_base = self._data.oMi[1].rotation
        H[0, _TILT], H[1, _TILT] = low[2] * world_R_base[1, :2], -low[2] * world_R_base[0, :2]
        pushed = math.hypot(float(left[0]), float(left[1])) / (b.push * GRAVITY)
        change = self._filter(_BODY, H, left, self._noise * (1.0 + pushed**2), dt)
        change[_TILT] = np.clip(change[_TILT], -b.tilt_rate * dt, b.tilt_rate * dt)
        self._move(_BODY, change)

    def _correct_hands(
        self,
        left: Float64[np.ndarray, "6"],
        rate: Float64[np.ndarray, "6"],
        torso: pin.SE3,
        dt: float,
    ) -> Float64[np.ndarray, "6"]:
        """Update the masses in the hands; return their force and moment."""
        b, columns, mean = self.belief, self._unit_loads(), self._mean
        for k, way in enumerate(self._moved(torso), _BODY.stop):
            self._covariance[k, k] += b.held_walk**2 * way
        # The body's weight stays in: its offset follows the hands, late, and would take their part.
        changing = left - float(mean[0]) * rate
        changing[3:] -= pin.skew(torso.rotation.dot(mean[1:4])).dot(rate[:3])
        seen = np.empty((6, 1 + len(self._frames)))
        seen[:, 0], seen[:, 1:] = changing, columns
        seen = torso.rotation.T.dot(seen.reshape(2, 3, -1)).transpose(1, 0, 2).reshape(6, -1)
        kept = math.exp(-dt / b.washout)
        self._slow = slow = seen + kept * ((seen if self._slow is None else self._slow) - seen)
        changed, before = seen - slow, self._on_hands.copy()
        left = changed[:, 0] - changed[:, 1:].dot(before)
        pushed = min(float(left[:3].dot(left[:3])) / (b.push * GRAVITY) ** 2, 1e6)
        # A push passes through zero as it changes; the washout has its moment for longer.
        self._pushed = pushed = max(pushed, kept * self._pushed)
        noise = np.full(3, b.held_noise * GRAVITY * (1.0 + pushed))
        self._move(_HELD, self._filter(_HELD, changed[3:, 1:], left[3:], noise, dt))
        given = self._on_hands - before
        # The body's mass and first moment are less by what the hands have.
        m_x, m_y, _ = slow[3:, 1:].dot(given).tolist()
        mean[:3] -= np.array([given.sum(), -m_y / GRAVITY, m_x / GRAVITY])
        return columns.dot(self._on_hands)

    def _unit_loads(self) -> Float64[np.ndarray, "6 h"]:
        """Return B, force and moment of a unit mass in each hand."""
        measured, low = (
            x[_SOLES:].reshape(-1, _HAND) for x in (self._memory.measured, self._memory.low)
        )
        found = (measured[:, :6] - low[:, :6]) / self.belief.smoothing
        found[:, 2] += GRAVITY
        found[:, 3:] += low[:, 6:]
        return found.T

    def _moved(self, torso: pin.SE3) -> list[float]:
        """Return the distance that each hand moved in the torso since the last call [m]."""
        ways = [0.0] * len(self._frames)
        for k, frame in enumerate(self._frames):
            place = pin.updateFramePlacement(self._model, self._data, frame).translation
            here, anchor = torso.actInv(place).tolist(), self._anchors[k]
            way = 0.0 if anchor is None else math.dist(here, anchor)
            if anchor is None or way > _AT_REST:
                ways[k], self._anchors[k] = way, here
        return ways

    def _filter(
        self,
        unknowns: slice,
        H: Float64[np.ndarray, "m k"],
        left: Float64[np.ndarray, " m"],
        noise: Float64[np.ndarray, " m"],
        dt: float,
    ) -> Float64[np.ndarray, " k"]:
        """Update the covariance of some unknowns by a measurement; return their change."""
        P = self._covariance[unknowns, unknowns]
        HP = H.dot(P)
        spread = HP.dot(H.T)
        spread.flat[:: len(left) + 1] += noise**2 / dt
        gain = np.linalg.solve(spread, HP).T
        P -= gain.dot(HP)
        P[:] = 0.5 * (P + P.T)
        return gain.dot(left)

    def _move(self, unknowns: slice, change: Float64[np.ndarray, " k"]) -> None:
        """Change some unknowns, within their bounds."""
        found = self._mean[unknowns] + change
        self._mean[unknowns] = np.clip(found, self._least[unknowns], self._most[unknowns])

    def _output(self, dt: float) -> None:
        """Rate-limit the output, and update it where it changes by enough."""
        told, most = self._told, self._rates * dt
        found = self._mean.copy()
        # The error of the attitude is no part of it: `corrected` takes it off.
        found[1:4], found[_TILT] = self.offset, 0.0
        told += np.minimum(np.maximum(found - told, -most), most)
        if (np.abs(told - self._last) > _STEP * self._likely).any():
            self._last = told.copy()
            mass, held = float(told[0]) * self._mass, told[_HELD] * self._mass
            self.payload = PayloadEstimate(mass, told[1:4], held)


_SOLES, _HAND = 12, 9
"""Numbers of all soles and of the momentum, and of each hand."""


class _PayloadMemory(MemoryBlock):
    """Memory of a `PayloadEstimator`."""

    motion: Motion
    frames: Frames  # the soles, then the hands
    momentum: Float64[np.ndarray, "6"]  # centroidal, linear before angular
    wrenches: Float64[np.ndarray, "soles 6"]  # along the soles' axes [N, N m]
    room: Float64[np.ndarray, " room"]  # scratch: of one frame
    measured: Float64[np.ndarray, " k"]
    low: Float64[np.ndarray, " k"]  # `measured`, smoothed


@compiled
def _measure(address: int, gain: float) -> bool:
    """Fill in `measured` and the low-pass `low`; return False for what is not finite."""
    # Force, moment and momentum, then of each hand, with its place r and velocity v: v,
    # (r - c) x v and c' x v - (r - c) x g. All is along the world's axes, about the centre of mass
    # c, and but for the hands by the mass.
    m = view(_PayloadMemory, address)
    motion, frames, room, measured, low = m.motion, m.frames, m.room, m.measured, m.low
    com, mass, soles = motion.com, motion.mass[0], len(m.wrenches)
    for i in range(6):
        measured[i], measured[6 + i] = 0.0, m.momentum[i] / mass
    for k in range(soles):
        place_frame(motion, frames, k, room, 0)
        x, y, z = room[0] - com[0], room[1] - com[1], room[2] - com[2]
        wrench = m.wrenches[k]
        force = _turned(room, wrench[0], wrench[1], wrench[2])
        moment = _turned(room, wrench[3], wrench[4], wrench[5])
        lever = _cross(x, y, z, force[0], force[1], force[2])
        for i in range(3):
            measured[i] += force[i] / mass
            measured[3 + i] += (lever[i] + moment[i]) / mass
    for k in range((len(measured) - _SOLES) // _HAND):
        place_frame(motion, frames, soles + k, room, 0)
        turn_to_world(room, 0)
        x, y, z = room[0] - com[0], room[1] - com[1], room[2] - com[2]
        v_x, v_y, v_z = room[VELOCITY], room[VELOCITY + 1], room[VELOCITY + 2]
        out = measured[_SOLES + _HAND * k :]
        out[0], out[1], out[2] = v_x, v_y, v_z
        out[3], out[4], out[5] = _cross(x, y, z, v_x, v_y, v_z)
        out[6], out[7], out[8] = _cross(measured[6], measured[7], measured[8], v_x, v_y, v_z)
        out[6] += GRAVITY * y
        out[7] -= GRAVITY * x
    for i in range(len(measured)):
        if not abs(measured[i]) < math.inf:
            return False
    for i in range(len(measured)):
        low[i] = measured[i] if gain == 1.0 else low[i] + gain * (measured[i] - low[i])
    return True


@part
def _turned(
    place: Float64[np.ndarray, " room"], x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Turn a vector from a frame of `place_frame` to the world's axes."""
    R = place[ROTATION:VELOCITY]
    return (
        R[0] * x + R[1] * y + R[2] * z,
        R[3] * x + R[4] * y + R[5] * z,
        R[6] * x + R[7] * y + R[8] * z,
    )


@part
def _cross(
    x: float, y: float, z: float, a: float, b: float, c: float
) -> tuple[float, float, float]:
    return y * c - z * b, z * a - x * c, x * b - y * a
