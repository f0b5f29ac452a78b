"""`PayloadEstimator`: mass, centre of mass, masses in the hands, error of the attitude."""

import math
from dataclasses import replace

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._compiled import allocate
from poise.dynamics import KINEMATICS, Payload, RobotState, frames_of, motion_of
from poise.errors import ConfigurationError
from poise.estimation._config import PayloadBelief
from poise.estimation._hands import HandLoads
from poise.estimation._payload_memory import HAND, SOLES, PayloadMemory, measure
from poise.robots import GRAVITY, Robot

_GRAVITY = np.array([0.0, 0.0, -GRAVITY])

_LONGEST = 0.05
"""Longest time between two states that the low-pass goes on over [s]."""

_PERIOD = 0.02
"""Of the filter, whose unknowns are slow [s]."""

_SETTLED = 2.0
"""Time constants of the low-pass after which masses are learned: until then it has the first
sample, in which soles may not yet carry their share."""

_MASS_STEP, _OFFSET_STEP, _HELD_STEP = 0.002, 0.0005, 0.001
"""Smallest changes of the output, by the robot's mass, [m], and in a hand by the robot's mass: each
costs the controllers an update of their model."""


class PayloadEstimator:
    """Masses and the error of the attitude by the soles' wrenches, as slow random walks.

    With m, c, h = [p; L] the mass, the centre of mass and the centroidal momentum of the
    description, F and N the soles' forces and their moment about c, sigma m the mass beyond the
    description's, e m the first moment beyond it, in the axes of the torso R, and phi a small turn
    of the base in the state against its true attitude, in the axes of the base B,

        F - (p' - m g) = sigma (p' - m g) + F_z (B phi) x z
        N - L'         = sigma L' + m R e x (a - g)                a = p' / m

    and masses in the hands beside that, which show as they move (`HandLoads`).
    A Kalman filter finds sigma, e, and where `attitude` is set phi about the base's x and y. Of
    sigma and e, four numbers, gravity shows three; the last stays near zero until the torso has
    leaned. Both sides go through one low-pass, so that rates are differences to it,
    h' = (h - h_low) / smoothing, and nothing is differentiated.

    No measurement counts where a sole measures nothing, where the soles carry next to nothing, or
    where the robot moves violently, and all count the less the more something pushes: no mass and
    no offset makes a force along the ground. A steady push looks like an error of the attitude;
    a load that others carry, as by a hand on a table, makes the robot look lighter. Without
    `attitude` base and torso have to be upright in the state: 0.2 degrees of tilt are 2 to 3 mm of
    the centre of mass. Wrenches estimated from the motors' torques contain the description's own
    masses, and cannot be used.

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
        self.belief = belief if belief is not None else PayloadBelief()
        self._model, self._data, self._mass = robot.model, robot.model.createData(), robot.mass
        self._shapes = (robot.nq,), (robot.nv,)
        self._soles, self._torso = tuple(robot.soles), robot.frame_id(robot.torso)
        names = (*self._soles, *robot.hands)
        self._hands = HandLoads(robot, self.belief)
        b, hands, soles = self.belief, len(self._hands), len(self._soles)
        frame_ids = [robot.frame_id(name) for name in names]
        self._memory = allocate(
            PayloadMemory,
            {"soles": soles, "6": 6, "room": KINEMATICS, "k": SOLES + HAND * hands},
            motion=motion_of(robot.model, self._data),
            frames=frames_of(robot.model, frame_ids),
            momentum=self._data.hg.vector,
        )
        self._rows = list(self._memory.wrenches)
        self._steps = np.array([_MASS_STEP, *[_OFFSET_STEP] * 3, *[_HELD_STEP] * hands])
        self._rates = np.array([b.mass_rate, *[b.offset_rate] * 3, *[b.held_rate] * hands])
        likely = np.array([b.likely_mass, *[b.likely_offset] * 3, *[b.likely_tilt] * 2])
        walk = np.array([b.mass_walk, *[b.offset_walk] * 3, *[b.tilt_walk] * 2])
        self._noise = np.repeat([b.force_noise, b.moment_noise], 3) * GRAVITY
        if attitude:
            self._noise[:2] = b.tilt_noise * GRAVITY
        else:
            likely[4:], walk[4:] = 0.0, 0.0
        self._attitude, self._likely, self._walk = attitude, np.diag(likely**2), walk**2
        # Compiled now, not in the first tick.
        measure(self._memory.address, 1.0)
        self.reset()

    def reset(self) -> None:
        """Restart with the robot as described and an attitude that is right."""
        self.payload: Payload | None = None
        self._time, self._since, self._settling = math.nan, 0.0, 0.0
        self._mean, self._covariance = np.zeros(4), self._likely.copy()
        self.tilt: Float64[np.ndarray, "2"] = np.zeros(2)
        self._told, self._last = np.zeros(4 + len(self._hands)), np.zeros(4 + len(self._hands))
        self._hands.reset()

    @property
    def mass(self) -> float:
        """Mass beyond the description's and without the hands', ahead of `payload` [kg]."""
        return float(self._mean[0]) * self._mass

    @property
    def offset(self) -> Float64[np.ndarray, "3"]:
        """Offset of the centre of mass along the torso's axes, ahead of `payload` [m]."""
        return self._mean[1:] / (1.0 + self._mean[0])

    @property
    def held(self) -> Float64[np.ndarray, " h"]:
        """Mass in each hand, ahead of `payload` [kg]."""
        return self._hands.held * self._mass

    def corrected(self, quaternion: Float64[np.ndarray, "4"]) -> Float64[np.ndarray, "4"]:
        """Return an attitude of the base less its error `tilt`.

        Args:
            quaternion: x, y, z, w.
        """
        (x, y, z, w), (tilt_x, tilt_y) = quaternion.tolist(), self.tilt.tolist()
        half = 0.5 * math.hypot(tilt_x, tilt_y)
        ratio = -0.5 * math.sin(half) / half if half > 0.0 else -0.5
        a, b, c = ratio * tilt_x, ratio * tilt_y, math.cos(half)
        back = (w * a + x * c - z * b, w * b + y * c + z * a, x * b - y * a + z * c)
        return np.array((*back, w * c - x * a - y * b))

    def update(self, state: RobotState) -> RobotState:
        """Return the state with the payload.

        Args:
            state: with the base known or estimated; one without the soles' wrenches, or with
                unusable numbers, changes nothing.
        """
        dt = state.time - self._time
        goes_on = 0.0 < dt <= _LONGEST
        gain = -math.expm1(-dt / self.belief.smoothing) if goes_on else 1.0
        if dt == 0.0 or not self._measure(state, gain):
            # The low-pass goes on where the next state comes soon.
            return self._with_payload(state)
        self._time = state.time
        if not goes_on:
            self._since, self._settling = 0.0, _SETTLED * self.belief.smoothing
            self._hands.restart()
        else:
            self._since += dt
            if self._since >= _PERIOD:
                self._correct(self._since)
                self._output(self._since)
                self._settling -= self._since
                self._since = 0.0
        return self._with_payload(state)

    def _with_payload(self, state: RobotState) -> RobotState:
        if state.payload is self.payload:
            return state
        return replace(state, payload=self.payload)

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
        return measure(self._memory.address, gain)

    def _correct(self, dt: float) -> None:
        """Advance the filter, all by the robot's mass."""
        b, measured, low = self.belief, self._memory.measured, self._memory.low
        settled = self._settling < 0.5 * _PERIOD
        if not (settled or self._attitude):
            return
        rate = (measured[6:12] - low[6:12]) / b.smoothing
        self._covariance.flat[::7] += self._walk * dt
        if low[2] < b.least_load * GRAVITY:
            self._hands.restart()
            return
        if max(map(abs, rate[:3].tolist())) > b.shock:
            return
        torso = pin.updateFramePlacement(self._model, self._data, self._torso)
        reaction = rate[:3] - _GRAVITY
        left = np.concatenate((low[:3] - reaction, low[3:6] - rate[3:]))
        if settled and len(self._hands):
            left -= self._held(left, rate, torso, dt)
        H = np.zeros((6, 6))
        H[:3, 0], H[3:, 0] = reaction, rate[3:]
        H[3:, 1:4] = pin.skew(-reaction).dot(torso.rotation)
        # The state's attitude is corrected by `tilt` already.
        left -= H[:, :4].dot(self._mean)
        if not settled:
            H[:, :4] = 0.0
        world_R_base = self._data.oMi[1].rotation
        H[0, 4:], H[1, 4:] = low[2] * world_R_base[1, :2], -low[2] * world_R_base[0, :2]
        pushed = math.hypot(float(left[0]), float(left[1])) / (b.push * GRAVITY)
        noise = self._noise * (1.0 + pushed**2)
        HP = H.dot(self._covariance)
        spread = HP.dot(H.T)
        spread.flat[::7] += noise**2 / dt
        gain = np.linalg.solve(spread, HP).T
        covariance = self._covariance - gain.dot(HP)
        self._covariance = 0.5 * (covariance + covariance.T)
        change = gain.dot(left)
        mass, *offset = (self._mean + change[:4]).tolist()
        offset = (min(max(x, -b.offset_max), b.offset_max) for x in offset)
        self._mean[:] = (min(max(mass, -b.lost_mass), b.added_mass), *offset)
        if self._attitude:
            most = b.tilt_rate * dt
            tilt = self.tilt + np.clip(change[4:], -most, most)
            self.tilt = np.clip(tilt, -b.tilt_max, b.tilt_max)

    def _held(
        self,
        left: Float64[np.ndarray, "6"],
        rate: Float64[np.ndarray, "6"],
        torso: pin.SE3,
        dt: float,
    ) -> Float64[np.ndarray, "6"]:
        """Return force and moment of the loads in the hands, after an update of these."""
        # The body's weight stays in: its offset follows the hands, late, and would take their part.
        columns = self._hands.columns(self._memory.measured[SOLES:], self._memory.low[SOLES:])
        more, offset = float(self._mean[0]), torso.rotation.dot(self._mean[1:])
        changing = left - more * rate
        changing[3:] -= pin.skew(offset).dot(rate[:3])
        self._mean -= self._hands.correct(changing, columns, self._data, torso, dt)
        return columns.dot(self._hands.held)

    def _output(self, dt: float) -> None:
        """Rate-limit the output, and update it where it changes by enough."""
        told, most = self._told, self._rates * dt
        found = np.concatenate((self._mean[:1], self.offset, self._hands.held))
        told += np.minimum(np.maximum(found - told, -most), most)
        if (np.abs(told - self._last) > self._steps).any():
            self._last = told.copy()
            mass, held = float(told[0]) * self._mass, told[4:] * self._mass
            self.payload = Payload(mass, told[1:4], held)
