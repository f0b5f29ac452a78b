"""`PayloadEstimator`: how heavy a robot is and where its centre of mass is, from its soles."""

import math

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.dynamics import Payload, RobotState
from poise.errors import ConfigurationError
from poise.estimation._config import PayloadBelief
from poise.estimation._group import hat
from poise.robots import GRAVITY, Robot

_GRAVITY = np.array([0.0, 0.0, -GRAVITY])

_LONGEST = 0.05
"""A clock that jumps farther says nothing of what happened meanwhile [s]."""


_PERIOD = 0.01
"""The filter goes on after so long: what it looks for is slow [s]."""

_MASS_STEP, _OFFSET_STEP = 0.002, 0.0005
"""What is told stays as it is until it is off by so much, by the robot's mass and [m]: who computes
with it has its work with every change."""


class PayloadEstimator:
    """Mass and centre of mass that the soles' wrenches say, as a slow and bounded random walk.

    With m, c, h = [p; L] the mass, the centre of mass and the centroidal momentum that the
    description says, F and N the soles' forces and their moment about c, sigma m the mass beyond
    the description's, and e m the first moment beyond it, in the axes of the torso R,

        F - (p' - m g) = sigma (p' - m g)
        N - L'         = sigma L' + m R e x (a - g)                a = p' / m

    A Kalman filter finds sigma and e, three numbers of which gravity shows two; the third stays
    near zero until the torso has leaned. All that is compared goes through one low-pass, so that
    rates are differences to it, h' = (h - h_low) / smoothing, and nothing is differentiated.

    It takes no measurement where a sole that should measure does not, where the soles carry next
    to nothing, or the robot moves violently, and believes them the less the more somebody pushes:
    no mass and no offset makes a force along the ground. What somebody else carries, a hand on a
    table, looks as if the robot were lighter. Base and torso have to be upright in the state: 0.2
    degrees of tilt are 2 to 3 mm of the centre of mass. Wrenches that are estimated from the
    motors' torques with the description's own masses contain those, and are of no use.

    It is an estimator of `rollout` by itself, for states whose base is known, or a part of
    `StateEstimator`.

    Args:
        robot: with a floating base and soles that measure their wrenches.
        belief: what it believes.

    Attributes:
        belief: what it believes.
        payload: mass and offset as they are told, changed no faster than `belief` says; None until
            there is something to tell.

    Raises:
        ConfigurationError: the robot has no floating base or no sole.
    """

    def __init__(self, robot: Robot, belief: PayloadBelief | None = None) -> None:
        if not (robot.floating_base and robot.soles):
            raise ConfigurationError(
                f"the payload of robot {robot.name!r} cannot be estimated",
                got="no soles" if robot.floating_base else "a fixed base",
                wanted="a floating base and soles",
            )
        self.belief = belief if belief is not None else PayloadBelief()
        self._model, self._data, self._mass = robot.model, robot.model.createData(), robot.mass
        self._soles = {name: robot.frame_id(name) for name in robot.soles}
        self._torso = robot.frame_id(robot.torso)
        self.reset()

    def reset(self) -> None:
        """Forgets everything: the robot is as its description says."""
        self.payload: Payload | None = None
        self._time, self._since = math.nan, 0.0
        self._mean = np.zeros(4)
        self._covariance = np.zeros((4, 4))
        self._told = np.zeros(4)
        self._low: Float64[np.ndarray, "12"] | None = None

    @property
    def mass(self) -> float:
        """What the filter finds beyond the description's mass, before it is told slowly [kg]."""
        return float(self._mean[0]) * self._mass

    @property
    def offset(self) -> Float64[np.ndarray, "3"]:
        """How far it finds the centre of mass to be off, along the torso's axes [m]."""
        return self._mean[1:] / (1.0 + self._mean[0])

    def update(self, state: RobotState) -> RobotState:
        """Takes a state in, and returns it with the payload.

        Args:
            state: with the base known or estimated; one without the soles' wrenches, or with
                numbers of no use, changes nothing.
        """
        dt = state.time - self._time
        self._time = state.time
        felt = self._felt(state)
        if felt is None or not 0.0 < dt <= _LONGEST or self._low is None:
            self._low = felt
        else:
            self._low += -math.expm1(-dt / self.belief.smoothing) * (felt - self._low)
            self._since += dt
            if self._since >= _PERIOD:
                self._correct(felt, self._since)
                self._tell(self._since)
                self._since = 0.0
        return RobotState(
            state.q, state.v, state.contacts, state.time, state.readings, self.payload
        )

    def _felt(self, state: RobotState) -> Float64[np.ndarray, "12"] | None:
        """Force and moment of the soles about the centre of mass, then the momentum, by the mass.

        None where there are none, or numbers of no use.
        """
        if state.q.shape != (self._model.nq,) or state.v.shape != (self._model.nv,):
            return None
        pin.computeCentroidalMomentum(self._model, self._data, state.q, state.v)
        felt = np.zeros(12)
        felt[6:] = self._data.hg.vector / self._mass
        for name, frame in self._soles.items():
            wrench = state.contacts.get(name)
            if wrench is None:
                return None
            place = pin.updateFramePlacement(self._model, self._data, frame)
            force = place.rotation @ wrench[:3]
            felt[:3] += force
            felt[3:6] += hat(place.translation - self._data.com[0]) @ force
            felt[3:6] += place.rotation @ wrench[3:]
        felt[:6] /= self._mass
        return felt if np.isfinite(felt).all() else None

    def _correct(self, felt: Float64[np.ndarray, "12"], dt: float) -> None:
        """One step of the filter, all by the robot's mass."""
        b, low = self.belief, self._low
        assert low is not None
        rate = (felt[6:] - low[6:]) / b.smoothing
        walk = np.array([b.mass_walk, *[b.offset_walk] * 3]) ** 2 * dt
        self._covariance[np.diag_indices(4)] += walk
        shocked = float(np.abs(rate[:3]).max()) > b.shock
        if shocked or low[2] < b.least_load * GRAVITY:
            return
        world_R_torso = pin.updateFramePlacement(self._model, self._data, self._torso).rotation
        reaction = rate[:3] - _GRAVITY
        H = np.zeros((6, 4))
        H[:3, 0], H[3:, 0] = reaction, rate[3:]
        H[3:, 1:] = -hat(reaction) @ world_R_torso
        left = np.concatenate((low[:3] - reaction, low[3:6] - rate[3:])) - H @ self._mean
        pushed = math.hypot(float(left[0]), float(left[1])) / (b.push * GRAVITY)
        noise = np.repeat([b.force_noise, b.moment_noise], 3) * GRAVITY * (1.0 + pushed**2)
        spread = H @ self._covariance @ H.T + np.diag(noise**2 / dt)
        gain = np.linalg.solve(spread, H @ self._covariance).T
        self._mean += gain @ left
        self._covariance -= gain @ H @ self._covariance
        self._covariance = 0.5 * (self._covariance + self._covariance.T)
        self._mean[0] = min(max(self._mean[0], -b.lost_mass), b.added_mass)
        np.clip(self._mean[1:], -b.offset_max, b.offset_max, out=self._mean[1:])

    def _tell(self, dt: float) -> None:
        """What is told follows what is found, no faster than it may, and in steps worth telling."""
        b, told = self.belief, self._told
        most = np.array([b.mass_rate, *[b.offset_rate] * 3]) * dt
        told += np.clip(np.append(self._mean[0], self.offset) - told, -most, most)
        last = np.zeros(4)
        if self.payload is not None:
            last[0], last[1:] = self.payload.mass / self._mass, self.payload.offset
        off = np.abs(told - last)
        if off[0] > _MASS_STEP or float(off[1:].max()) > _OFFSET_STEP:
            self.payload = Payload(float(told[0]) * self._mass, told[1:].copy())
