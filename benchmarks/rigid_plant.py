"""`RigidPlant`: a robot on a fixed base, integrated from its equation of motion alone.

`Gravity`: vertical gravity, constant or swept over time. `Encoder`: what a controller is told of
joints behind gears.
"""

import math
from dataclasses import dataclass, replace
from math import isfinite, pi

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.control import Command
from poise.dynamics import RobotState
from poise.errors import ConfigurationError, PoiseError
from poise.robots import Robot

_MOST_BITS = 32
"""Beyond this a count is lost in the rounding of angles behind large gears."""


@dataclass(frozen=True, kw_only=True)
class Encoder:
    """An encoder on the motor's side of a gear."""

    bits: int = 17  # the encoder tells 2^bits angles of a revolution of the motor apart
    gear: float = 100.0  # revolutions of the motor for one of the joint

    def __post_init__(self) -> None:
        if not (isinstance(self.bits, int) and 1 <= self.bits <= _MOST_BITS):  # pyright: ignore[reportUnnecessaryIsInstance]
            raise ConfigurationError(
                "an encoder's number of bits is out of range",
                got=self.bits,
                wanted=f"a whole number from 1 to {_MOST_BITS}",
            )
        if not (isfinite(self.gear) and self.gear > 0.0):
            raise ConfigurationError(
                "an encoder's gear ratio is out of range", got=self.gear, wanted="a number > 0"
            )

    @property
    def resolution(self) -> float:
        """Smallest step of the joint's angle, 2 pi / (2^bits gear) [rad]."""
        return 2.0 * pi / (2**self.bits * self.gear)

    def read(self, q: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " n"]:
        """Joint angles as the encoder tells them: the nearest whole step [rad]."""
        return np.rint(q / self.resolution) * self.resolution


class JointSensors:
    """Joint angles and velocities as the controller gets them.

    Without an encoder both are exact. With one, the angle is quantised and the velocity is the
    backward difference of quantised angles, as in (Park, Jin, Kang 2022); the robot starts at rest.
    """

    def __init__(self, encoder: Encoder | None = None) -> None:
        self._encoder = encoder
        self._before: tuple[float, Float64[np.ndarray, " n"]] | None = None

    def read(
        self, q: Float64[np.ndarray, " n"], v: Float64[np.ndarray, " n"], time: float
    ) -> RobotState:
        """One measurement; times must grow from call to call.

        Args:
            q: true angles [rad].
            v: true velocities [rad/s].
            time: when [s].
        """
        if self._encoder is None:
            return RobotState(q.copy(), v.copy(), time=time)
        angle = self._encoder.read(q)
        velocity = np.zeros_like(angle)
        if self._before is not None:
            last_time, last = self._before
            velocity = (angle - last) / (time - last_time)
        self._before = (time, angle)
        return RobotState(angle, velocity, time=time)


EARTH = -9.81
"""Vertical gravity on Earth, as robots' models have it [m/s^2]."""

CONTROL_DT = 1e-3
"""Control period [s]."""

STEP = 1e-4
"""Step of the integration [s]."""


@dataclass(frozen=True, kw_only=True)
class Gravity:
    """Vertical gravity that goes from one value to another at a constant rate, then stays."""

    first: float = EARTH  # at time zero; negative is downwards [m/s^2]
    # At the end of the sweep; `first` when None, which is constant gravity [m/s^2]
    last: float | None = None
    duration: float = 1.0  # length of the sweep [s]

    def __post_init__(self) -> None:
        values = (self.first, self.first if self.last is None else self.last)
        if not all(math.isfinite(value) for value in values):
            raise ConfigurationError(
                "gravity is not finite", got=values, wanted="finite numbers [m/s^2]"
            )
        if not (math.isfinite(self.duration) and self.duration > 0.0):
            raise ConfigurationError(
                "the sweep of gravity has no length", got=self.duration, wanted="seconds > 0"
            )

    @property
    def constant(self) -> bool:
        """Whether it never changes."""
        return self.last is None or self.last == self.first

    def at(self, time: float) -> float:
        """Vertical gravity at a time [s]."""
        if self.last is None:
            return self.first
        share = min(max(time / self.duration, 0.0), 1.0)
        return self.first + share * (self.last - self.first)


@dataclass(frozen=True, kw_only=True, eq=False)
class Moment:
    """The true robot right after a torque was applied, before it moves on."""

    q: Float64[np.ndarray, " n"]  # joint angles [rad]
    v: Float64[np.ndarray, " n"]  # joint velocities [rad/s]
    acceleration: Float64[np.ndarray, " n"]  # joint accelerations under the torque [rad/s^2]
    torque: Float64[np.ndarray, " n"]  # [N m]
    gravity: float  # vertical gravity [m/s^2]


class RigidPlant:
    """M(q) dv + h(q, v) = torque, by the classic fourth-order Runge-Kutta method.

    There is no contact and no friction, and joints have no stops. Links may be heavier or lighter
    than the robot's model says; rotor inertias stay, because a data sheet tells them well.
    """

    def __init__(
        self,
        robot: Robot,  # it is not changed
        q: Float64[np.ndarray, " n"],  # joint angles at time zero, at rest [rad]
        *,
        gravity: Gravity | None = None,  # vertical gravity over time
        inertia_scale: float = 1.0,  # factor on mass and rotational inertia of every link
        step: float = STEP,  # of the integration [s]
        encoder: Encoder | None = None,  # of all joints; None for exact angles
    ) -> None:
        if robot.floating_base or robot.nq != robot.nv:
            raise ConfigurationError(
                "this plant takes robots on a fixed base whose joints have an angle each",
                got=robot.name,
                wanted="a robot such as arm6 or upper17",
            )
        if q.shape != (robot.nq,) or not np.all(np.isfinite(q)):
            raise ConfigurationError(
                "the plant's start is no posture of the robot",
                got=q,
                wanted=f"{robot.nq} finite joint angles [rad]",
            )
        self._gravity = gravity or Gravity()
        self._step = _checked_positive(step, "step of the plant [s]")
        scale = _checked_positive(inertia_scale, "inertia_scale of the plant")
        # The true robot: with gravity and inertias of the plant.
        self.robot = with_gravity(robot, self._gravity.at(0.0))
        model = self.robot.model
        for i in range(1, model.njoints):
            link = model.inertias[i]
            model.inertias[i] = pin.Inertia(scale * link.mass, link.lever, scale * link.inertia)
        self._data, self._sensors = model.createData(), JointSensors(encoder)
        self.moment: Moment | None = None  # when the last command was applied
        self.time, self.q, self.v = 0.0, q.copy(), np.zeros(robot.nv)

    @property
    def gravity(self) -> float:
        """Vertical gravity now [m/s^2]."""
        return self._gravity.at(self.time)

    @property
    def control_dt(self) -> float:
        """Control period [s]."""
        return CONTROL_DT

    @property
    def fallen(self) -> bool:
        """Never: it stands on no feet."""
        return False

    def state(self) -> RobotState:
        """What the sensors say; once a tick, as velocities are differences of readings."""
        return self._sensors.read(self.q, self.v, self.time)

    def true_state(self) -> RobotState:
        """What is."""
        return RobotState(self.q.copy(), self.v.copy(), time=self.time)

    def step(self, command: Command) -> None:
        """Lets one control period pass with the command's torque held."""
        torque = command.torque
        if torque is None or not command.status.ok:
            raise PoiseError(f"the controller failed at {self.time:.3f} s: {command.status}")
        self.moment = Moment(
            q=self.q,
            v=self.v,
            acceleration=self.acceleration(torque),
            torque=torque,
            gravity=self.gravity,
        )
        self.advance(torque, CONTROL_DT)

    def acceleration(self, torque: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " n"]:
        """Joint accelerations right now under torques [rad/s^2]."""
        return self._derivative(self.time, self.q, self.v, torque)

    def advance(self, torque: Float64[np.ndarray, " n"], duration: float) -> None:
        """Integrates with torques held, a whole number of steps."""
        f, h = self._derivative, self._step
        steps = round(duration / h)
        start = self.time
        for i in range(steps):
            t, q, v = start + i * h, self.q, self.v
            a1 = f(t, q, v, torque)
            v2 = v + (0.5 * h) * a1
            a2 = f(t + 0.5 * h, q + (0.5 * h) * v, v2, torque)
            v3 = v + (0.5 * h) * a2
            a3 = f(t + 0.5 * h, q + (0.5 * h) * v2, v3, torque)
            v4 = v + h * a3
            a4 = f(t + h, q + h * v3, v4, torque)
            self.q = q + (h / 6.0) * (v + 2.0 * (v2 + v3) + v4)
            self.v = v + (h / 6.0) * (a1 + 2.0 * (a2 + a3) + a4)
        self.time = start + steps * h

    def _derivative(
        self,
        time: float,
        q: Float64[np.ndarray, " n"],
        v: Float64[np.ndarray, " n"],
        torque: Float64[np.ndarray, " n"],
    ) -> Float64[np.ndarray, " n"]:
        model = self.robot.model
        if not self._gravity.constant:
            set_gravity(self.robot, self._gravity.at(time))
        # Copied: the workspace is overwritten by the next stage.
        return pin.aba(model, self._data, q, v, torque).copy()


def _checked_positive(value: float, what: str) -> float:
    if not (math.isfinite(value) and value > 0.0):
        raise ConfigurationError(f"{what} is out of range", got=value, wanted="a number > 0")
    return value


def with_gravity(robot: Robot, vertical: float) -> Robot:
    """The same robot with a model of its own, in another gravity, negative downwards."""
    own = replace(robot, model=robot.model.copy())
    set_gravity(own, vertical)
    return own


def set_gravity(robot: Robot, vertical: float) -> None:
    """Changes the gravity of a robot from `with_gravity`; never of one that others share."""
    robot.model.gravity.linear = np.array([0.0, 0.0, vertical])
