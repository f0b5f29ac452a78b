"""`PayloadEstimator`: mass and centre of mass of a robot, and masses in its hands."""

import math

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._compiled import allocate
from poise.dynamics import (
    KINEMATICS,
    Payload,
    RobotState,
    frames_of,
    motion_of,
)
from poise.errors import ConfigurationError
from poise.estimation._config import PayloadBelief
from poise.estimation._group import hat
from poise.estimation._hands import HandLoads
from poise.estimation._payload_memory import HAND, SOLES, PayloadMemory, measure
from poise.robots import GRAVITY, Robot

_GRAVITY = np.array([0.0, 0.0, -GRAVITY])

_LONGEST = 0.05
"""A clock that jumps farther says nothing of what happened meanwhile [s]."""


_PERIOD = 0.02
"""The filter goes on after so long: what it looks for is slow [s]."""

_SETTLED = 2.0
"""It begins when so many time constants of the low-pass have passed: until then that has the first
sample, in which soles may not yet carry what they will."""

_MASS_STEP, _OFFSET_STEP, _HELD_STEP = 0.002, 0.0005, 0.001
"""What is told stays as it is until it is off by so much, by the robot's mass, [m], and in a hand
by the robot's mass: who computes with it has its work with every change."""


class PayloadEstimator:
    """Mass and centre of mass by the soles' wrenches, as a slow and bounded random walk.

    With m, c, h = [p; L] the mass, the centre of mass and the centroidal momentum that the
    description says, F and N the soles' forces and their moment about c, sigma m the mass beyond
    the description's, and e m the first moment beyond it, in the axes of the torso R,

        F - (p' - m g) = sigma (p' - m g)
        N - L'         = sigma L' + m R e x (a - g)                a = p' / m

    and what hands hold beside that, which shows as they move (`HandLoads`).
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
        force: of all soles in the last state, along the world's axes, by the robot's mass [m/s^2];
            None where one measures nothing of use.

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
        self._rows, self._measured_force = list(self._memory.wrenches), self._memory.measured[:3]
        # What is told changes in these steps, and no faster than that.
        self._steps = np.array([_MASS_STEP, *[_OFFSET_STEP] * 3, *[_HELD_STEP] * hands])
        self._rates = np.array([b.mass_rate, *[b.offset_rate] * 3, *[b.held_rate] * hands])
        self._walk = np.array([b.mass_walk, *[b.offset_walk] * 3]) ** 2
        self._noise = np.repeat([b.force_noise, b.moment_noise], 3) * GRAVITY
        # What is compiled is compiled now, not in the first tick.
        measure(self._memory.address, 1.0)
        self.reset()

    def reset(self) -> None:
        """Restart with the robot as described."""
        self.payload: Payload | None = None
        self.force: Float64[np.ndarray, "3"] | None = None
        self._time, self._since = math.nan, 0.0
        self._mean = np.zeros(4)
        b = self.belief
        self._covariance = np.diag([b.likely_mass, *[b.likely_offset] * 3]) ** 2
        self._told, self._last = np.zeros(4 + len(self._hands)), np.zeros(4 + len(self._hands))
        self._hands.reset()

    @property
    def mass(self) -> float:
        """What it finds beyond the description's mass, without what hands hold [kg].

        It is told more slowly, as offset and what is held are.
        """
        return float(self._mean[0]) * self._mass

    @property
    def offset(self) -> Float64[np.ndarray, "3"]:
        """How far it finds the centre of mass to be off, along the torso's axes [m]."""
        return self._mean[1:] / (1.0 + self._mean[0])

    @property
    def held(self) -> Float64[np.ndarray, " h"]:
        """What it finds in each hand [kg]."""
        return self._hands.held * self._mass

    def update(self, state: RobotState) -> RobotState:
        """Return the state with the payload.

        Args:
            state: with the base known or estimated; one without the soles' wrenches, or with
                numbers of no use, changes nothing.
        """
        dt = state.time - self._time
        goes_on = 0.0 < dt <= _LONGEST
        gain = -math.expm1(-dt / self.belief.smoothing) if goes_on else 1.0
        if dt == 0.0 or not self._measure(state, gain):
            # Nothing new: what has been smoothed goes on where the next one comes soon.
            return self._with_payload(state)
        self._time = state.time
        if not goes_on:
            self._since = -_SETTLED * self.belief.smoothing
            self._hands.restart()
        else:
            self._since += dt
            if self._since >= _PERIOD:
                self._correct(self._since)
                self._tell(self._since)
                self._since = 0.0
        return self._with_payload(state)

    def _with_payload(self, state: RobotState) -> RobotState:
        if state.payload is self.payload:
            return state
        return RobotState(
            state.q, state.v, state.contacts, state.time, state.readings, self.payload
        )

    def _measure(self, state: RobotState, gain: float) -> bool:
        """Smooth what soles and hands do; False where there is nothing, or numbers of no use."""
        self.force = None
        if state.q.shape != self._shapes[0] or state.v.shape != self._shapes[1]:
            return False
        for row, name in zip(self._rows, self._soles, strict=True):
            wrench = state.wrench(name)
            if wrench is None:
                return False
            row[:] = wrench
        pin.computeCentroidalMomentum(self._model, self._data, state.q, state.v)
        if not measure(self._memory.address, gain):
            return False
        self.force = self._measured_force
        return True

    def _correct(self, dt: float) -> None:
        """One step of the filter, all by the robot's mass."""
        b, measured, low = self.belief, self._memory.measured, self._memory.low
        rate = (measured[6:12] - low[6:12]) / b.smoothing
        self._covariance.flat[::5] += self._walk * dt
        if low[2] < b.least_load * GRAVITY:
            self._hands.restart()
            return
        if max(map(abs, rate[:3].tolist())) > b.shock:
            return
        torso = pin.updateFramePlacement(self._model, self._data, self._torso)
        reaction = rate[:3] - _GRAVITY
        H = np.zeros((6, 4))
        H[:3, 0], H[3:, 0] = reaction, rate[3:]
        H[3:, 1:] = hat(-reaction).dot(torso.rotation)
        left = np.concatenate((low[:3] - reaction, low[3:6] - rate[3:]))
        if len(self._hands):
            left -= self._held(left, rate, torso, dt)
        left -= H.dot(self._mean)
        pushed = math.hypot(float(left[0]), float(left[1])) / (b.push * GRAVITY)
        noise = self._noise * (1.0 + pushed**2)
        HP = H.dot(self._covariance)
        spread = HP.dot(H.T)
        spread.flat[::7] += noise**2 / dt
        gain = np.linalg.solve(spread, HP).T
        covariance = self._covariance - gain.dot(HP)
        self._covariance = 0.5 * (covariance + covariance.T)
        mass, *offset = (self._mean + gain.dot(left)).tolist()
        offset = (min(max(x, -b.offset_max), b.offset_max) for x in offset)
        self._mean[:] = (min(max(mass, -b.lost_mass), b.added_mass), *offset)

    def _held(
        self,
        left: Float64[np.ndarray, "6"],
        rate: Float64[np.ndarray, "6"],
        torso: pin.SE3,
        dt: float,
    ) -> Float64[np.ndarray, "6"]:
        """Force and moment of what hands hold; what is found to be theirs the body gives up.

        Of the body its accelerations are taken away before, but not its weight: the offset that is
        found follows what hands do, late, and would take from them what is theirs.
        """
        columns = self._hands.columns(self._memory.measured[SOLES:], self._memory.low[SOLES:])
        more, offset = float(self._mean[0]), torso.rotation.dot(self._mean[1:])
        changing = left - more * rate
        changing[3:] -= hat(offset).dot(rate[:3])
        self._mean -= self._hands.correct(changing, columns, self._data, torso, dt)
        return columns.dot(self._hands.held)

    def _tell(self, dt: float) -> None:
        """What is told follows what is found, no faster than it may, and in steps worth telling."""
        told, most = self._told, self._rates * dt
        found = np.concatenate((self._mean[:1], self.offset, self._hands.held))
        told += np.minimum(np.maximum(found - told, -most), most)
        if (np.abs(told - self._last) > self._steps).any():
            self._last = told.copy()
            mass, held = float(told[0]) * self._mass, told[4:] * self._mass
            self.payload = Payload(mass, told[1:4], held)
