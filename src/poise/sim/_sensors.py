"""Measurements made of the true state; the inertial unit's true readings."""

import math
from collections import deque
from collections.abc import Iterable
from typing import NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float64

from poise.dynamics import RobotState, SensorReadings
from poise.robots import GRAVITY
from poise.sim._config import SensorConfig


class InertialUnit:
    """An ideal unit at the base's origin: angular velocity, mean specific force since last read.

    Units integrate at many kHz inside and give increments of velocity, so an impact between two
    readings is in the later one.
    """

    def __init__(self) -> None:
        self._velocity, self._turn = np.zeros(3), np.zeros(4)
        self.reset()

    def reset(self) -> None:
        """Forget the motion so far."""
        self._time = math.nan

    def read(
        self, qpos: Float64[np.ndarray, " nq"], qvel: Float64[np.ndarray, " nv"], time: float
    ) -> tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3"]]:
        """Angular velocity [rad/s] and specific force [m/s^2] in the base's frame."""
        spin, force, turn = qvel[3:6].copy(), np.array([0.0, 0.0, GRAVITY]), self._turn
        turn[:] = qpos[3:7]
        elapsed = time - self._time
        if elapsed > 0.0:
            force += (qvel[:3] - self._velocity) / elapsed
            # Along the axes that the base had in the middle of the time that has passed.
            mujoco.mju_quatIntegrate(turn, spin, -0.5 * elapsed)
        self._time = time
        self._velocity[:] = qvel[:3]
        mujoco.mju_negQuat(turn, turn)
        specific_force = np.empty(3)
        mujoco.mju_rotVecQuat(specific_force, force, turn)
        return spin, specific_force


class _Errors(NamedTuple):
    """Constant errors of joints [rad] and soles [N, N m]."""

    joints: Float64[np.ndarray, " nj"]
    soles: dict[str, Float64[np.ndarray, "6"]]


class Sensors:
    """Turns one true state a control period into one measurement, with memory for the delay.

    Random numbers are drawn once a period in a fixed order: a run depends on its seed alone.
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
        # A generator apart: the state does not depend on what only an estimator reads.
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
        """From a generator apart: what else is drawn does not depend on them."""
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
