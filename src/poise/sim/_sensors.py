"""Sensors: from the true state to what a controller is told."""

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import Annotated, NamedTuple

import numpy as np
from jaxtyping import Float64

from poise._schema import Bounds, Seconds, Vector, checked
from poise.dynamics import RobotState, SensorReadings

Deviation = Annotated[float, Bounds(least=0.0, most=1e6)]
"""A standard deviation or a resolution, in the unit of what is measured."""

_MAX_TILT = 0.5
"""A unit that is mounted more askew is in its description [rad]."""


@checked()
@dataclass(frozen=True, kw_only=True)
class SensorConfig:
    """Resolution, noise and delay of the measurements; all zero means the true state.

    Noise is white and normal; each value is its standard deviation. A bias is drawn from a normal
    distribution, once a run.

    Attributes:
        encoder_resolution: smallest step of the joint encoders [rad].
        joint_position_noise: noise of the joint positions, before quantisation [rad].
        joint_position_bias: constant error of the joint positions, as of joints that were zeroed
            badly, drawn once a joint with this deviation [rad].
        joint_velocity_noise: noise of the joint velocities [rad/s].
        base_position_noise: noise of the base position [m].
        base_orientation_noise: noise of the base orientation, as a rotation vector [rad].
        base_orientation_error: constant error of the base orientation, as a rotation about the
            base's own x and y axes, which a unit mounted askew has [rad].
        base_velocity_noise: noise of the base linear velocity [m/s].
        gyro_noise: noise of the base angular velocity [rad/s].
        force_noise: noise of the sole forces [N].
        force_bias: constant error of the sole forces, drawn once a sole and axis with this
            deviation [N].
        moment_noise: noise of the sole moments [N m].
        moment_bias: constant error of the sole moments, drawn likewise [N m].
        accelerometer_noise: noise of the specific force that an estimator reads [m/s^2].
        accelerometer_bias: its constant error, drawn likewise once an axis [m/s^2].
        gyro_bias: constant error of the angular velocity that an estimator reads, drawn likewise;
            `v` is without it, as a unit that knows its own bias gives it [rad/s].
        torque_noise: noise of the motors' torques that an estimator reads [N m].
        delay: age of everything measured [s], a multiple of the control period.
    """

    encoder_resolution: Deviation = 0.0
    joint_position_noise: Deviation = 0.0
    joint_position_bias: Deviation = 0.0
    joint_velocity_noise: Deviation = 0.0
    base_position_noise: Deviation = 0.0
    base_orientation_noise: Deviation = 0.0
    base_orientation_error: Annotated[tuple[float, float], Vector(2, Bounds(most=_MAX_TILT))] = (
        0.0,
        0.0,
    )
    base_velocity_noise: Deviation = 0.0
    gyro_noise: Deviation = 0.0
    force_noise: Deviation = 0.0
    force_bias: Deviation = 0.0
    moment_noise: Deviation = 0.0
    moment_bias: Deviation = 0.0
    accelerometer_noise: Deviation = 0.0
    accelerometer_bias: Deviation = 0.0
    gyro_bias: Deviation = 0.0
    torque_noise: Deviation = 0.0
    delay: Seconds = 0.0

    @classmethod
    def typical(cls) -> "SensorConfig":
        """Encoders of 17 bits, an inertial unit and load cells as one buys them."""
        return cls(
            encoder_resolution=2.0 * math.pi / 2**17,
            joint_velocity_noise=0.01,
            base_orientation_noise=1e-3,
            gyro_noise=5e-3,
            force_noise=2.0,
            moment_noise=0.3,
            accelerometer_noise=0.05,
            accelerometer_bias=0.03,
            gyro_bias=2e-3,
        )

    @property
    def ideal(self) -> bool:
        """Whether the measured state is the true one."""
        return all(not np.any(getattr(self, f.name)) for f in fields(self))


class _Errors(NamedTuple):
    """What joints [rad] and soles [N, N m] are off by all the time."""

    joints: Float64[np.ndarray, " nj"]
    soles: dict[str, Float64[np.ndarray, "6"]]


class Sensors:
    """Turns one true state a control period into one measurement, with memory for the delay.

    The random numbers are drawn once a period in a fixed order, so a run depends on its seed and
    not on how often anybody looks.
    """

    def __init__(
        self, config: SensorConfig, *, base_dofs: int, delay_ticks: int, seed: int
    ) -> None:
        self._config = config
        self._floating = base_dofs == 6
        self._seed = seed
        self._wrench_noise = np.repeat([config.force_noise, config.moment_noise], 3)
        self._wrench_bias = np.repeat([config.force_bias, config.moment_bias], 3)
        self._buffer: deque[RobotState] = deque(maxlen=delay_ticks + 1)
        self._restart()

    def reset(self, state: RobotState) -> RobotState:
        """Forget the past, restart the noise from its seed, and measure."""
        self._restart()
        self._buffer.clear()
        return self.measure(state)

    def _restart(self) -> None:
        self._rng = np.random.default_rng(self._seed)
        # Numbers of their own: what a controller is told does not depend on what only an
        # estimator reads.
        self._unit_rng = np.random.default_rng((self._seed, 1))
        self._gyro_bias = self._config.gyro_bias * self._unit_rng.standard_normal(3)
        self._specific_force_bias = (
            self._config.accelerometer_bias * self._unit_rng.standard_normal(3)
        )
        # Drawn when the first state says how many joints and which soles there are.
        self._errors: _Errors | None = None

    def measure(self, state: RobotState) -> RobotState:
        """Measure the true state of this control period."""
        self._buffer.append(self._corrupt(state))
        return self._buffer[0]

    def _corrupt(self, state: RobotState) -> RobotState:
        c, rng = self._config, self._rng
        q, v = state.q.copy(), state.v.copy()
        if self._floating:
            q[:3] += c.base_position_noise * rng.standard_normal(3)
            turn = c.base_orientation_noise * rng.standard_normal(3)
            turn[:2] += c.base_orientation_error
            q[3:7] = _perturb(q[3:7], turn)
            v[:3] += c.base_velocity_noise * rng.standard_normal(3)
            v[3:6] += c.gyro_noise * rng.standard_normal(3)
        joints_q, joints_v = q[7 * self._floating :], v[6 * self._floating :]
        if self._errors is None:
            self._errors = self._draw_errors(joints_q.size, state.contacts)
        joints_q += self._errors.joints
        joints_q += c.joint_position_noise * rng.standard_normal(joints_q.size)
        joints_v += c.joint_velocity_noise * rng.standard_normal(joints_v.size)
        if c.encoder_resolution > 0.0:
            joints_q[:] = c.encoder_resolution * np.rint(joints_q / c.encoder_resolution)
        contacts = {
            n: w + self._errors.soles[n] + self._wrench_noise * rng.standard_normal(6)
            for n, w in state.contacts.items()
        }
        readings = None if state.readings is None else self._corrupt_readings(state.readings, v)
        return RobotState(q=q, v=v, contacts=contacts, time=state.time, readings=readings)

    def _draw_errors(self, joints: int, soles: Iterable[str]) -> _Errors:
        """From numbers of their own: what else is drawn does not depend on them."""
        c, rng = self._config, np.random.default_rng((self._seed, 2))
        return _Errors(
            c.joint_position_bias * rng.standard_normal(joints),
            {sole: self._wrench_bias * rng.standard_normal(6) for sole in soles},
        )

    def _corrupt_readings(
        self, true: SensorReadings, v: Float64[np.ndarray, " nv"]
    ) -> SensorReadings:
        """One gyro has one noise: that of the angular velocity in `v`."""
        c, rng = self._config, self._unit_rng
        force = true.specific_force + self._specific_force_bias
        return SensorReadings(
            v[3:6] + self._gyro_bias,
            force + c.accelerometer_noise * rng.standard_normal(3),
            true.torque + c.torque_noise * rng.standard_normal(true.torque.size),
        )


def _perturb(
    quaternion: Float64[np.ndarray, "4"], rotation_vector: Float64[np.ndarray, "3"]
) -> Float64[np.ndarray, "4"]:
    """Quaternion (x, y, z, w) times the exponential of a small rotation vector [rad], body side."""
    # A few numbers are several times as quick as such than as arrays.
    angle = math.sqrt(rotation_vector.dot(rotation_vector))
    if angle == 0.0:
        return quaternion
    w = math.cos(0.5 * angle)
    a, b, c = (math.sin(0.5 * angle) / angle * rotation_vector).tolist()
    x, y, z, qw = quaternion.tolist()
    out = np.array(
        (
            qw * a + w * x + (y * c - z * b),
            qw * b + w * y + (z * a - x * c),
            qw * c + w * z + (x * b - y * a),
            qw * w - (x * a + y * b + z * c),
        )
    )
    return out / math.sqrt(out.dot(out))
