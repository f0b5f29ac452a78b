"""`StepTeleoperator`: from foot devices and sensors to a stack, with its `TeleopStatus`."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from poise._checks import checked_kind
from poise.control import CONTROLLERS, Controller, is_usable
from poise.dynamics import RobotState
from poise.errors import ConfigurationError, UnknownNameError
from poise.locomotion._pendulum import ComShifter
from poise.locomotion._stepping._biped import (
    TeleopParameters,
    biped_of,
    checked_actuation,
    checked_start,
    scaled_parameters,
)
from poise.locomotion._stepping._estimator import StanceEstimator
from poise.locomotion._stepping._footing import Footing
from poise.locomotion._stepping._guard import DeviceStatus, OperatorGuard
from poise.locomotion._stepping._hands import GazeLeader, HandLeader, HandStatus
from poise.locomotion._stepping._sample import (
    NOWHERE,
    BodyCommand,
    Device,
    OperatorSample,
    TrackedPose,
)
from poise.locomotion._stepping._torque_level import TorqueLevel
from poise.locomotion._stepping._torque_tasks import POSTURE_WEIGHT
from poise.locomotion._stepping._velocity_level import ComDriver, VelocityLevel, check_sway
from poise.locomotion._stepping._velocity_tasks import velocity_numbers
from poise.locomotion._support import Rotation, SupportPolygon, Vector2, Vector3, two_soles
from poise.locomotion._walking import Mode, StepEnd, mean_angle, yaw_of
from poise.robots import Robot
from poise.stack import Stack


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class TeleopStatus:
    """State of the last tick.

    Attributes:
        mode: which feet carry the robot.
        device: status of the operator's last sample.
        sample: of the device in this tick; None without one.
        zmp: measured, x and y [m].
        zmp_reference: where it should be, x and y [m].
        cart_table_zmp: CT-ZMP, x and y [m].
        com: estimated [m].
        soles: where the soles are, left and right [m].
        target: where the swing foot is sent, None with both on the ground [m].
        loads: normal forces, left and right [N].
        tilt: angle of the torso against upright [rad].
        heading: of the pelvis, to the left of the world's x axis [rad].
        hands: what each hand does.
        hand_targets: position of the target of each hand [m].
        hand_rotations: orientation of each target, world_R_hand; None for a position alone.
        gaze: what the head does; None where nothing can turn it.
        ended: how the operator's last step ended; None while one goes on, and before the first.
    """

    mode: Mode
    device: DeviceStatus = DeviceStatus.OK
    sample: OperatorSample | None
    zmp: Vector2
    zmp_reference: Vector2
    cart_table_zmp: Vector2
    com: Vector3
    soles: tuple[Vector3, Vector3]
    target: Vector3 | None
    loads: Vector2
    tilt: float
    heading: float = 0.0
    hands: tuple[HandStatus, ...] = ()
    hand_targets: tuple[Vector3, ...] = ()
    hand_rotations: tuple[Rotation | None, ...] = ()
    gaze: HandStatus | None = None
    ended: StepEnd | None = None


class StepTeleoperator:
    """Step teleoperation of Zhang and Kikuuwe: an operator places the feet, feedback balances.

    A `poise.stack.Leader`. Each tick the rollout updates `estimator` with the state; `lead`
    reads the device, events (14) move the mode on, references (15) follow from mode and device, and
    the CoM shifter (37), the body rotator (39) and saturated P controllers (17) make velocities of
    them, which tasks of `stack` are asked for. With the actuation "velocity", the paper's own,
    `controller()` solves the stack for velocities of the legs' joints, (19) to (23); a waist is
    kept still. With "torque" it solves it for torques of all joints: the CoM shifter's feedback is
    on the measured divergent component, feet on the ground are contacts, and the trunk is kept
    upright in place of the body rotator. Either way the arms follow the operator's hands and the
    neck the operator's head, whatever the feet do.

    Neither `estimator.update` nor `lead` raises. A state that cannot be used is passed over, and
    the controller says so. A device that raises counts as silent; the error is logged to `poise`.

    Args:
        robot: a biped with legs of six joints.
        device: source of the operator's samples; may be set later.
        parameters: those that `teleop_parameters` makes for the robot when None.
        q_start: configuration at the start; the robot's home when None.
        rotator: whether the body rotator acts, where velocities are commanded.
        driver: moves the CoM; the CoM shifter when None.
        actuation: what is commanded: "torque", or "velocity" for robots whose joints take no more.
        solved_by: name of the controller of torques that solves the stack: "whole_body", "reduced"
            or "osf"; the first when None.
        servo_gains: stiffness [1/rad] and damping [s/rad] of the joints' servos over the torque
            limits, where velocities are commanded.

    Raises:
        ConfigurationError: no two feet, legs of too few joints, soles that do not fit; a device,
            parameters or a start of another kind; servos of commanded velocities so soft that the
            robot would sway over one foot until it falls; a start turned from the world's x axis at
            velocity level; another driver than the CoM shifter for torques.
        UnknownNameError: no such actuation, or no such controller of it.

    Attributes:
        robot: that is walked.
        device: source of the operator's samples; None without one.
        soles: names of its left and its right sole.
        parameters: in use.
        driver: in use.
        actuation: what is commanded.
        solved_by: name of the controller that solves the stack.
        estimator: where the robot is taken to be; its `update` comes before `lead`.
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
        driver: ComDriver | ComShifter | None = None,
        actuation: str = "torque",
        solved_by: str | None = None,
        servo_gains: tuple[float, float] = (70.0, 2.5),
    ) -> None:
        self.robot = checked_kind(robot, Robot, "the robot of the teleoperation")
        self.device = None if device is None else checked_kind(device, Device, "the device")
        self.soles = two_soles(robot)
        q_start = checked_start(robot, q_start)
        self.actuation = checked_actuation(actuation)
        self.solved_by = _checked_controller(solved_by, actuation)
        servos = actuation == "velocity"
        self._biped = biped = biped_of(robot, q_start)
        if parameters is None:
            parameters = scaled_parameters(biped, actuation)
        self.parameters = p = checked_kind(
            parameters, TeleopParameters, "parameters of the teleoperation"
        )
        self.estimator = StanceEstimator(biped, q_start, p.dt, inertial=not servos)
        _check_start(actuation, driver, self._faces())
        self._numbers = numbers = velocity_numbers(biped)
        if driver is None:
            driver = ComShifter(biped.height, kp=p.kp, acceleration_max=numbers.acceleration_max)
        self.driver = driver
        if servos and isinstance(driver, ComShifter):
            dynamics, leak = self.estimator.dynamics, numbers.velocity_leak
            check_sway(biped, dynamics, driver, servo_gains, leak)
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
        self._level: VelocityLevel | TorqueLevel
        if servos:
            self._level = VelocityLevel(
                biped, p, numbers, self.estimator, limbs, driver, rotator=rotator
            )
        else:
            self._level = TorqueLevel(biped, p, self.estimator, limbs, self.solved_by, q_start)
        # What is compiled is compiled now, not in the first tick.
        SupportPolygon([], 0.0)
        self.reset()

    def reset(self) -> None:
        """Reset to the start: both feet stand where they stood then."""
        p = self.parameters
        self.estimator.reset()
        self._level.reset()
        self.hands.reset()
        self.gaze.reset()
        self._guard = OperatorGuard(dt=p.dt, low=p.lower_height, press_depth=p.press_depth)
        self._body = BodyCommand()
        self._ahead = self._faces()
        self._sample: OperatorSample | None = None
        self._status: TeleopStatus | None = None

    def controller(self, *, time_limit: float | None = None) -> Controller:
        """Make the controller: for velocities of the legs' joints, or for torques of all.

        Args:
            time_limit: cap of one solve, None for none [s]. A tick that reaches it falls back, see
                `CommandStatus`.

        Raises:
            ConfigurationError: the controller takes none.
        """
        return self._level.controller(self.estimator.dynamics, time_limit)

    @property
    def device_error(self) -> Exception | None:
        """Exception that the device raised in the last tick; None if all was well.

        A `TypeError` of what was no place or orientation in its sample, too.
        """
        return self._guard.error

    @property
    def held(self) -> tuple[bool, bool]:
        """True where the devices of the left and the right foot are engaged."""
        return self._guard.held

    @property
    def stack(self) -> Stack:
        """Stack whose targets it sets."""
        return self._level.stack

    @property
    def dt(self) -> float:
        """Length of a tick [s]."""
        return self.parameters.dt

    @property
    def mode(self) -> Mode:
        """Which feet carry the robot."""
        return self._level.mode

    @property
    def ahead(self) -> float:
        """Heading of the robot without turned feet, left of the world's x axis [rad].

        The heading at the start, plus the turns of walks by a velocity.
        """
        return self._ahead

    @property
    def status(self) -> TeleopStatus | None:
        """State of the last tick, made when it is first read; None before the first tick."""
        footing = self._level.footing
        if self._status is None and footing is not None:
            self._status = self._describe(footing)
        return self._status

    @property
    def resting_sample(self) -> OperatorSample:
        """Sample of rest: both devices on the feet where they stand."""
        left, right = (TrackedPose.of(anchor) for anchor in self.estimator.anchors)
        return OperatorSample(0.0, (left, right))

    def signals(self) -> Mapping[str, np.ndarray | float | str]:
        """Signals of the last tick for a recorder; none before the first.

        Where the operator's devices, the swing foot and the hands should be, the reference of
        the ZMP, which soles carry the robot, mode, device, how the last step ended, and what hands
        and head do; and what is estimated, under `estimate/`, for `com` and `zmp` are the plant's.
        """
        status = self.status
        if status is None:
            return {}
        mode, sample = status.mode, status.sample or OperatorSample()
        carries = mode.support if mode.single else None
        hands = zip(self.hands.names, status.hand_targets, strict=True)
        return {
            **{f"planned/{name}": float(carries in (None, i)) for i, name in enumerate(self.soles)},
            **{f"target/{name}": place for name, place in hands},
            "target/left device": np.array(sample.place(0)),
            "target/right device": np.array(sample.place(1)),
            "foot_target": np.array(NOWHERE if status.target is None else status.target),
            "zmp_reference": status.zmp_reference,
            "estimate/zmp": status.zmp,
            "estimate/cart_table_zmp": status.cart_table_zmp,
            "estimate/com": status.com,
            "estimate/soles": np.array(status.soles),
            "estimate/loads": status.loads,
            "estimate/tilt": status.tilt,
            "mode": mode.name,
            "device": status.device.name,
            "hands": ", ".join([hand.name for hand in status.hands]),
            "gaze": "" if status.gaze is None else status.gaze.name,
            "step_end": "" if status.ended is None else status.ended.name,
        }

    def lead(self, state: RobotState) -> None:
        """Set contacts, velocities and weights of the stack for the tick that begins.

        Args:
            state: as the estimator gave it.
        """
        dynamics = self.estimator.dynamics
        if state is not dynamics.state:
            # From another estimator, or unusable.
            if not is_usable(state, self.robot):
                return
            dynamics.update(state)
        guard, estimator = self._guard, self.estimator
        # A device may read the status of the tick before.
        self._sample = guard.read(self.device, state.time)
        self._status = None
        sense = estimator.sense
        soles = (sense.sole(0)[0], sense.sole(1)[0])
        command = guard.check(self._sample, state.time, soles, estimator.anchors)
        self.hands.lead(guard, state)
        self.gaze.lead(guard)
        if command is not None:
            self._body = command.body
        if self._level.lead(state, guard, command, self._body_with_gaze()):
            self._ahead = self._faces()

    def pause(self, state: RobotState) -> None:
        """Lead without the operator, as after a loss of the device.

        Args:
            state: as the estimator gave it.
        """
        device, self.device = self.device, None
        self.lead(state)
        self.device = device

    def _faces(self) -> float:
        """Heading of the feet, to the left of the world's x axis [rad]."""
        return mean_angle(*(yaw_of(self.estimator.rotation(foot)) for foot in (0, 1)))

    def _body_with_gaze(self) -> BodyCommand:
        """Add to the command the torso's turn to look where a neck cannot, and `ahead` to feet."""
        body, (_, down, aside) = self._body, self.gaze.torso
        (roll, pitch, yaw), (left, right) = body.torso, body.turns
        turns = self._ahead + left, self._ahead + right
        return BodyCommand(body.height, (roll, pitch + down, yaw + aside), turns)

    def _describe(self, footing: Footing) -> TeleopStatus:
        tick, heading = self._level.outcome(footing), footing.heading.tolist()
        return TeleopStatus(
            mode=footing.mode,
            device=self._guard.status,
            sample=self._sample,
            zmp=self.estimator.sense.zmp,
            zmp_reference=tick.zmp_reference,
            cart_table_zmp=tick.cart_table_zmp,
            com=footing.com,
            soles=(footing.sole(0), footing.sole(1)),
            target=tick.target if footing.mode.single else None,
            loads=self.estimator.sense.loads.copy(),
            tilt=footing.tilt,
            heading=math.atan2(heading[1], heading[0]),
            hands=tuple(self.hands.status),
            hand_targets=self.hands.targets(*footing.torso),
            hand_rotations=self.hands.orientations(footing.torso[1]),
            gaze=self.gaze.status,
            ended=tick.ended,
        )


def _check_start(actuation: str, driver: ComDriver | ComShifter | None, ahead: float) -> None:
    """Refuse another driver than the CoM shifter for torques, a turned start for velocities."""
    if actuation == "velocity" and abs(ahead) > 0.1:
        raise ConfigurationError(
            "at velocity level soles keep the world's yaw, and the robot starts turned",
            got=f"{ahead:.2f} rad",
            wanted="feet along the world's x axis, or torques",
        )
    if actuation == "torque" and not (driver is None or isinstance(driver, ComShifter)):
        raise ConfigurationError(
            "torques need the CoM shifter, whose feedback is on what is measured",
            got=type(driver).__name__,
            wanted="ComShifter, or none",
        )


def _checked_controller(name: str | None, actuation: str) -> str:
    """That controller, or the first one that commands so."""
    choices = [each for each, kind in CONTROLLERS.items() if kind.actuation == actuation]
    if name is None:
        return choices[0]
    if name not in choices:
        raise UnknownNameError(
            f"no such controller for step teleoperation by {actuation}", got=name, choices=choices
        )
    return name
