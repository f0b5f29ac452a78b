"""`StepTeleoperator`: from the operator's foot devices and the robot's sensors to a stack."""

import math
from collections.abc import Mapping

import numpy as np
from jaxtyping import Float64

from poise._checks import checked_kind
from poise.control import Controller, is_usable
from poise.dynamics import RobotState
from poise.locomotion._pendulum import BodyRotator, ComShifter
from poise.locomotion._stepping._by_torque import POSTURE_WEIGHT, ComFeedback, OwnSteps, TorqueTasks
from poise.locomotion._stepping._by_velocity import (
    BodyMomentum,
    ComDriver,
    ComMotion,
    ShifterDriver,
    VelocityTasks,
    check_sway,
)
from poise.locomotion._stepping._com_height import ComHeight
from poise.locomotion._stepping._foot import FootTarget, FootVelocity
from poise.locomotion._stepping._mode_events import ModeEvents
from poise.locomotion._stepping._operator import (
    BodyCommand,
    Device,
    OperatorGuard,
    OperatorSample,
    TrackedPose,
)
from poise.locomotion._stepping._scaling import teleop_parameters
from poise.locomotion._stepping._stance import (
    WIDE,
    DesiredMotion,
    Footing,
    FootRange,
    Mode,
    StanceChoice,
    StanceEstimator,
    StepEnd,
    StepTasks,
    TeleopParameters,
    ZmpSensor,
    biped_of,
    mean_angle,
    one_foot,
    yaw_of,
)
from poise.locomotion._stepping._teleop_checks import (
    check_straight,
    checked_actuation,
    checked_controller,
    checked_start,
)
from poise.locomotion._stepping._teleop_status import TeleopStatus
from poise.locomotion._stepping._upper_body import GazeLeader, HandLeader
from poise.locomotion._support import SupportPolygon, two_soles
from poise.robots import Robot
from poise.stack import Stack


class StepTeleoperator:
    """The leader of Zhang and Kikuuwe: a person places the feet, feedback keeps the balance.

    A `poise.stack.Leader`. Each tick the rollout has `estimator` say where the robot is; `lead`
    reads the device, events (14) move the mode on, references (15) follow from mode and device, and
    the COM shifter (37), the body rotator (39) and saturated P controllers (17) make velocities of
    them, which tasks of `stack` are asked for. With the actuation "velocity", the paper's own,
    `controller()` solves the stack for velocities of the legs' joints, (19) to (23); a waist is
    kept still. With "torque" it solves it for torques of all joints: the COM shifter's feedback is
    on the measured divergent component, feet on the ground are contacts, and the trunk is kept
    upright in place of the body rotator. Either way the arms follow the operator's hands and the
    neck the operator's head, whatever the feet do.

    Neither `estimator.update` nor `lead` raises. A state that cannot be used is passed over, and
    the controller says so. A device that raises counts as silent, and the logger `poise` says why.

    Args:
        robot: a biped with legs of six joints.
        device: says what the operator commands; may be set later.
        parameters: those that `teleop_parameters` makes for the robot when None.
        q_start: configuration at the start; the robot's home when None.
        rotator: whether the body rotator acts, where velocities are commanded.
        driver: moves the COM; the COM shifter when None.
        actuation: what is commanded: "torque", or "velocity" for robots whose joints take no more.
        solved_by: name of the controller of torques that solves the stack: "whole_body", "reduced"
            or "osf"; the first when None.

    Raises:
        ConfigurationError: no two feet, legs of too few joints, soles that do not fit; a device,
            parameters or a start of another kind; servos of commanded velocities so soft that the
            robot would sway over one foot until it falls; a start turned from the world's x axis at
            velocity level; another driver than the COM shifter for torques.
        UnknownNameError: no such actuation, or no such controller of it.

    Attributes:
        robot: that is walked.
        device: says what the operator commands; None for nothing.
        soles: names of its left and its right sole.
        parameters: in use.
        driver: in use.
        actuation: what is commanded.
        solved_by: name of the controller that solves the stack.
        estimator: where the robot is taken to be; its `update` comes before `lead`.
        zmp_sensor: ZMP and loads as measured.
        hands: leads the arms.
        gaze: leads the neck, or by torques the torso of a robot without one.
    """

    def __init__(
        self,
        robot: Robot,
        device: Device | None = None,
        *,
        parameters: TeleopParameters | None = None,
        q_start: Float64[np.ndarray, " nq"] | None = None,
        rotator: bool = True,
        driver: ComDriver | None = None,
        actuation: str = "torque",
        solved_by: str | None = None,
    ) -> None:
        self.robot = checked_kind(robot, Robot, "the robot of the teleoperation")
        self.device = None if device is None else checked_kind(device, Device, "the device")
        self.soles = two_soles(robot)
        q_start = checked_start(robot, q_start)
        self.actuation = checked_actuation(actuation, driver)
        self.solved_by = checked_controller(solved_by, actuation)
        self.estimator = StanceEstimator(robot, self.soles, q_start, inertial=actuation == "torque")
        left, right = self.estimator.anchors
        self._com_height = float(self.estimator.dynamics.com[2] - 0.5 * (left[2] + right[2]))
        if actuation == "velocity":
            check_straight(self._faces())
        if parameters is None:
            parameters = teleop_parameters(robot, actuation, q_start=q_start)
        self.parameters = p = checked_kind(
            parameters, TeleopParameters, "parameters of the teleoperation"
        )
        self._biped = biped_of(robot, p)
        if driver is None:
            shifter = ComShifter(self._com_height, kp=p.kp, acceleration_max=p.acceleration_max)
            driver = ShifterDriver(shifter)
        self.driver, self._rotator = driver, rotator
        if actuation == "velocity" and isinstance(driver, ShifterDriver):
            check_sway(self._biped, self.estimator.dynamics, driver.shifter, p)
        self._reach = FootRange(robot, self.soles, p)
        servos = actuation == "velocity"
        self.hands = HandLeader(
            robot,
            dt=p.dt,
            q_rest=q_start,
            weight=POSTURE_WEIGHT,
            scale=p.hand_scale,
            servos=servos,
        )
        self.gaze = GazeLeader(
            robot,
            dt=p.dt,
            q_rest=q_start,
            weight=POSTURE_WEIGHT,
            turns_torso=not servos,
            servos=servos,
        )
        limbs = [task for task in (self.hands.task, self.gaze.task) if task is not None]
        self._tasks: StepTasks
        self._own: OwnSteps | None = None
        self._one_foot = WIDE
        if actuation == "torque":
            self._tasks = TorqueTasks(self._biped, p.dt, limbs, self.solved_by)
            self._one_foot = one_foot(robot, driver.omega, p.support_margin)
            self._own = OwnSteps(robot, self._tasks, q_start, p.dt)
        else:
            self._tasks = VelocityTasks(self._biped, p, limbs, rotator=rotator)
        # What is compiled is compiled now, not in the first tick.
        SupportPolygon([], p.support_margin)
        self.reset()

    def reset(self) -> None:
        """Forgets the past: both feet stand where they stood at the start."""
        biped, p, estimator = self._biped, self.parameters, self.estimator
        estimator.reset()
        self.zmp_sensor = sensor = ZmpSensor(
            biped.frames, self.soles, biped.weight, p.zmp_time, p.dt
        )
        self._tasks.reset()
        self.hands.reset()
        self.gaze.reset()
        if self._own is not None:
            self._own.reset()
        self._guard = OperatorGuard(dt=p.dt, low=p.lower_height, press_depth=p.press_depth)
        self._com = self._com_motion()
        self._events = ModeEvents(estimator, sensor, self._com, p, biped.weight, self._one_foot)
        self._stance = StanceChoice(estimator, sensor, p, biped.weight)
        rotates = self._rotator and self.actuation == "velocity"
        self._momentum = BodyMomentum(BodyRotator(biped.weight) if rotates else None, p)
        self._target = FootTarget(self._reach, p)
        self._height = ComHeight(self._com_height, self._reach, p)
        self._foot = FootVelocity(p)
        self._body = BodyCommand()
        self._ahead = self._faces()
        self._status: TeleopStatus | None = None

    def controller(self, *, time_limit: float | None = None) -> Controller:
        """Solves the stack: for velocities of the legs' joints, or for torques of all.

        Args:
            time_limit: cap of one solve, None for none [s]. A tick that reaches it falls back, as
                `CommandStatus` says.

        Raises:
            ConfigurationError: the controller takes none.
        """
        return self._tasks.controller(self.estimator.dynamics, time_limit)

    @property
    def device_error(self) -> Exception | None:
        """What the device raised in the last tick; None if all was well.

        A `TypeError` of what was no place or orientation in its sample, too.
        """
        return self._guard.error

    @property
    def held(self) -> tuple[bool, bool]:
        """The devices of the left and the right foot lead them."""
        return self._guard.held

    @property
    def stack(self) -> Stack:
        """What it leads."""
        return self._tasks.stack

    @property
    def dt(self) -> float:
        """Length of a tick: how often it has to be asked [s]."""
        return self.parameters.dt

    @property
    def mode(self) -> Mode:
        """Which feet carry the robot."""
        return self._events.mode

    @property
    def ahead(self) -> float:
        """Where the robot faces while nobody turns its feet, left of the world's x axis [rad].

        Where it faced at the start; after it has walked by a velocity, where that has turned it.
        """
        return self._ahead

    @property
    def status(self) -> TeleopStatus | None:
        """How the last tick stood; None before the first."""
        return self._status

    @property
    def resting_sample(self) -> OperatorSample:
        """A sample that asks for nothing: both devices on the feet where they stand."""
        left, right = (TrackedPose.of(anchor) for anchor in self.estimator.anchors)
        return OperatorSample(0.0, (left, right))

    def signals(self) -> Mapping[str, np.ndarray | float | str]:
        """What a recorder should know of the last tick; nothing before the first.

        Where the operator's devices, the foot in the air and the hands should be, the reference of
        the ZMP, which soles carry the robot, mode, device, how the last step ended, and what hands
        and head do; and what is estimated, under `estimate/`, for `com` and `zmp` are the plant's.
        """
        return {} if self.status is None else self.status.signals(self.soles, self.hands.names)

    def lead(self, state: RobotState) -> None:
        """Sets contacts, velocities and weights of the stack for the tick that begins.

        Args:
            state: as the estimator gave it.
        """
        dynamics = self.estimator.dynamics
        if state is not dynamics.state:
            # Of somebody else's estimator, or one that cannot be used.
            if not is_usable(state, self.robot):
                return
            dynamics.update(state)
        self.zmp_sensor.update(state, dynamics)
        self._com.observe(dynamics.com_velocity[:2])
        sample = self._guard.read(self.device, state.time)
        soles = (self.estimator.sole(0), self.estimator.sole(1))
        command = self._guard.check(sample, state.time, soles, self.estimator.anchors)
        self.hands.lead(self._guard, state)
        self.gaze.lead(self._guard)
        if self._own is not None:
            self._own.drive(self._guard.velocity)
            if self._own.acting:
                self._follow_own(self._own, state, sample)
                return
            self._own.feel(state, self.mode)
        before = self.mode
        self._move_mode(command, state.time)
        footing = self._footing()
        asked = self._com.cart_table_zmp(dynamics.com[:2])
        if before.single and not self.mode.single and isinstance(self._com, ComFeedback):
            # At once, its ZMP would be at the outer edge of the sole that stood, and the one that
            # has landed would lose its load again.
            self._com.take_over(asked, footing)
        if self._own is not None and self._own.takes_over(footing, state, asked):
            self._follow_own(self._own, state, sample)
            return
        if command is not None:
            self._body = command.body
        self._height.offset = self._body.height
        self._com.drive(footing)
        cart_table_zmp = self._com.cart_table_zmp(dynamics.com[:2])
        self._momentum.turn(footing, cart_table_zmp)
        below, gives_way = self._height.room(footing)
        target = self._target.place(footing, command, room_below=below, gives_way=gives_way)
        upright = command is not None and command.upright
        self._tasks.ask(footing, self._desired(footing, target), upright=upright)
        self._status = self._describe(footing, sample, target, cart_table_zmp)

    def _follow_own(self, own: OwnSteps, state: RobotState, sample: OperatorSample | None) -> None:
        """The robot leads its feet by itself; the operator has to take hold of them anew."""
        own.lead(state)
        before = self.mode
        ended = None if own.driven else StepEnd.OVERRULED
        if self._events.follow(own.mode, state.time, ended):
            self._stance.begin(before, self.mode)
        self._stance.follow(self.mode)
        self._guard.let_go(own.status)
        footing = self._footing()
        footing.zmp_reference = own.zmp
        soles, driven = (footing.sole(0), footing.sole(1)), own.driven
        own.accompany(footing, fits=self._reach.spans(*soles, footing.heading))
        self._status = self._describe(footing, sample, own.target, own.zmp)
        if not own.acting:
            if driven:
                self._ahead = self._faces()
            self._restart(None)
            self._height.restart(float(footing.dynamics.com_velocity[2]))
            if isinstance(self._com, ComFeedback):
                self._com.take_over(own.zmp, self._footing())

    def _com_motion(self) -> ComMotion | ComFeedback:
        if self.actuation == "torque" and isinstance(self.driver, ShifterDriver):
            return ComFeedback(self.driver.shifter, self.parameters.dt)
        return ComMotion(self.driver, self.parameters)

    def _move_mode(self, command: OperatorSample | None, time: float) -> None:
        before = self._events.mode
        held, rescuing = self._guard.held, self._target.rescuing
        if self._events.advance(command, held, time, rescuing=rescuing):
            self._stance.begin(before, self.mode)
            if before.single or self.mode.single:
                # Not at every change of mode: an operator who cannot decide makes many, and each
                # restart takes in noise.
                self._com.restart()
            self._restart(command)
        self._stance.follow(self.mode)

    def _restart(self, command: OperatorSample | None) -> None:
        """What belongs to a mode begins anew with it."""
        self._events.begin(command)
        self._momentum.restart()
        self._target.restart()
        self._foot.restart()

    def _footing(self) -> Footing:
        return Footing(
            biped=self._biped,
            dynamics=self.estimator.dynamics,
            mode=self.mode,
            stance=self.estimator.stance,
            anchors=self.estimator.anchors,
            omega=self.driver.omega,
            margin=self.parameters.support_margin,
            sensor=self.zmp_sensor,
            one_foot=self._one_foot,
            pressed=self._stance.pressed,
            parts=(None, None) if self._own is None else self._own.parts,
            borrowed=self._com.borrowed,
            com_velocity=self._com.observed,
            has_left=self._events.foot_has_left,
        )

    def _faces(self) -> float:
        """Where the feet face, to the left of the world's x axis [rad]."""
        return mean_angle(*(yaw_of(self.estimator.rotation(foot)) for foot in (0, 1)))

    def _desired(self, footing: Footing, target: Float64[np.ndarray, "3"]) -> DesiredMotion:
        com = np.array([*self._com.velocity.tolist(), self._height.velocity(footing, target)])
        left, right = self._body.turns
        return DesiredMotion(
            com=com,
            com_acceleration=self._com.acceleration,
            momentum=self._momentum.reference,
            foot=self._foot.towards(
                footing, target, self._target.rate, hurry=self._target.rescuing
            ),
            foot_place=target,
            torso=self._torso(),
            turns=(self._ahead + left, self._ahead + right),
        )

    def _torso(self) -> tuple[float, float, float]:
        """How the torso shall be turned: as commanded, and to look where a neck cannot [rad]."""
        (roll, pitch, yaw), (_, down, left) = self._body.torso, self.gaze.torso
        return (roll, pitch + down, yaw + left)

    def _describe(
        self,
        footing: Footing,
        sample: OperatorSample | None,
        target: Float64[np.ndarray, "3"],
        cart_table_zmp: Float64[np.ndarray, "2"],
    ) -> TeleopStatus:
        com, torso = footing.dynamics.com, footing.dynamics.placement(self._biped.torso)
        return TeleopStatus(
            mode=footing.mode,
            device=self._guard.status,
            sample=sample,
            zmp=self.zmp_sensor.zmp,
            zmp_reference=footing.zmp_reference,
            cart_table_zmp=cart_table_zmp,
            com=com,
            soles=(footing.sole(0), footing.sole(1)),
            target=target if footing.mode.single else None,
            loads=self.zmp_sensor.loads.copy(),
            tilt=footing.tilt,
            heading=math.atan2(footing.heading[1], footing.heading[0]),
            hands=tuple(self.hands.status),
            hand_targets=self.hands.targets(*torso),
            hand_rotations=self.hands.orientations(torso[1]),
            gaze=self.gaze.status,
            ended=self._events.ended,
        )
