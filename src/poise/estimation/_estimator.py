"""`StateEstimator`: where the robot is and how fast, from what a robot can measure itself."""

import math
from collections.abc import Sequence
from enum import Enum

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._checks import is_time
from poise.dynamics import RobotState, SensorReadings
from poise.errors import ConfigurationError
from poise.estimation._config import EstimatorConfig
from poise.estimation._filter import InvariantFilter
from poise.estimation._load_cells import LoadCellTare
from poise.estimation._momentum import MomentumObserver
from poise.estimation._payload import PayloadEstimator
from poise.estimation._sole_contacts import SoleContacts
from poise.estimation._soles import SoleKinematics
from poise.estimation._usable import felt_by, is_array, is_vector, usable_reading
from poise.robots import GRAVITY, Robot


class EstimatorStatus(Enum):
    """What an estimate is worth.

    Attributes:
        OK: everything was measured and used.
        FLYING: no sole is in contact, so the inertial unit is all there is.
        NO_IMU: the inertial unit said nothing of use; its last readings stand in.
        CLOCK_JUMP: time went back, or on by more than `EstimatorConfig.longest_step`; contacts
            begin anew.
        CLOCK_STILL: the time is that of a state before, and the readings are others; nothing of
            them is used.
        BAD_STATE: the measured state is none of this robot; it comes back as it is.
        RESTARTED: the filter's numbers were no longer sound, and it begins anew.
    """

    OK = "ok"
    FLYING = "flying"
    NO_IMU = "no imu"
    CLOCK_JUMP = "clock jump"
    CLOCK_STILL = "clock stands still"
    BAD_STATE = "bad state"
    RESTARTED = "restarted"

    @property
    def ok(self) -> bool:
        """Whether nothing was wrong."""
        return self in (EstimatorStatus.OK, EstimatorStatus.FLYING)


_CALIBRATING = 20
"""As many samples at rest say something of a gyro's bias."""

_JUMP_TILT, _JUMP_SPEED = 0.05, 0.5
"""How far a robot may have tipped [rad] and sped up [m/s] while nobody looked."""


class StateEstimator:
    """Base pose and velocity from inertial unit, encoders and contacts; an estimator of `rollout`.

    An `InvariantFilter` whose contact points are the soles' centres. Of a measured state it reads
    joints, sole wrenches, time and `readings`, never the base. The first state starts it, at rest,
    with position and yaw as in `q_start` and the soles on the ground; `start` does that better from
    a second of standing still. Absolute position and yaw are dead reckoning.

    Where no sole measures a wrench, a `MomentumObserver` estimates them from the motors' torques;
    where these are not measured either, all soles are taken to be in contact until they move.

    It never raises on numbers; `status` says what was wrong.

    Args:
        robot: with a floating base and soles.
        config: what it believes of the sensors.
        q_start: where the robot begins, of which position and yaw count; its home if not given.
        payload: finds how far the robot is from its description, and the state says so; nobody does
            when None.

    Attributes:
        filter: the filter.
        tare: zeros of the soles' load cells, once they have been in the air.
        status: of the last update.
        wrenches: of the soles, measured or else estimated; empty where neither is possible. A state
            has measured ones alone: estimated ones are good enough to tell contact by, not for a
            walker to feel the ground with [N, N m].
        slipping: the soles that are taken to slip.

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
        self._kinematics = SoleKinematics(robot, self._base_R_unit, self._base_p_unit)
        self._observer = MomentumObserver(robot)
        self.tare = LoadCellTare(self._names, robot.weight, longest=config.longest_step)
        self.filter = InvariantFilter(len(self._names), config.noise)
        self._contacts = SoleContacts(robot, config, self.filter, self._kinematics.soles)
        # What is compiled is compiled now, not in the first tick.
        is_vector(self._q_start, robot.nq, 7)
        self.reset()

    def reset(self) -> None:
        """Forgets everything; the next state starts it anew."""
        self._started = False
        self._time = math.nan
        self.status = EstimatorStatus.OK
        self._speeds: Float64[np.ndarray, " nj"] | None = None
        self._last: RobotState | None = None
        self._last_position: Float64[np.ndarray, "3"] | None = None
        self._reading: SensorReadings | None = None
        self._contacts.reset()
        self._observer.reset()
        self.tare.reset()
        if self.payload is not None:
            self.payload.reset()
        self.wrenches: dict[str, Float64[np.ndarray, "6"]] = {}

    @property
    def slipping(self) -> tuple[str, ...]:
        """The soles that are taken to slip."""
        return self._contacts.slipping

    @property
    def probability(self) -> dict[str, float]:
        """Of contact, by sole."""
        return self._contacts.probability

    def start(self, states: Sequence[RobotState]) -> None:
        """Starts from measurements of the robot standing still.

        The mean specific force says which way is up, and where there are some twenty samples the
        mean angular velocity is the gyro's bias. Whatever is of no use is passed over. It begins
        where it last was, and after `reset` at `q_start`, its soles on `EstimatorConfig.ground`.

        Args:
            states: as measured, the last one being now.
        """
        used = [s for s in states if self._is_usable(s) and usable_reading(s.readings)]
        if not used:
            return
        readings = [s.readings for s in used if s.readings is not None]
        up = self._base_R_unit @ np.mean([r.specific_force for r in readings], axis=0)
        world_R_base = _upright(up, _yaw(self._q_start))
        bias = np.mean([r.angular_velocity for r in readings], axis=0)
        calibrated = len(used) >= _CALIBRATING
        self._begin(used[-1], world_R_base, bias if calibrated else None)
        self._reading, self._time = _copied(readings[-1]), used[-1].time
        self._contacts.begin(self._time)

    def update(self, state: RobotState) -> RobotState:
        """The state with its base as estimated.

        Args:
            state: as measured.

        Returns:
            `q`, `v` with the joints as measured, sole wrenches less what they say in the air, and
            the time of the measurement; the state as it came where it is of no use.
        """
        if not self._is_usable(state):
            self.status = EstimatorStatus.BAD_STATE
            return state
        if not self._started:
            self.start([state])
            if not self._started:
                self.status = EstimatorStatus.NO_IMU
                return state
        if self.config.tare:
            state = self.tare.update(state, self._contacts.airborne)
        self._advance(state)
        if not self.filter.sound:
            self.status = EstimatorStatus.RESTARTED
            self._begin(state, self._upright_before(), None)
        return self._answer(state)

    # --- one update ------------------------------------------------------------------------------

    def _advance(self, state: RobotState) -> None:
        """Takes one measurement into the filter."""
        dt = state.time - self._time
        self.status = EstimatorStatus.OK
        speeds = self._joint_speeds(state.v[6:], dt)
        self._kinematics.look(state.q[7:], speeds)
        reading = state.readings if usable_reading(state.readings) else None
        if reading is None:
            self.status, reading = EstimatorStatus.NO_IMU, self._reading
        if reading is None:
            return
        if dt == 0.0:
            # The same state may come twice; other readings cannot be of the same time.
            if self._reading is not None and not _same(reading, self._reading):
                self.status = EstimatorStatus.CLOCK_STILL
            return
        if 0.0 < dt <= self.config.longest_step:
            self._predict(reading, dt)
            self._time = state.time
            self.wrenches = self._contact_wrenches(state, reading, dt)
            turning, fresh = reading.angular_velocity, reading is state.readings
            self._contacts.update(self._time, dt, self.wrenches, turning, fresh=fresh)
            if self.status is EstimatorStatus.OK and not self.filter.holds:
                self.status = EstimatorStatus.FLYING
        else:
            self._jump(state.time)
        if reading is not self._reading:
            self._reading = _copied(reading)

    def _predict(self, reading: SensorReadings, dt: float) -> None:
        """The mean rate of a period is that of its two ends; the force is a mean already."""
        before = reading if self._reading is None else self._reading
        rate = 0.5 * (before.angular_velocity + reading.angular_velocity)
        self.filter.propagate(rate, reading.specific_force, dt, self._contacts.walks)

    def _jump(self, time: float) -> None:
        """Nobody knows what happened meanwhile: contacts begin anew, tilt and speed are unsure."""
        self.status = EstimatorStatus.CLOCK_JUMP
        self._contacts.release(time)
        self.filter.loosen(tilt=_JUMP_TILT, velocity=_JUMP_SPEED)
        self._time = time
        self._observer.reset()

    def _contact_wrenches(
        self, state: RobotState, reading: SensorReadings, dt: float
    ) -> dict[str, Float64[np.ndarray, "6"]]:
        """As measured, or else estimated; empty where neither can be."""
        if any(name in state.contacts for name in self._names):
            return felt_by(state)
        if not is_array(reading.torque, self._robot.nj) or self._last is None:
            return {}
        if not math.isfinite(float(reading.torque.sum())):
            # What it has found so far would never be numbers again.
            self._observer.reset()
            return {}
        self._observer.update(self._last, reading.torque, dt)
        return self._observer.wrenches

    # --- what goes in and out --------------------------------------------------------------------

    def _begin(
        self,
        state: RobotState,
        world_R_base: Float64[np.ndarray, "3 3"],
        gyro_bias: Float64[np.ndarray, "3"] | None,
    ) -> None:
        """At rest, where it last was, or else on its soles."""
        self._kinematics.look(state.q[7:], state.v[6:])
        R = world_R_base @ self._base_R_unit
        position = self._last_position
        if position is None:
            position = self._q_start[:3] + world_R_base @ self._base_p_unit
            lowest = min(float(R[2] @ sole.offset) for sole in self._kinematics.soles)
            position[2] = self.config.ground - lowest
        self.filter.start(R, position, gyro_bias=gyro_bias, deviation=self.config.start)
        self._started = True
        self.wrenches = felt_by(state)

    def _answer(self, state: RobotState) -> RobotState:
        """The estimate in Poise's conventions: the base's velocity in the base's own frame."""
        q, v = state.q.copy(), state.v.copy()
        assert self._reading is not None
        turning = self._reading.angular_velocity
        self.filter.find_base(self._base_R_unit, self._base_p_unit, turning, q, v)
        if self._speeds is not None:
            v[6:] = self._speeds
        self._last_position = self.filter.position.copy()
        self._last = RobotState(q, v, state.contacts, state.time, state.readings)
        return self._last if self.payload is None else self.payload.update(self._last)

    def _joint_speeds(
        self, measured: Float64[np.ndarray, " nj"], dt: float
    ) -> Float64[np.ndarray, " nj"]:
        """The joints' velocities, smoothed where the configuration asks for it."""
        bandwidth = self.config.joint_bandwidth
        if bandwidth is None:
            return measured
        if self._speeds is None or not 0.0 <= dt <= self.config.longest_step:
            self._speeds = measured.copy()
            return self._speeds
        self._speeds = self._speeds - math.expm1(-2.0 * math.pi * bandwidth * dt) * (
            measured - self._speeds
        )
        return self._speeds

    def _upright_before(self) -> Float64[np.ndarray, "3 3"]:
        """Orientation of the base in the last estimate that was sound."""
        q = self._q_start if self._last is None else self._last.q
        return pin.Quaternion(q[3:7]).toRotationMatrix()

    def _is_usable(self, state: object) -> bool:
        """Whether joints, their velocities and the time are this robot's and finite."""
        if not isinstance(state, RobotState) or not is_time(state.time):
            return False
        robot = self._robot
        return is_vector(state.q, robot.nq, 7) and is_vector(state.v, robot.nv, 6)


def _copied(reading: SensorReadings) -> SensorReadings:
    """The same numbers: whoever reads sensors may write over what was given."""
    return SensorReadings(*(np.array(part) for part in reading))


def _same(one: SensorReadings, other: SensorReadings) -> bool:
    """Whether an inertial unit says the same twice."""
    return np.array_equal(one.angular_velocity, other.angular_velocity) and np.array_equal(
        one.specific_force, other.specific_force
    )


def _yaw(q: Float64[np.ndarray, " nq"]) -> float:
    x, y, z, w = q[3:7].tolist()
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def _upright(up: Float64[np.ndarray, "3"], yaw: float) -> Float64[np.ndarray, "3 3"]:
    """world_R_body from the body's upward direction, along its axes, and its yaw [rad]."""
    norm = float(np.linalg.norm(up))
    z = up / norm if norm > 0.1 * GRAVITY else np.array([0.0, 0.0, 1.0])
    y = np.array([0.0, z[2], -z[1]])
    length = float(np.linalg.norm(y))
    y = y / length if length > 1e-6 else np.array([0.0, 1.0, 0.0])
    c, s = math.cos(yaw), math.sin(yaw)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    return turn @ np.array([np.cross(y, z), y, z])


def _mounting(
    robot: Robot, name: str | None
) -> tuple[Float64[np.ndarray, "3 3"], Float64[np.ndarray, "3"]]:
    """base_R_unit and the unit's origin in the base."""
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
