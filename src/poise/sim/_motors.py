"""`Motors`: the drives of all joints, between physics steps."""

import math
import re
from typing import NamedTuple, Protocol, runtime_checkable

import mujoco
import numpy as np
from jaxtyping import Bool, Float64, Int32, Int64

from poise._compiled import compiled, factor_leading, solve_lower
from poise.dynamics import RobotState
from poise.errors import ConfigurationError, UnknownNameError
from poise.robots import Robot
from poise.sim._config import PlantConfig
from poise.sim._motor_config import PERIOD, Motor, MotorConfig

Joints = Float64[np.ndarray, " nj"]
Square = Float64[np.ndarray, "nj nj"]

# Kinds of constraints whose forces answer to accelerations
_QUADRATIC = int(mujoco.mjtConstraintState.mjCNSTRSTATE_QUADRATIC)
_CONE = int(mujoco.mjtConstraintState.mjCNSTRSTATE_CONE)


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


class _Drives(NamedTuple):
    """Constants of the motors; motor i is on joint i and, by a linkage, on joint `mate[i]`."""

    mate: Int64[np.ndarray, " nj"]  # itself without a linkage
    inverse: Float64[np.ndarray, "2 nj"]  # R^-1: turns of joint i with motor i, with `mate[i]`
    limit: Joints
    friction: Joints
    damping: Joints
    ripple: Joints
    wave: Joints  # phase of the ripple over the angle of the output
    count: Joints  # step of the encoder at the output [rad]


class _State(NamedTuple):
    """State of the motors, at their outputs."""

    angle: Joints
    slip: Joints  # in each period, towards the angles of the physics
    speed: Joints
    counted: Joints  # angle by the encoder
    measured: Joints  # speed by the drive
    torque: Joints  # of the currents
    impulse: Joints  # of the Coulomb friction in a period [N m s]
    given: Joints  # sum of the torques with ripple and friction since the physics step began
    limited: Joints  # one where a torque was at its limit since then
    total: Joints  # torque in a period, without Coulomb friction
    asked: Joints  # torques that the loops of the joints ask for


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
        self._at_q, self._at_v = model.jnt_qposadr[joints], model.jnt_dofadr[joints]
        self._drives, self._rates = _make_drives(robot, motors)
        self._follow = _share(config.torque_bandwidth), _share(motors.velocity_bandwidth)
        self._inertia = np.empty((model.nv, model.nv))
        self._columns = np.empty((robot.nj, model.nv))
        self._set_points = np.zeros((5, robot.nj))
        self._state = _State(*np.zeros((len(_State._fields), robot.nj)))
        self._mean, self._free = np.zeros((2, robot.nj))
        self._response = np.eye(robot.nj)
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
        state.counted[:] = _counted(state.angle, self._drives.count)
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
        _advance(self._drives, self._state, self._set_points, dynamics, self._follow, ticks)

    def _look(self, data: mujoco.MjData) -> None:
        """Take over angles, speeds and the response of the physics."""
        rates, state = self._rates, self._state
        state.slip[:] = (rates @ data.qpos[self._at_q] - state.angle) / self._ticks
        state.speed[:] = rates @ data.qvel[self._at_v]
        state.given[:] = state.limited[:] = 0.0
        mujoco.mj_fullM(self._model, data, self._inertia)
        _respond(
            self._inertia,
            (_jacobian(self._model, data), data.efc_D, data.efc_state),
            (self._at_v, self._drives.mate, self._rates),
            self._columns,
            self._response,
        )
        self._free[:] = rates @ data.qacc[self._at_v] - self._response @ self._mean


@compiled
def _advance(
    drives: _Drives,
    state: _State,
    set_points: Float64[np.ndarray, "5 nj"],
    dynamics: tuple[Joints, Square],
    follow: tuple[float, float],
    ticks: int,
) -> None:
    """Run all loops for some periods."""
    (free, response), (follow_torque, follow_speed) = dynamics, follow
    q, dq, kp, kd, tau = set_points
    mate, inverse, n = drives.mate, drives.inverse, len(drives.limit)
    for _ in range(ticks):
        for j in range(n):
            own, other = inverse[0, j], inverse[1, j]
            angle = own * state.counted[j] + other * state.counted[mate[j]]
            speed = own * state.measured[j] + other * state.measured[mate[j]]
            state.asked[j] = tau[j] + kp[j] * (q[j] - angle) + kd[j] * (dq[j] - speed)
        for i in range(n):
            limit, k = drives.limit[i], mate[i]
            asked = inverse[0, i] * state.asked[i] + inverse[1, k] * state.asked[k]
            if abs(asked) >= limit:
                state.limited[i] = 1.0
            asked = min(max(asked, -limit), limit)
            state.torque[i] += follow_torque * (asked - state.torque[i])
            ripple = drives.ripple[i] * math.sin(drives.wave[i] * state.angle[i])
            state.total[i] = state.torque[i] + ripple - drives.damping[i] * state.speed[i]
            state.given[i] += state.total[i]
        for i in range(n):
            change = PERIOD * free[i]
            for k in range(n):
                change += response[i, k] * (PERIOD * state.total[k] + state.impulse[k])
            state.asked[i] = change
        for i in range(n):
            state.speed[i] += state.asked[i]
        for i in range(n):
            most = PERIOD * drives.friction[i]
            impulse = state.impulse[i] - state.speed[i] / response[i, i]
            impulse = min(max(impulse, -most), most)
            change = impulse - state.impulse[i]
            state.impulse[i] = impulse
            if change != 0.0:
                for k in range(n):
                    state.speed[k] += response[k, i] * change
        for i in range(n):
            state.given[i] += state.impulse[i] / PERIOD
            state.angle[i] += PERIOD * state.speed[i] + state.slip[i]
            counted = state.angle[i]
            if drives.count[i] > 0.0:
                counted = drives.count[i] * round(counted / drives.count[i])
            rate = (counted - state.counted[i]) / PERIOD
            state.measured[i] += follow_speed * (rate - state.measured[i])
            state.counted[i] = counted


@compiled
def _respond(
    hessian: Float64[np.ndarray, "nv nv"],
    constraints: tuple[
        Float64[np.ndarray, "nefc nv"], Float64[np.ndarray, " nefc"], Int32[np.ndarray, " nefc"]
    ],
    transmission: tuple[Int64[np.ndarray, " nj"], Int64[np.ndarray, " nj"], Square],
    columns: Float64[np.ndarray, "nj nv"],
    response: Square,
) -> None:
    """Fill in R C R^T, of the inertia in `hessian` and the constraints."""
    (jacobian, stiffness, kinds), (at_v, mate, rates) = constraints, transmission
    nv, n = len(hessian), len(mate)
    for row in range(len(kinds)):
        if kinds[row] not in (_QUADRATIC, _CONE):
            continue
        for i in range(nv):
            scaled = stiffness[row] * jacobian[row, i]
            if scaled != 0.0:
                for j in range(i + 1):
                    hessian[i, j] += scaled * jacobian[row, j]
    factor_leading(hessian, nv)
    for i in range(n):
        column = columns[i]
        column[:] = 0.0
        column[at_v[i]], column[at_v[mate[i]]] = rates[i, i], rates[i, mate[i]]
        solve_lower(hessian, 0, nv, column)
        for k in range(i + 1):
            total = 0.0
            for j in range(nv):
                total += column[j] * columns[k, j]
            response[i, k] = response[k, i] = total


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


def _counted(angle: Joints, count: Joints) -> Joints:
    steps = np.where(count > 0.0, count, 1.0)
    return np.where(count > 0.0, steps * np.rint(angle / steps), angle)


def _make_drives(robot: Robot, config: MotorConfig) -> tuple[_Drives, Square]:
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
    drives = _Drives(
        mate=mate,
        inverse=np.array([inverse[own, own], across]),
        limit=np.array([most if kind.limit is None else kind.limit for kind, most in limits]),
        friction=np.array([kind.friction for kind in kinds]),
        damping=np.array([kind.damping for kind in kinds]),
        ripple=np.array([kind.ripple for kind in kinds]),
        wave=np.array([kind.cycles * kind.gear for kind in kinds]),
        count=np.array([kind.resolution / kind.gear for kind in kinds]),
    )
    return drives, rates


def _kind_of(joint: str, motors: tuple[Motor, ...]) -> Motor:
    for motor in motors:
        if re.fullmatch(motor.joints, joint):
            return motor
    raise UnknownNameError("no motor drives a joint", got=joint, choices=[m.joints for m in motors])
