"""Measurements from the true state; the inertial unit's true readings."""

import math
from collections import deque

import mujoco
import numpy as np
from jaxtyping import Float64

from poise.dynamics import RobotState, SensorReadings
from poise.robots import GRAVITY
from poise.sim._config import SensorConfig


class InertialUnit:
    """An ideal unit at the base's origin: angular velocity, mean specific force since last read."""

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
            # A mean: units integrate inside, so an impact between two readings is in the later one.
            force += (qvel[:3] - self._velocity) / elapsed
            # Along the axes that the base had in the middle of the time that has passed.
            mujoco.mju_quatIntegrate(turn, spin, -0.5 * elapsed)
        self._time = time
        self._velocity[:] = qvel[:3]
        mujoco.mju_negQuat(turn, turn)
        specific_force = np.empty(3)
        mujoco.mju_rotVecQuat(specific_force, force, turn)
        return spin, specific_force


class Sensors:
    """Measures a true state each control period; random numbers depend on the seed alone."""

    def __init__(
        self, config: SensorConfig, *, base_dofs: int, delay_ticks: int, seed: int
    ) -> None:
        self._config, self._seed, self._floating = config, seed, base_dofs == 6
        self._turn = np.empty(4)
        self._buffer: deque[RobotState] = deque(maxlen=delay_ticks + 1)

    def reset(self, state: RobotState) -> RobotState:
        """Forget the past, restart the noise from its seed, and measure."""
        c, joints = self._config, state.v[6 * self._floating :].size
        # Three generators: the state does not depend on what only an estimator reads, nor the
        # noise on the constant errors.
        self._rng, self._unit_rng, errors = (
            np.random.default_rng(seed) for seed in (self._seed, (self._seed, 1), (self._seed, 2))
        )
        base = c.base_position_noise, c.base_orientation_noise, c.base_velocity_noise, c.gyro_noise
        self._deviations = np.repeat(
            [*base, c.joint_position_noise, c.joint_velocity_noise]
            + [c.force_noise, c.moment_noise] * len(state.contacts),
            [3 * self._floating] * 4 + [joints] * 2 + [3, 3] * len(state.contacts),
        )
        self._unit_deviations = np.repeat([c.accelerometer_noise, c.torque_noise], [3, joints])
        self._gyro_bias = c.gyro_bias * self._unit_rng.standard_normal(3)
        self._force_bias = c.accelerometer_bias * self._unit_rng.standard_normal(3)
        self._joint_bias = c.joint_position_bias * errors.standard_normal(joints)
        wrench_bias = np.repeat([c.force_bias, c.moment_bias], 3)
        self._sole_bias = {n: wrench_bias * errors.standard_normal(6) for n in state.contacts}
        self._buffer.clear()
        return self.measure(state)

    def measure(self, state: RobotState) -> RobotState:
        """Measure the true state of this control period."""
        self._buffer.append(self._corrupt(state))
        return self._buffer[0]

    def _corrupt(self, state: RobotState) -> RobotState:
        noise = self._deviations * self._rng.standard_normal(self._deviations.size)
        q, v = state.q.copy(), state.v.copy()
        at = 12 * self._floating
        if self._floating:
            q[:3] += noise[:3]
            turn = noise[3:6]
            turn[:2] += self._config.base_orientation_error
            if turn.any():
                self._turn[:] = q[[6, 3, 4, 5]]
                mujoco.mju_quatIntegrate(self._turn, turn, 1.0)
                q[3:7] = self._turn[[1, 2, 3, 0]]
            v[:6] += noise[6:12]
        joints_q, joints_v = q[7 * self._floating :], v[6 * self._floating :]
        joints_q += self._joint_bias
        joints_q += noise[at : (at := at + joints_q.size)]
        joints_v += noise[at : (at := at + joints_v.size)]
        resolution = self._config.encoder_resolution
        if resolution > 0.0:
            joints_q[:] = resolution * np.rint(joints_q / resolution)
        contacts = {
            n: w + self._sole_bias[n] + noise[at : (at := at + 6)]
            for n, w in state.contacts.items()
        }
        readings = None if state.readings is None else self._corrupt_readings(state.readings, v)
        return RobotState(q, v, contacts, state.time, readings)

    def _corrupt_readings(
        self, true: SensorReadings, v: Float64[np.ndarray, " nv"]
    ) -> SensorReadings:
        """One gyro has one noise: that of the angular velocity in `v`."""
        noise = self._unit_deviations * self._unit_rng.standard_normal(self._unit_deviations.size)
        force = true.specific_force + self._force_bias
        return SensorReadings(v[3:6] + self._gyro_bias, force + noise[:3], true.torque + noise[3:])
