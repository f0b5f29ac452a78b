"""`StepTeleoperator`: from the operator's hands and the robot's sensors to joint velocities."""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from poise.balance import BodyRotator, ComShifter, saturate
from poise.balance.cart_table import GRAVITY
from poise.balance.support import SupportPolygon, sole_rectangle
from poise.checks import checked_kind
from poise.control.command import Command, CommandStatus
from poise.control.differential_ik.closed_form import VelocityLevel, solve_levels
from poise.control.differential_ik.joint_weights import limit_weights
from poise.control.differential_ik.stance import base_from_joints, constrained
from poise.control.state_check import is_usable
from poise.dynamics.dynamics import Dynamics
from poise.dynamics.rotations import rotation_vector
from poise.dynamics.state import RobotState
from poise.errors import ConfigurationError
from poise.robots.robot import Robot
from poise.teleop.com_driver import ComDriver, ShifterDriver
from poise.teleop.detectors import LandingDetector, LiftDetector
from poise.teleop.device import DeviceGuard, DeviceSample, DeviceStatus
from poise.teleop.estimator import StanceEstimator
from poise.teleop.modes import Event, Mode, ModeMachine
from poise.teleop.parameters import TeleopParameters, knee_limits, leg_joints, scaled_parameters
from poise.teleop.reach import FootRange
from poise.teleop.rules import Rules
from poise.teleop.zmp import ZmpSensor

_PAPER_K1, _PAPER_K2, _PAPER_S2 = 4500.0, 7000.0, 100.0
"""k_1 and k_2 of (39c) and w_S2, as the paper has them; used where `Rules` ask for them."""

_STANCE_SHARE = 1.2
"""In double support a foot becomes the stance that carries this many times the other's load."""

_LIMIT_TIME = 0.05
"""Time in which a joint may at most reach its position limit [s]."""

_CALM = 0.8
"""Share of the deepest place in the sole from which on the swing foot has all its speed."""

_UPRIGHT_WEIGHT = 100.0
"""Weight of the torso's angular velocity while the operator asks for an upright torso."""


@dataclass(frozen=True, slots=True, eq=False)
class TeleopStatus:
    """How the last tick stood.

    Attributes:
        mode: which feet carry the robot.
        device: what became of the operator's last sample.
        zmp: measured, x and y [m].
        zmp_reference: likewise.
        cart_table_zmp: CT-ZMP, likewise.
        com: estimated [m].
        soles: where the soles are, left and right [m].
        target: where the foot in the air is sent, None with both on the ground [m].
        loads: normal forces, left and right [N].
        tilt: angle of the torso against upright [rad].
    """

    mode: Mode
    device: DeviceStatus
    zmp: Float64[np.ndarray, "2"]
    zmp_reference: Float64[np.ndarray, "2"]
    cart_table_zmp: Float64[np.ndarray, "2"]
    com: Float64[np.ndarray, "3"]
    soles: tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3"]]
    target: Float64[np.ndarray, "3"] | None
    loads: Float64[np.ndarray, "2"]
    tilt: float


class StepTeleoperator:
    """The controller of Zhang and Kikuuwe: a person places the feet, feedback keeps the balance.

    Each tick: the state is estimated from joints, attitude and loads; events (14) move the mode on;
    references (15) follow from mode and device; the COM shifter (37) and the body rotator (39)
    and saturated P controllers (17) make velocities of them; prioritised differential inverse
    kinematics (19) to (23) makes joint velocities of the legs. The other joints keep still.

    `step` never raises. A state that cannot be used gives zero velocities and says so.

    Args:
        robot: a biped with legs of six joints.
        parameters: scaled to the robot when None.
        q_start: configuration at the start; the robot's home when None.
        rules: departures from the paper.
        rotator: whether the body rotator acts.
        driver: moves the COM; the COM shifter when None.

    Raises:
        ConfigurationError: no two feet, legs of too few joints, soles that do not fit.
    """

    def __init__(
        self,
        robot: Robot,
        parameters: TeleopParameters | None = None,
        *,
        q_start: Float64[np.ndarray, " nq"] | None = None,
        rules: Rules | None = None,
        rotator: bool = True,
        driver: ComDriver | None = None,
    ) -> None:
        self.robot = checked_kind(robot, Robot, "the robot of the teleoperation")
        if not robot.floating_base or len(robot.soles) < 2:
            raise ConfigurationError(
                f"robot {robot.name!r} cannot be walked",
                got=f"soles {list(robot.soles)}",
                wanted="a floating base and two soles",
            )
        left, right, *_ = robot.soles
        self.soles = (left, right)
        q_start = robot.q_home if q_start is None else q_start
        self.estimator = StanceEstimator(robot, self.soles, q_start)
        dynamics, anchors = self.estimator.dynamics, self.estimator.anchors
        self._height = float(dynamics.com[2] - 0.5 * (anchors[0][2] + anchors[1][2]))
        if parameters is None:
            stance = abs(float(anchors[0][1] - anchors[1][1]))
            parameters = scaled_parameters(robot, self._height, stance)
        self.parameters = p = parameters
        _check_soles(robot, self.soles, p)
        self.rules = rules or Rules()
        self._legs = np.array([j for sole in self.soles for j in leg_joints(robot, sole)])
        self._q_min, self._q_max = knee_limits(robot, self._legs.tolist(), p.knee_min)
        self._v_max = robot.v_max[self._legs]
        self._columns = self._legs + robot.base_dofs
        self._frames = (robot.frame_id(left), robot.frame_id(right))
        self._torso = robot.frame_id(robot.torso)
        weight = robot.mass * GRAVITY
        self._zmp = ZmpSensor(self._frames, self.soles, weight, p.zmp_time, p.dt)
        shifter = ComShifter(self._height, kp=p.kp, acceleration_max=p.acceleration_max)
        self.driver = ShifterDriver(shifter) if driver is None else driver
        self._rotator = BodyRotator(weight) if rotator else None
        self._range = FootRange(robot, self.soles, p)
        self._lifts = (LiftDetector(p), LiftDetector(p))
        self._landing = LandingDetector(p, weight, arm=self.rules.armed_landing)
        self._guard = DeviceGuard()
        self._modes = ModeMachine()
        self._scales = (np.ones(6), np.ones(8))
        self._velocity, self._acceleration = np.zeros(2), np.zeros(2)
        self._momentum, self._swing_velocity, self._lift = np.zeros(2), np.zeros(3), 0.0
        self._rescuing, self._pressing, self._shifted = False, False, 0.0
        self._status: TeleopStatus | None = None

    @property
    def mode(self) -> Mode:
        """Which feet carry the robot."""
        return self._modes.mode

    @property
    def status(self) -> TeleopStatus | None:
        """How the last tick stood; None before the first."""
        return self._status

    @property
    def resting_sample(self) -> DeviceSample:
        """A sample that asks for nothing: both devices on the feet where they stand."""
        left, right = (anchor.copy() for anchor in self.estimator.anchors)
        return DeviceSample(0.0, left, right)

    def step(self, state: RobotState, sample: DeviceSample | None) -> Command:
        """One tick.

        Args:
            state: as measured; of the base only attitude and angular velocity are read.
            sample: what the device sent since the last tick; None for nothing.

        Returns:
            Joint velocities.
        """
        known = _without_base_motion(state)
        if known is None or not is_usable(known, self.robot):
            return Command(status=CommandStatus.BAD_STATE, velocity=np.zeros(self.robot.nj))
        estimate = self.estimator.update(known)
        dynamics = self.estimator.dynamics
        self._zmp.update(state, dynamics)
        device = self._guard.check(sample, state.time)
        self._move_modes(device, state.time)
        self._press_down()
        reference = self._zmp_reference()
        com = dynamics.com
        self._drive(reference, com[:2])
        ct_zmp = com[:2] - self._acceleration / self.driver.omega**2
        self._turn(reference, ct_zmp)
        target = self._foot_target(device)
        upright = device is not None and device.upright
        velocity = self._joint_velocities(estimate, target, reference, upright=upright)
        self._status = self._describe(reference, ct_zmp, target)
        if not np.isfinite(np.add.reduce(velocity)):
            return Command(status=CommandStatus.SOLVER_FAILED, velocity=np.zeros(self.robot.nj))
        return Command(status=CommandStatus.OK, velocity=velocity)

    # Modes -------------------------------------------------------------------------------------

    def _move_modes(self, device: DeviceSample | None, time: float) -> None:
        before = self._modes.mode
        event = self._event(device, time)
        if event is not None and self._modes.advance(event, time):
            self._enter(before, device)
        if not self._modes.mode.single and self.rules.loaded_stance:
            loads, stance = self._zmp.loads, self.estimator.stance
            if loads[1 - stance] > _STANCE_SHARE * loads[stance]:
                self.estimator.stand_on(1 - stance)

    def _press_down(self) -> None:
        """Sends the other foot down in double support until it carries something.

        It is taken to stand where it is as soon as it carries: pressed further it would tip the
        robot over the edge of the sole at rest.
        """
        p, estimator = self.parameters, self.estimator
        other = 1 - estimator.stance
        if self._modes.mode.single or not self.rules.press_down:
            return
        anchor, height = estimator.anchors[other], float(estimator.sole(other)[2])
        if self._zmp.loads[other] < self._landing.load:
            anchor[2] = max(
                min(anchor[2], height) - p.dt * p.press_speed, height - p.press_speed / p.k_v
            )
            self._pressing = True
        elif self._pressing:
            anchor[2], self._pressing = height, False

    def _event(self, device: DeviceSample | None, time: float) -> Event | None:
        mode, p = self._modes.mode, self.parameters
        if mode is Mode.D:
            return self._lifted(device)
        support = mode.support
        assert support is not None
        swing = 1 - support
        if mode.single:
            load = float(self._zmp.loads[swing])
            lifting = self._is_sent_up(device, swing)
            landed = self._landing.update(load, lifting=lifting)
            if self.rules.cancel and not self._landing.armed:
                landed = landed or self._is_given_back(device, swing) or self._rescuing
            return Event.LANDED if landed else None
        if self.rules.cancel and (
            self._is_given_back(device, swing) or time - self._modes.since > p.shift_timeout
        ):
            return Event.CANCEL
        self._shifted = self._shifted + p.dt if self._has_shifted(support) else 0.0
        wanted = p.shift_time if self.rules.safe_lift else 0.0
        return Event.SHIFTED if self._shifted > wanted else None

    def _is_given_back(self, device: DeviceSample | None, swing: int) -> bool:
        """Whether nobody wants a foot in the air that is still on the ground."""
        return device is None or self._lifts[swing].is_low(self._lift_height(device, swing))

    def _is_sent_up(self, device: DeviceSample | None, swing: int) -> bool:
        if device is None or self._rescuing:
            return False
        hand = device.left if swing == 0 else device.right
        return float(hand[2] - self.estimator.sole(swing)[2]) > self.parameters.lower_height

    def _lifted(self, device: DeviceSample | None) -> Event | None:
        if device is None:
            return None
        up = [self._lifts[i].update(self._lift_height(device, i)) for i in (0, 1)]
        if all(up):
            # Both at once: the foot that carries less goes first, the other has to ask again.
            return Event.LIFT_LEFT if self._zmp.loads[0] < self._zmp.loads[1] else Event.LIFT_RIGHT
        if up[0]:
            return Event.LIFT_LEFT
        return Event.LIFT_RIGHT if up[1] else None

    def _lift_height(self, device: DeviceSample, foot: int) -> float:
        """How far a device is above its foot's place on the ground [m]."""
        hand = device.left if foot == 0 else device.right
        return float(hand[2] - self.estimator.anchors[foot][2])

    def _has_shifted(self, support: int) -> bool:
        p, dynamics = self.parameters, self.estimator.dynamics
        reference = self.estimator.anchors[support][:2]
        if np.linalg.norm(self._zmp.zmp - reference) > p.r_lift:
            return False
        if not self.rules.safe_lift:
            return True
        com = dynamics.com[:2]
        ct_zmp = com - self._acceleration / self.driver.omega**2
        if np.linalg.norm(ct_zmp - reference) > p.ct_zmp_max:
            return False
        # As commanded, and as it is: the robot lags behind a command that has just turned.
        return all(
            float(np.linalg.norm(com + velocity / self.driver.omega - reference)) < p.capture_max
            for velocity in (self._velocity, dynamics.com_velocity[:2])
        )

    def _enter(self, before: Mode, device: DeviceSample | None) -> None:
        """Starts a mode: stance, detectors, and integrators that would have wound up."""
        mode, estimator = self._modes.mode, self.estimator
        if mode is Mode.D:
            for foot in (0, 1):
                if before.single and foot != estimator.stance:
                    estimator.put_down(foot)
                height = 0.0 if device is None else self._lift_height(device, foot)
                self._lifts[foot].reset(height)
            if not self.rules.loaded_stance:
                estimator.stand_on(0)
        else:
            support = mode.support
            assert support is not None
            if mode.single or not self.rules.loaded_stance:
                estimator.stand_on(support)
            self._landing.reset()
        if before.single or mode.single or not self.rules.steady_com:
            measured = estimator.dynamics.com_velocity[:2].copy()
            self._velocity = self.driver.restart(self._velocity, measured)
        self._momentum, self._swing_velocity = np.zeros(2), np.zeros(3)
        self._rescuing, self._shifted = False, 0.0

    # References ----------------------------------------------------------------------------------

    def _zmp_reference(self) -> Float64[np.ndarray, "2"]:
        """Eq. (15a)."""
        support = self._modes.mode.support
        if support is None:
            return 0.5 * (self.estimator.sole(0) + self.estimator.sole(1))[:2]
        return self.estimator.anchors[support][:2]

    def _foot_target(self, device: DeviceSample | None) -> Float64[np.ndarray, "3"] | None:
        """Where the foot in the air is sent, eq. (15d); None with both on the ground."""
        mode = self._modes.mode
        if not mode.single:
            return None
        support = mode.support
        assert support is not None
        swing, p = 1 - support, self.parameters
        anchor, here = self.estimator.anchors[support], self.estimator.sole(swing)
        lowest = float(min(anchor[2], self.estimator.anchors[swing][2])) - p.press_depth
        self._rescuing = self._rescuing or self._is_falling()
        if device is None or self._rescuing:
            # Nobody commands, or nobody may: straight down, until the ground is felt.
            return np.array([here[0], here[1], lowest])
        target = (device.left if swing == 0 else device.right).copy()
        # One that has not left the ground yet would push the robot over.
        on_ground = self.rules.cancel and not self._landing.armed
        target[2] = max(target[2], float(here[2]) if on_ground else lowest)
        if self.rules.lift_first:
            # A foot that still touches would be dragged over the ground.
            ground = min(float(a[2]) for a in self.estimator.anchors)
            clear = min(1.0, max(0.0, (float(here[2]) - ground) / p.clear_height))
            target[:2] = here[:2] + clear * (target[:2] - here[:2])
        if self.rules.reachable:
            dynamics, heading = self.estimator.dynamics, self._heading()
            lower = (
                max(0.0, float(dynamics.com[2]) - self._lowest_com())
                if self.rules.stooping
                else 0.0
            )
            target = self._range.bring_back(swing, target, anchor, heading, dynamics, lower=lower)
        return target

    def _drive(self, reference: Float64[np.ndarray, "2"], com: Float64[np.ndarray, "2"]) -> None:
        """The COM's next velocity, by the driver, within what the soles can support."""
        p, before = self.parameters, self._velocity
        if self.rules.felt_velocity:
            measured = self.estimator.dynamics.com_velocity[:2]
            before = before + p.dt * p.velocity_leak * (measured - before)
        self._velocity, self._acceleration = self.driver.drive(reference, com, before, p.dt)
        if not (self.rules.supported and isinstance(self.driver, ShifterDriver)):
            return
        omega = self.driver.omega
        free = self.driver.shifter.unlimited(reference, com, before)
        # Both axes by one factor: the COM goes straight from foot to foot, and not along one axis
        # first, beside the soles. And a_lim is for setting off; a COM that is on its way must be
        # braked by what the soles give.
        most = float(np.abs(free).max())
        limit = self.driver.shifter.acceleration_max
        setting_off = float(free @ before) >= 0.0 and most > limit
        acceleration = free * (limit / most) if setting_off else free
        ct_zmp = com - acceleration / omega**2
        kept = np.array(self._support().nearest((float(ct_zmp[0]), float(ct_zmp[1]))))
        self._acceleration = omega**2 * (com - kept)
        self._velocity = before + p.dt * self._acceleration

    def _support(self) -> SupportPolygon:
        """Of the soles on the ground, with a margin.

        In double support that is both, whatever their load: a foot that happens to carry nothing
        carries as soon as the ZMP moves towards it.
        """
        p, dynamics, estimator = self.parameters, self.estimator.dynamics, self.estimator
        corners: list[tuple[float, float]] = []
        for foot in (0, 1):
            if foot == estimator.stance or not self._modes.mode.single:
                frame = dynamics.frame(self._frames[foot])
                sole = self.robot.soles[self.soles[foot]]
                size = (sole.length, sole.width)
                corners += sole_rectangle(frame.position, frame.rotation, size)
        return SupportPolygon(corners, p.support_margin)

    def _is_falling(self) -> bool:
        """Whether the divergent component has left the sole that carries."""
        if not self.rules.rescue:
            return False
        capture = self._capture()
        return self._support().depth((float(capture[0]), float(capture[1]))) < 0.0

    def _capture(self) -> Float64[np.ndarray, "2"]:
        """The divergent component p + pdot / omega [m]."""
        dynamics = self.estimator.dynamics
        return dynamics.com[:2] + dynamics.com_velocity[:2] / self.driver.omega

    def _turn(self, reference: Float64[np.ndarray, "2"], ct_zmp: Float64[np.ndarray, "2"]) -> None:
        """Eqs (39a) and (39b): the desired angular momentum."""
        if self._rotator is None or not self._modes.mode.single:
            self._momentum = np.zeros(2)
            return
        p = self.parameters
        kept = 1.0 - p.dt * p.momentum_leak if self.rules.leaking_momentum else 1.0
        rate = self._rotator.momentum_rate(reference, ct_zmp)
        self._momentum = kept * self._momentum + p.dt * rate

    # Velocities ----------------------------------------------------------------------------------

    def _joint_velocities(
        self,
        estimate: RobotState,
        target: Float64[np.ndarray, "3"] | None,
        reference: Float64[np.ndarray, "2"],
        *,
        upright: bool,
    ) -> Float64[np.ndarray, " nj"]:
        """Eqs (17) to (23)."""
        p, estimator, dynamics = self.parameters, self.estimator, self.estimator.dynamics
        stance = estimator.stance
        other = 1 - stance
        sole = dynamics.frame(self._frames[other])
        torso = dynamics.frame(self._torso)
        if target is None:
            target = estimator.anchors[other] if self.rules.held_feet else sole.position
        level = np.eye(3)
        lift = self._com_lift(
            p.k_v * (self._com_height(target, reference) - float(dynamics.com[2]))
        )
        v_1 = np.concatenate(
            (
                self._velocity,
                [lift],
                saturate(p.omega_lim, p.k_omega * rotation_vector(level, sole.rotation)),
            )
        )
        v_2 = np.concatenate(
            (
                self._momentum,
                saturate(p.omega_lim, p.k_omega * rotation_vector(level, torso.rotation)),
                self._foot_velocity(target - sole.position),
            )
        )
        rows_1, rows_2, drift = self._jacobians(dynamics, stance, other)
        v_1, v_2 = v_1 - drift[:6], v_2 - drift[6:]
        q, rate = estimate.q[1:][self._columns], estimate.v[self._columns]
        legs = solve_levels(
            [
                VelocityLevel(rows_1, v_1, np.ones(6), self._scales[0]),
                VelocityLevel(rows_2, v_2, self._weights(reference, upright), self._scales[1]),
            ],
            limit_weights(q, rate, self._q_min, self._q_max),
        )
        legs = np.clip(legs, (self._q_min - q) / _LIMIT_TIME, (self._q_max - q) / _LIMIT_TIME)
        velocity = np.zeros(self.robot.nj)
        velocity[self._legs] = np.clip(legs, -self._v_max, self._v_max)
        return velocity

    def _foot_velocity(self, missing: Float64[np.ndarray, "3"]) -> Float64[np.ndarray, "3"]:
        """Eq. (17c), smoothed [m/s]."""
        p = self.parameters
        wanted = saturate(p.v_lim, p.k_v * missing)
        if self.rules.gentle and not self._rescuing:
            wanted[2] = max(wanted[2], -self._lowering_speed())
        if not (self.rules.smooth_swing and self._modes.mode.single):
            return wanted
        wanted[:2] *= self._calm()
        share = p.dt / (p.swing_time + p.dt)
        self._swing_velocity = self._swing_velocity + share * (wanted - self._swing_velocity)
        return self._swing_velocity

    def _calm(self) -> float:
        """Share of its speed that the swing foot may have: less the nearer the robot is to tipping.

        Swinging a leg takes angular momentum, which is then missing for the balance.
        """
        capture = self._capture()
        support = self._support()
        centre = self.estimator.anchors[self.estimator.stance]
        most = support.depth((float(centre[0]), float(centre[1])))
        depth = support.depth((float(capture[0]), float(capture[1])))
        return min(1.0, max(0.0, depth / (_CALM * most)))

    def _lowering_speed(self) -> float:
        """How fast the foot in the air may come down: slowly where the ground may be [m/s]."""
        p, estimator = self.parameters, self.estimator
        other = 1 - estimator.stance
        ground = max(float(anchor[2]) for anchor in estimator.anchors)
        height = float(estimator.sole(other)[2]) - ground
        share = min(1.0, max(0.0, height / p.clear_height))
        return p.touch_speed + share * (p.lower_speed - p.touch_speed)

    def _com_lift(self, wanted: float) -> float:
        """Velocity of the COM's height, saturated (17a), and steady [m/s]."""
        p = self.parameters
        if not self.rules.gentle:
            return max(-p.v_lim, min(p.v_lim, wanted))
        wanted = max(-p.lift_speed, min(p.lift_speed, wanted))
        change = p.dt * p.lift_acceleration
        self._lift = max(self._lift - change, min(self._lift + change, wanted))
        return self._lift

    def _com_height(
        self, target: Float64[np.ndarray, "3"], reference: Float64[np.ndarray, "2"]
    ) -> float:
        """Eq. (15b), lower where a leg could not reach its foot, now or at the end [m]."""
        estimator, dynamics = self.estimator, self.estimator.dynamics
        nominal = self._height + self._ground()
        if not self.rules.stooping:
            return nominal
        stance, com = estimator.stance, dynamics.com
        too_high = max(
            self._range.too_high(foot, place, dynamics, shift)
            for foot, place in ((stance, estimator.anchors[stance]), (1 - stance, target))
            for shift in (np.zeros(2), reference - com[:2])
        )
        # A leg that carries bends no further than its ankle lets the sole stay level.
        heading = self._heading()
        too_low = max(
            self._range.too_low(foot, estimator.anchors[foot], heading, dynamics)
            for foot in ((stance,) if self._modes.mode.single else (0, 1))
        )
        lowest = max(float(com[2]) + too_low, self._lowest_com())
        return min(nominal, max(float(com[2]) - too_high, lowest))

    def _heading(self) -> Float64[np.ndarray, "2"]:
        """Where the torso faces, along the ground."""
        forward = self.estimator.dynamics.frame(self._torso).rotation[:2, 0]
        return forward / np.linalg.norm(forward)

    def _lowest_com(self) -> float:
        return (1.0 - self.parameters.stoop_max) * self._height + self._ground()

    def _ground(self) -> float:
        """Height of the ground that carries: of the stance foot, or the middle of both feet [m]."""
        anchors = self.estimator.anchors
        if self._modes.mode.single:
            return float(anchors[self.estimator.stance][2])
        return 0.5 * float(anchors[0][2] + anchors[1][2])

    def _jacobians(
        self, dynamics: Dynamics, stance: int, other: int
    ) -> tuple[Float64[np.ndarray, "6 n"], Float64[np.ndarray, "8 n"], Float64[np.ndarray, "14"]]:
        """J_1 and J_2 of (19) on the legs, the base eliminated by the stance sole, eq. (13).

        And what the rows do by themselves while a stance sole that is not level is turned back.
        """
        columns, base = self._columns, self.robot.base_dofs
        sole = dynamics.frame(self._frames[other]).jacobian
        stacked = np.concatenate(
            (
                dynamics.com_jacobian,
                sole[3:],
                dynamics.momentum_matrix[3:5],
                dynamics.frame(self._torso).jacobian[3:],
                sole[:3],
            )
        )
        frame = dynamics.frame(self._frames[stance])
        contact = frame.jacobian
        legs = np.concatenate((np.arange(base), columns))
        rows = constrained(stacked[:, legs], base_from_joints(contact[:, legs]))
        drift = np.zeros(len(rows))
        if self.rules.level_stance:
            p = self.parameters
            tilt = rotation_vector(np.eye(3), frame.rotation)
            tilt[2] = 0.0
            turn = saturate(p.omega_lim, p.k_level * tilt)
            base_motion = np.linalg.solve(contact[:, :base], np.concatenate((np.zeros(3), turn)))
            drift = stacked[:, :base] @ base_motion
        return rows[:6], rows[6:], drift

    def _weights(
        self, reference: Float64[np.ndarray, "2"], upright: bool
    ) -> Float64[np.ndarray, "8"]:
        """W_A, eqs (39c) and (39d)."""
        p, rules = self.parameters, self.rules
        weights = np.empty(8)
        if not self._modes.mode.single:
            weights[:2], weights[2:5] = p.epsilon, p.w_B
            weights[5:] = p.w_S2 if rules.firm_feet else _PAPER_S2
            return weights
        weights[5:] = self._swing_weight()
        if self._rotator is None:
            weights[:2], weights[2:5] = p.epsilon, p.w_B
        elif rules.constant_weights:
            weights[:2], weights[2:5] = p.w_L, p.w_B1
            if self.rules.bounded_tilt:
                weights[2:5] *= 1.0 + (self._tilt() / p.tilt_soft) ** 4
        else:
            x, y = (reference - self._zmp.zmp).tolist()
            weights[0] = max(_PAPER_K1 * y * y, p.epsilon)
            weights[1] = max(_PAPER_K2 * x * x, p.epsilon)
            weights[2:5] = p.epsilon
        if upright:
            weights[2:5] = _UPRIGHT_WEIGHT
        return weights

    def _swing_weight(self) -> float:
        """Weight of the swing foot: firm on the ground, the paper's from `clear_height` on."""
        p, estimator = self.parameters, self.estimator
        if not self.rules.firm_lift:
            return p.w_S1
        ground = min(float(anchor[2]) for anchor in estimator.anchors)
        height = float(estimator.sole(1 - estimator.stance)[2]) - ground
        share = min(1.0, max(0.0, height / p.clear_height))
        return p.w_S2 ** (1.0 - share) * p.w_S1**share

    def _describe(
        self,
        reference: Float64[np.ndarray, "2"],
        ct_zmp: Float64[np.ndarray, "2"],
        target: Float64[np.ndarray, "3"] | None,
    ) -> TeleopStatus:
        dynamics = self.estimator.dynamics
        return TeleopStatus(
            mode=self._modes.mode,
            device=self._guard.status,
            zmp=self._zmp.zmp,
            zmp_reference=reference,
            cart_table_zmp=ct_zmp,
            com=dynamics.com,
            soles=(self.estimator.sole(0), self.estimator.sole(1)),
            target=target,
            loads=self._zmp.loads.copy(),
            tilt=self._tilt(),
        )

    def _tilt(self) -> float:
        """Angle of the torso against upright [rad]."""
        upward = float(self.estimator.dynamics.frame(self._torso).rotation[2, 2])
        return math.acos(max(-1.0, min(1.0, upward)))


def _check_soles(robot: Robot, names: tuple[str, str], parameters: TeleopParameters) -> None:
    narrowest = 0.5 * min(min(robot.soles[n].length, robot.soles[n].width) for n in names)
    if parameters.r_lift > narrowest + 1e-9:
        raise ConfigurationError(
            "r_lift is larger than half a sole: the ZMP might be outside the other foot at a lift",
            got=parameters.r_lift,
            wanted=f"at most {narrowest:.4g} m",
        )


def _without_base_motion(state: object) -> RobotState | None:
    """The state less what no sensor gives: where the base is and how fast it goes along."""
    if not isinstance(state, RobotState) or not _are_arrays(state.q, state.v):
        return None
    q, v = state.q.copy(), state.v.copy()
    q[:3], v[:3] = 0.0, 0.0
    return RobotState(q, v, state.contacts, state.time)


def _are_arrays(*values: object) -> bool:
    return all(isinstance(value, np.ndarray) and value.ndim == 1 for value in values)
