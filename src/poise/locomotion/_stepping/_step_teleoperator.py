"""`StepTeleoperator`: from the operator's hands and the robot's sensors to joint velocities.

`TeleopStatus`: how the last tick of the step teleoperator stood.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from poise._checks import checked_kind
from poise.control import Command, CommandStatus, is_usable
from poise.dynamics import RobotState
from poise.locomotion._pendulum import BodyRotator, ComShifter
from poise.locomotion._stepping._biped import biped_of, two_soles
from poise.locomotion._stepping._com import (
    BodyMomentum,
    ComDriver,
    ComHeight,
    ComMotion,
    ShifterDriver,
)
from poise.locomotion._stepping._device import DeviceGuard, DeviceSample, DeviceStatus
from poise.locomotion._stepping._estimator import StanceEstimator, ZmpSensor
from poise.locomotion._stepping._foot import FootTarget, FootVelocity
from poise.locomotion._stepping._footing import Footing, StanceChoice
from poise.locomotion._stepping._leg_velocities import LegVelocities, TaskWeights, Wanted
from poise.locomotion._stepping._mode_events import ModeEvents
from poise.locomotion._stepping._modes import Mode
from poise.locomotion._stepping._parameters import TeleopParameters, scaled_parameters
from poise.locomotion._stepping._reach import FootRange
from poise.locomotion._stepping._rules import Rules
from poise.robots import Robot


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

    Attributes:
        robot: that is walked.
        soles: names of its left and its right sole.
        parameters: in use.
        rules: in use.
        driver: in use.
        estimator: where the controller takes the robot to be.
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
        self.soles = two_soles(robot)
        q_start = robot.q_home if q_start is None else q_start
        self.estimator = StanceEstimator(robot, self.soles, q_start)
        left, right = self.estimator.anchors
        height = float(self.estimator.dynamics.com[2] - 0.5 * (left[2] + right[2]))
        if parameters is None:
            parameters = scaled_parameters(robot, height, abs(float(left[1] - right[1])))
        self.parameters = p = parameters
        self.rules = rules = rules or Rules()
        self._biped = biped = biped_of(robot, p)
        if driver is None:
            shifter = ComShifter(height, kp=p.kp, acceleration_max=p.acceleration_max)
            driver = ShifterDriver(shifter)
        self.driver = driver

        self._zmp = ZmpSensor(biped.frames, self.soles, biped.weight, p.zmp_time, p.dt)
        self._guard = DeviceGuard()
        self._com = ComMotion(driver, p, rules)
        self._events = ModeEvents(self.estimator, self._zmp, self._com, p, rules, biped.weight)
        self._stance = StanceChoice(self.estimator, self._zmp, p, rules, biped.weight)
        self._momentum = BodyMomentum(BodyRotator(biped.weight) if rotator else None, p, rules)
        reach = FootRange(robot, self.soles, p)
        self._target = FootTarget(reach, p, rules)
        self._height = ComHeight(height, reach, p, rules)
        self._foot = FootVelocity(p, rules)
        self._weights = TaskWeights(p, rules, rotator=rotator)
        self._legs = LegVelocities(biped, p, rules)
        self._status: TeleopStatus | None = None

    @property
    def mode(self) -> Mode:
        """Which feet carry the robot."""
        return self._events.mode

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
        self._zmp.update(state, self.estimator.dynamics)
        device = self._guard.check(sample, state.time)
        self._move_mode(device, state.time)
        footing = self._footing()
        self._com.drive(footing)
        self._momentum.turn(footing, self._com.cart_table_zmp(footing.dynamics.com[:2]))
        target = self._foot_target(footing, device)
        velocity = self._legs.solve(estimate, footing, self._wanted(footing, device, target))
        self._status = self._describe(footing, target)
        if not np.isfinite(np.add.reduce(velocity)):
            return Command(status=CommandStatus.SOLVER_FAILED, velocity=np.zeros(self.robot.nj))
        return Command(status=CommandStatus.OK, velocity=velocity)

    def _move_mode(self, device: DeviceSample | None, time: float) -> None:
        before = self._events.mode
        if self._events.advance(device, time, rescuing=self._target.rescuing):
            self._stance.begin(before, self.mode)
            self._events.begin(device)
            if before.single or self.mode.single or not self.rules.steady_com:
                self._com.restart(self.estimator.dynamics.com_velocity[:2].copy())
            self._momentum.restart()
            self._target.restart()
            self._foot.restart()
        self._stance.follow(self.mode)

    def _footing(self) -> Footing:
        return Footing(
            biped=self._biped,
            dynamics=self.estimator.dynamics,
            mode=self.mode,
            stance=self.estimator.stance,
            anchors=self.estimator.anchors,
            omega=self.driver.omega,
            margin=self.parameters.support_margin,
        )

    def _foot_target(
        self, footing: Footing, device: DeviceSample | None
    ) -> Float64[np.ndarray, "3"]:
        return self._target.place(
            footing,
            device,
            has_left=self._events.foot_has_left,
            room_below=self._height.room_below(footing),
        )

    def _wanted(
        self,
        footing: Footing,
        device: DeviceSample | None,
        target: Float64[np.ndarray, "3"],
    ) -> Wanted:
        upright = device is not None and device.upright
        return Wanted(
            com=self._com.velocity,
            lift=self._height.velocity(footing, target),
            momentum=self._momentum.wanted,
            foot=self._foot.towards(footing, target, hurry=self._target.rescuing),
            weights=self._weights.at(footing, self._zmp.zmp, upright=upright),
        )

    def _describe(self, footing: Footing, target: Float64[np.ndarray, "3"]) -> TeleopStatus:
        com = footing.dynamics.com
        return TeleopStatus(
            mode=footing.mode,
            device=self._guard.status,
            zmp=self._zmp.zmp,
            zmp_reference=footing.zmp_reference,
            cart_table_zmp=self._com.cart_table_zmp(com[:2]),
            com=com,
            soles=(footing.sole(0), footing.sole(1)),
            target=target if footing.mode.single else None,
            loads=self._zmp.loads.copy(),
            tilt=footing.tilt,
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
