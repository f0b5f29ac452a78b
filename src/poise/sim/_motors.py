"""`Motors`: the drives of all joints, between physics steps."""

import math
import re
from typing import Protocol, runtime_checkable

import mujoco
import numpy as np
from jaxtyping import Bool, Float64

from poise._compiled import say_if_slow
from poise.dynamics import RobotState
from poise.errors import ConfigurationError, UnknownNameError
from poise.robots import Robot
from poise.sim._config import PlantConfig
from poise.sim._motor_config import PERIOD, Motor, MotorConfig
from poise.sim._motor_loops import DriveLoops, DriveState, Joints, Square, advance, respond


@runtime_checkable
class SetPoints(Protocol):
    """Set-points of the drives' loops: tau + kp (q - q_measured) + kd (dq - dq_measured)."""

    @property
    def q(self) -> Joints: ...
    @property
    def dq(self) -> Joints: ...
    @property
    def kp(self) -> Joints: ...
    @property
    def kd(self) -> Joints: ...
    @property
    def tau(self) -> Joints: ...


class Motors:
    """The drives of a robot in MuJoCo.

    With the motors' angles and speeds at their outputs, w = R dq, their torques t_c by currents,
    which follow those of the loops within limits, and tau = R^T t,

        t = t_c + ripple sin(wave angle) - damping w - Coulomb friction
        dw/dt = R a_0 + G (t - t_0),    G = R C R^T

    Here t_0 and a_0 are torques and accelerations of the last physics step, and C is what the
    joints' accelerations change by with their torques, (M + J^T D J)^-1 with the Jacobian J and
    inverse regularisation D of MuJoCo's constraints: the response of the physics itself, while
    the same contacts hold. Friction is found by Gauss-Seidel sweeps of impulses within
    +-friction, one a period, from the impulses of the last. The physics gets the mean of R^T t.
    """

    def __init__(self, robot: Robot, config: PlantConfig, model: mujoco.MjModel, seed: int) -> None:
        motors = config.motors
        assert motors is not None
        self._config, self._model, self._seed = motors, model, seed
        self._ticks = config.drive_ticks
        joints = [model.joint(name).id for name in robot.joint_names]
        self._at_q = model.jnt_qposadr[joints]
        self._at_v = np.array(model.jnt_dofadr[joints], dtype=np.int64)
        self._drives, self._rates = _make_drives(robot, motors)
        self._follow = _share(config.torque_bandwidth), _share(motors.velocity_bandwidth)
        self._inertia = np.empty((model.nv, model.nv))
        self._columns = np.empty((robot.nj, model.nv))
        self._set_points = np.zeros((5, robot.nj))
        self._state = DriveState(*np.zeros((len(DriveState._fields), robot.nj)))
        self._mean, self._free = np.zeros((2, robot.nj))
        self._response = np.eye(robot.nj)
        say_if_slow(advance, "the loops of motors")
        self._run(1)  # what is compiled is compiled now

    def reset(self, data: mujoco.MjData, load: Joints) -> None:
        """Stand in the state of the data, under torques that were commanded long ago."""
        self._random = np.random.default_rng((self._seed, 3))
        self._now, self._pending = 0, list[tuple[int, Float64[np.ndarray, "5 nj"]]]()
        self._set_points = np.zeros((5, len(load)))
        self._set_points[4] = load
        state = self._state
        for values in state:
            values[:] = 0.0
        state.torque[:] = np.linalg.solve(self._rates.T, load)
        self._mean = state.torque.copy()
        state.angle[:] = self._rates @ data.qpos[self._at_q]
        self._look(data)
        state.counted[:] = _counted(state.angle, self._drives.notch)
        state.measured[:] = state.speed

    def send(self, set_points: Float64[np.ndarray, "5 nj"]) -> None:
        """Send q, dq, kp, kd and tau now; a command that a later one overtakes is lost."""
        late = self._config.latency + self._config.jitter * self._random.random()
        # To the next period, but not for the rounding of decimal fractions.
        self._pending.append((self._now + math.ceil(late / PERIOD - 1e-6), set_points))

    def torque(self, data: mujoco.MjData) -> Joints:
        """Run the loops through the next physics step; return the joints' mean torques."""
        self._look(data)
        end = self._now + self._ticks
        while self._now < end:
            arrived = [k for k, (at, _) in enumerate(self._pending) if at <= self._now]
            if arrived:
                self._set_points = self._pending[arrived[-1]][1]
                del self._pending[: arrived[-1] + 1]
            stop = min([end, *(at for at, _ in self._pending)])
            self._run(stop - self._now)
            self._now = stop
        self._mean = self._state.given / self._ticks
        return self._rates.T @ self._mean

    @property
    def saturated(self) -> Bool[np.ndarray, " nj"]:
        """Motors that were at their limit in the last physics step."""
        return self._state.limited > 0.0

    def measure(self, state: RobotState) -> None:
        """Write the drives' measurements of the joints into a state."""
        count, drives = len(self._mean), self._drives
        for values, own in (
            (state.q, self._state.counted),
            (state.v, self._state.measured),
        ):
            values[-count:] = drives.inverse[0] * own + drives.inverse[1] * own[drives.mate]
        if state.readings is not None:
            state.readings.torque[:] = self._rates.T @ self._state.torque

    def _run(self, ticks: int) -> None:
        dynamics = self._free, self._response
        advance(self._drives, self._state, self._set_points, dynamics, self._follow, ticks)

    def _look(self, data: mujoco.MjData) -> None:
        """Take over angles, speeds and the response of the physics."""
        rates, state = self._rates, self._state
        state.slip[:] = (rates @ data.qpos[self._at_q] - state.angle) / self._ticks
        state.speed[:] = rates @ data.qvel[self._at_v]
        state.given[:] = state.limited[:] = 0.0
        mujoco.mj_fullM(self._model, data, self._inertia)
        respond(
            self._inertia,
            (_jacobian(self._model, data), data.efc_D, data.efc_state),
            (self._at_v, self._drives.mate, self._rates),
            self._columns,
            self._response,
        )
        self._free[:] = rates @ data.qacc[self._at_v] - self._response @ self._mean


def _jacobian(model: mujoco.MjModel, data: mujoco.MjData) -> Float64[np.ndarray, "nefc nv"]:
    jacobian = np.zeros((data.nefc, model.nv))
    if mujoco.mj_isSparse(model):
        pattern = data.efc_J_rownnz, data.efc_J_rowadr, data.efc_J_colind
        mujoco.mju_sparse2dense(jacobian, data.efc_J, *pattern)
    else:
        jacobian[:] = data.efc_J.reshape(jacobian.shape)
    return jacobian


def _share(bandwidth: float | None) -> float:
    """Part of a difference that a first-order low-pass filter makes up in a period."""
    return 1.0 if bandwidth is None else -math.expm1(-math.tau * bandwidth * PERIOD)


def _counted(angle: Joints, notch: Joints) -> Joints:
    steps = np.where(notch > 0.0, notch, 1.0)
    return np.where(notch > 0.0, steps * np.rint(angle / steps), angle)


def _make_drives(robot: Robot, config: MotorConfig) -> tuple[DriveLoops, Square]:
    """Constants of the motors, and the matrix R of their turns in those of the joints."""
    kinds = [_kind_of(name, config.motors) for name in robot.joint_names]
    mate, rates = np.arange(robot.nj), np.eye(robot.nj)
    for linkage in config.linkages:
        for name in linkage.joints:
            if name not in robot.joint_names:
                raise UnknownNameError("joint of a linkage", got=name, choices=robot.joint_names)
        pair = [robot.joint_names.index(name) for name in linkage.joints]
        if (mate[pair] != pair).any():
            raise ConfigurationError("a joint is part of two linkages", got=linkage.joints)
        mate[pair], rates[np.ix_(pair, pair)] = pair[::-1], linkage.rates
    inverse, own = np.linalg.inv(rates), np.arange(robot.nj)
    across = np.where(mate == own, 0.0, inverse[own, mate])
    limits = zip(kinds, robot.tau_max.tolist(), strict=True)
    drives = DriveLoops(
        mate=mate,
        inverse=np.array([inverse[own, own], across]),
        limit=np.array([most if kind.limit is None else kind.limit for kind, most in limits]),
        friction=np.array([kind.friction for kind in kinds]),
        damping=np.array([kind.damping for kind in kinds]),
        ripple=np.array([kind.ripple for kind in kinds]),
        wave=np.array([kind.cycles * kind.gear for kind in kinds]),
        notch=np.array([kind.resolution / kind.gear for kind in kinds]),
    )
    return drives, rates


def _kind_of(joint: str, motors: tuple[Motor, ...]) -> Motor:
    for motor in motors:
        if re.fullmatch(motor.joints, joint):
            return motor
    raise UnknownNameError("no motor drives a joint", got=joint, choices=[m.joints for m in motors])
