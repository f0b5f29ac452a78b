"""`StateEstimator`: base pose and velocity from proprioception."""

import math
from collections.abc import Sequence
from dataclasses import astuple

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._checks import is_array, is_time
from poise._compiled import allocate
from poise.dynamics import KINEMATICS, RobotState, frames_of, motion_of
from poise.errors import ConfigurationError
from poise.estimation._config import EstimatorConfig
from poise.estimation._filter import InvariantFilter
from poise.estimation._load_cells import LoadCellTare, LoadCellVote
from poise.estimation._memory import EstimatorMemory
from poise.estimation._payload import PayloadEstimator
from poise.estimation._tick import BAD_STATE, JUMP, SEE, STEP, TAKE, WAIT, EstimatorStatus, run
from poise.robots import GRAVITY, Robot

_STATUSES = tuple(EstimatorStatus)

_CALIBRATING = 20
"""Samples at rest whose mean is the gyro's bias."""

_JUMP_TILT, _JUMP_SPEED = 0.05, 0.5
"""Deviations of tilt [rad] and velocity [m/s] after a jump of time."""


class StateEstimator:
    """Base pose and velocity from inertial unit, encoders and contacts; an estimator of `rollout`.

    An `InvariantFilter` whose contact points are the soles' centres. Of a measured state it reads
    joints, sole wrenches, time and `readings`, never the base. The first state starts it, at rest,
    with position and yaw as in `q_start` and the soles on the ground; `start` does that better from
    a second of standing still. Absolute position and yaw are dead reckoning.

    Wrenches that no load cell measures, or a faulty one, are estimated from joint torques by
    `LoadCellVote`; where these are not measured either, all soles count as in contact until they
    move. Nothing raises on numbers; `status` is the quality of the last estimate.

    Args:
        robot: with a floating base and soles.
        config: beliefs about the sensors.
        q_start: start of the robot, of which position and yaw count; its home by default.
        payload: estimator of the payload in the returned state; none by default.

    Attributes:
        filter: the filter.
        tare: zeros of the soles' load cells, once they have been in the air.
        vote: of load cells against joint torques.
        status: of the last update.

    Raises:
        ConfigurationError: the robot has no floating base or no sole, or the unit is not on the
            base link.
        UnknownNameError: no such frame.
    """

    def __init__(
        self,
        robot: Robot,
        config: EstimatorConfig | None = None,
        *,
        q_start: Float64[np.ndarray, " nq"] | None = None,
        payload: PayloadEstimator | None = None,
    ) -> None:
        self.config = config = config if config is not None else EstimatorConfig()
        self._robot, self._names, self.payload = robot, tuple(robot.soles), payload
        self._base_R_unit, self._base_p_unit = _mounting(robot, config.imu)
        self._q_start = np.array(robot.q_home if q_start is None else q_start)
        self._model, self._data = robot.model, robot.model.createData()
        self.vote = LoadCellVote(robot, longest=config.longest_step)
        self.tare = LoadCellTare(self._names, robot.weight, longest=config.longest_step)
        self.filter = InvariantFilter(len(self._names), config.noise)
        m = self._memory = self._allocate()
        self._joints, self._speeds, self._wrenches = m.q[7:], m.v[6:], list(m.wrenches)
        self.reset()
        # Compiled now, not in the first tick.
        run(m.address, TAKE, 0, 0.0, 0.0)

    def _allocate(self) -> EstimatorMemory:
        robot, c = self._robot, self.config
        soles = [robot.frame_id(name) for name in self._names]
        belief = (*astuple(c.contact), c.encoder, c.joint_velocity, c.point, robot.weight)
        sizes = {"contacts": len(self._names), "nq": robot.nq, "nv": robot.nv, "room": KINEMATICS}
        return allocate(
            EstimatorMemory,
            sizes | {str(n): n for n in (1, 3, 6, 7)},
            filter=self.filter.memory,
            motion=motion_of(robot.model, self._data),
            frames=frames_of(robot.model, soles),
            base_R_unit=self._base_R_unit,
            base_p_unit=self._base_p_unit,
            belief=np.array(belief),
            leans=np.array([int(sole.leans) for sole in robot.soles.values()]),
        )

    def reset(self) -> None:
        """Discard the estimate; the next state reinitialises it."""
        m = self._memory
        self._started = False
        self._time = math.nan
        self.status = EstimatorStatus.OK
        self._smooth: Float64[np.ndarray, " nj"] | None = None
        self._last: RobotState | None = None
        m.pose[:], m.measured = self._q_start[:7], 0
        m.probability[:], m.slip_end[:] = 0.0, -math.inf
        self.tare.reset()
        self.vote.reset()
        if self.payload is not None:
            self.payload.reset()

    @property
    def wrenches(self) -> dict[str, Float64[np.ndarray, "6"]]:
        """Wrenches of the soles, measured or estimated; NaN or empty where not known [N, N m]."""
        if not self._memory.measured:
            return {}
        return {name: w.copy() for name, w in zip(self._names, self._wrenches, strict=True)}

    @property
    def slipping(self) -> tuple[str, ...]:
        """Soles that count as slipping."""
        ends = zip(self._names, self._memory.slip_end.tolist(), strict=True)
        return tuple(name for name, end in ends if self._time < end)

    @property
    def probability(self) -> dict[str, float]:
        """Probability of contact by sole."""
        return dict(zip(self._names, self._memory.probability.tolist(), strict=True))

    def start(self, states: Sequence[RobotState]) -> None:
        """Start from measurements of the robot at rest.

        The mean specific force is upwards, and of twenty or more samples the mean angular velocity
        is the gyro's bias. Unusable states are skipped. The base starts at its last position, and
        after `reset` at `q_start`, its soles on `EstimatorConfig.ground`.

        Args:
            states: as measured, the last one being now.
        """
        used = [s for s in states if self._take(s) and self._memory.fresh]
        readings = [s.readings for s in used if s.readings is not None]
        if not used:
            return
        up = self._base_R_unit @ np.mean([r.specific_force for r in readings], axis=0)
        yaw = _yaw(pin.Quaternion(self._q_start[3:7]).toRotationMatrix())
        world_R_base = _upright(up, yaw)
        bias = np.mean([r.angular_velocity for r in readings], axis=0)
        calibrated = len(used) >= _CALIBRATING
        self._take(used[-1])
        self._begin(used[-1], world_R_base, bias if calibrated else None)
        m, self._time = self._memory, used[-1].time
        m.before[:], m.fitted[0] = m.sensed, self._time

    def update(self, state: RobotState) -> RobotState:
        """Return the state with its base as estimated.

        Args:
            state: as measured.

        Returns:
            `q`, `v` with the joints as measured, sole wrenches less their zeros, and the time of
            the measurement; an unusable state as it is.
        """
        if not self._take(state):
            self.status = EstimatorStatus.BAD_STATE
            return state
        if not self._started:
            self.start([state])
            if not self._started:
                self.status = EstimatorStatus.NO_IMU
                return state
        m = self._memory
        if self.config.vote and m.fresh:
            state = self.vote.update(state, self._last, self.filter.rotation[2])
        if self.config.tare:
            state = self.tare.update(state, m.airborne.tolist(), self.vote.estimated)
        self._advance(state)
        if self.status is EstimatorStatus.RESTARTED:
            before = pin.Quaternion(self._memory.pose[3:7]).toRotationMatrix()
            self._begin(state, before, None)
            self._run(WAIT, self._time, 0.0)
        return self._answer(state)

    # --- one update ------------------------------------------------------------------------------

    def _take(self, state: object) -> bool:
        """Copy joints and readings; return False for unusable joints or time."""
        if not isinstance(state, RobotState) or not is_time(state.time):
            return False
        m, reading = self._memory, state.readings
        if not (is_array(state.q, len(m.q)) and is_array(state.v, len(m.v))):
            return False
        self._joints[:], self._speeds[:] = state.q[7:], state.v[6:]
        m.fresh = 0
        if reading is not None:
            rate, force = reading.angular_velocity, reading.specific_force
            if is_array(rate, 3) and is_array(force, 3):
                m.sensed[:3], m.sensed[3:], m.fresh = rate, force, 1
        return run(m.address, TAKE, 0, 0.0, 0.0) != BAD_STATE

    def _advance(self, state: RobotState) -> None:
        """Filter one measurement."""
        dt = state.time - self._time
        if self.config.joint_bandwidth is not None:
            self._low_pass(self.config.joint_bandwidth, dt)
        pin.computeJointJacobians(self._model, self._data, self._memory.q)
        operation = WAIT
        if 0.0 < dt <= self.config.longest_step:
            operation = STEP
            self._sense(state)
        elif dt != 0.0:
            operation = JUMP
            for contact in range(len(self._names)):
                self.filter.release(contact)
            self._memory.slip_end[:], self._memory.fitted[0] = -math.inf, state.time
            self.filter.loosen(tilt=_JUMP_TILT, velocity=_JUMP_SPEED)
        self._time = state.time
        self.status = self._run(operation, state.time, dt)

    def _run(self, operation: int, time: float, dt: float) -> EstimatorStatus:
        """Run an operation of the tick; fill in the base of the estimate."""
        m = self._memory
        status = _STATUSES[int(run(m.address, operation, 0, time, dt))]
        if status is not EstimatorStatus.RESTARTED:
            m.q[3:7] = pin.Quaternion(m.world_R_base).coeffs()
            m.pose[:] = m.q[:7]
        return status

    def _sense(self, state: RobotState) -> None:
        """Copy the soles' wrenches."""
        m = self._memory
        m.measured = not state.contacts.keys().isdisjoint(self._names)
        if m.measured:
            for row, name in zip(self._wrenches, self._names, strict=True):
                wrench = state.wrench(name)
                row[:] = math.nan if wrench is None else wrench

    # --- start and answer -----------------------------------------------------------------------

    def _begin(
        self,
        state: RobotState,
        world_R_base: Float64[np.ndarray, "3 3"],
        gyro_bias: Float64[np.ndarray, "3"] | None,
    ) -> None:
        """Start the filter at rest, at its last position or else on its soles."""
        m = self._memory
        pin.computeJointJacobians(self._model, self._data, m.q)
        run(m.address, SEE, 0, 0.0, 0.0)
        R = world_R_base @ self._base_R_unit
        lever = world_R_base @ self._base_p_unit
        position = m.pose[:3] + lever
        if self._last is None:
            position[2] = self.config.ground - (m.place @ R[2]).min()
        self.filter.start(R, position, gyro_bias=gyro_bias, deviation=self.config.start)
        self._started, m.airborne[:] = True, 0
        self._sense(state)

    def _answer(self, state: RobotState) -> RobotState:
        """Return the estimate, with the payload."""
        payload, m = self.payload, self._memory
        known = None if payload is None else payload.payload
        self._last = RobotState(
            m.q.copy(), m.v.copy(), state.contacts, state.time, state.readings, known
        )
        if payload is None or self.vote.estimated:
            return self._last
        return payload.update(self._last)

    def _low_pass(self, bandwidth: float, dt: float) -> None:
        """Smooth the joints' velocities."""
        before = self._smooth
        if before is not None and 0.0 <= dt <= self.config.longest_step:
            gain = -math.expm1(-2.0 * math.pi * bandwidth * dt)
            self._speeds[:] = before + gain * (self._speeds - before)
        self._smooth = self._speeds.copy()


def _yaw(rotation: Float64[np.ndarray, "3 3"]) -> float:
    return math.atan2(rotation[1, 0], rotation[0, 0])


def _upright(up: Float64[np.ndarray, "3"], yaw: float) -> Float64[np.ndarray, "3 3"]:
    """Return world_R_body by the upward direction along the body's axes, and the yaw [rad]."""
    vertical = np.array([0.0, 0.0, 1.0])
    falls = float(np.linalg.norm(up)) <= 0.1 * GRAVITY
    level = pin.Quaternion.FromTwoVectors(vertical if falls else up, vertical).matrix()
    return pin.utils.rotate("z", yaw - _yaw(level)) @ level


def _mounting(
    robot: Robot, name: str | None
) -> tuple[Float64[np.ndarray, "3 3"], Float64[np.ndarray, "3"]]:
    """Return base_R_unit and the unit's origin in the base."""
    if not robot.floating_base or not robot.soles:
        raise ConfigurationError(
            f"the base of robot {robot.name!r} cannot be estimated",
            got="no soles" if robot.floating_base else "a fixed base",
            wanted="a floating base and soles",
        )
    if name is None:
        return np.eye(3), np.zeros(3)
    frame = robot.model.frames[robot.frame_id(name)]
    if frame.parentJoint != 1:
        raise ConfigurationError(
            "the inertial unit is not on the base link", got=frame.name, wanted="a frame on it"
        )
    return frame.placement.rotation.copy(), frame.placement.translation.copy()
