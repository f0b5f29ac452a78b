"""`VelocityLevel`: step teleoperation by commanded velocities, `PaperEvents`, `check_sway`."""

import math
from collections.abc import Sequence

import numpy as np

from poise._checks import checked_number
from poise.control import Controller
from poise.dynamics import Dynamics, RobotState
from poise.errors import ConfigurationError
from poise.locomotion._pendulum import BodyRotator, ComShifter
from poise.locomotion._stepping._by_velocity._com_motion import (
    BodyMomentum,
    ComDriver,
    ComHeight,
    ComMotion,
)
from poise.locomotion._stepping._by_velocity._velocity_tasks import VelocityNumbers, VelocityTasks
from poise.locomotion._stepping._feet import (
    DeviceEvents,
    FootTarget,
    FootVelocity,
    Level,
    LevelTick,
    OperatorTick,
)
from poise.locomotion._stepping._operator import OperatorSample
from poise.locomotion._stepping._stance import (
    Biped,
    DesiredMotion,
    Footing,
    StanceEstimator,
    TeleopParameters,
)
from poise.locomotion._support import SingleSupportRegion, Vector2
from poise.locomotion._walking import LIFT, FootRange, Mode, ModeEvent, StepEnd, StepMachine
from poise.stack import JointTask

_GROWTH_MAX = 0.5
"""Sway may grow by e in no less than two seconds, for which a foot is in the air [1/s]."""

_WAYS = ("forward", "sideways")


def sway_stiffness(
    biped: Biped, dynamics: Dynamics, foot: int, stiffness: float
) -> tuple[Vector2, tuple[str, str]]:
    """Return the stiffness with which the servos of one leg hold the COM along the ground.

    A force F on the COM asks each joint j of the leg that stands for the torque G_j F, with G the
    COM's Jacobian while the sole rests; joints give way one after the other, so
    1 / K = sum G_j^2 / k_j.
    """
    robot = biped.robot
    joints = np.array(biped.legs[foot].joints)
    columns = robot.base_dofs + joints
    sole = dynamics.frame(biped.frames[foot]).jacobian
    base = np.linalg.solve(sole[:, : robot.base_dofs], sole[:, columns])
    moved = dynamics.com_jacobian[:2]
    rates = moved[:, columns] - moved[:, : robot.base_dofs] @ base
    gives = rates**2 / (stiffness * robot.tau_max[joints])
    first, second = (robot.joint_names[joints[int(np.argmax(row))]] for row in gives)
    return 1.0 / gives.sum(axis=1), (first, second)


def sway_growth(stiffness: float, damping: float, shifter: ComShifter, leak: float) -> float:
    """Return the growth of sway on one foot under the COM shifter; negative where it decays [1/s].

    The COM p of mass m over a sole at rest is an inverted pendulum on the servos' spring. They
    follow the integral P of the commanded velocity V, which the shifter (37) makes of p, with the
    leak lambda into the measured velocity:

        p'' = omega^2 p - (k / m) (p - P) - (d / m) (p' - V)      P' = V
        V'  = -k_p p - k_d V + lambda (p' - V)

    Soft servos are late, and a shifter that brakes late overshoots.
    """
    loop = np.array([
        [0.0, 1.0, 0.0, 0.0],
        [shifter.omega**2 - stiffness, -damping, stiffness, damping],
        [0.0, 0.0, 0.0, 1.0],
        [-shifter.kp, leak, 0.0, -shifter.kd - leak],
    ])  # fmt: skip
    return float(np.linalg.eigvals(loop).real.max())


def check_sway(
    biped: Biped, dynamics: Dynamics, shifter: ComShifter, gains: tuple[float, float], leak: float
) -> None:
    """Refuses a robot that the COM shifter would throw over through servos that are too soft."""
    robot = biped.robot
    gain = checked_number(gains[0], "stiffness of the servos [1/rad]", above=0.0)
    damping = checked_number(gains[1], "damping of the servos [s/rad]")
    for foot, sole in enumerate(biped.soles):
        stiffnesses, weakest = sway_stiffness(biped, dynamics, foot, gain)
        for way, stiffness, joint in zip(_WAYS, stiffnesses / robot.mass, weakest, strict=True):
            held, omega = float(stiffness), shifter.omega
            growth = sway_growth(held, held * damping / gain, shifter, leak)
            if growth > _GROWTH_MAX:
                torque = float(robot.tau_max[robot.joint_names.index(joint)])
                raise ConfigurationError(
                    f"robot {robot.name!r} cannot be stepped by joint velocities: standing on "
                    f"{sole} it would sway {way} ever more, its servos too soft for the COM "
                    "shifter",
                    got=f"sway that grows by {growth:.2g} /s, servos that hold the COM at "
                    f"{math.sqrt(stiffness):.1f} rad/s over a pendulum of {omega:.1f}; what gives "
                    f"way most is {joint}, {torque:.3g} N m",
                    wanted=f"at most {_GROWTH_MAX:g} /s: actuation 'torque', which needs no "
                    f"servos; stronger joints; or servo_gains above {gain:g} /rad, if so they are",
                )


class PaperEvents:
    """Keep the mode by devices and loads."""

    def __init__(self, parameters: TeleopParameters, numbers: VelocityNumbers) -> None:
        self._dt, self._numbers, self._machine = parameters.dt, numbers, StepMachine()
        self._devices, self._shifted = DeviceEvents(parameters), 0.0
        self.ended: StepEnd | None = None

    @property
    def mode(self) -> Mode:
        """Feet that carry the robot."""
        return self._machine.mode

    @property
    def foot_has_left(self) -> bool:
        """True once the swing foot has left the ground."""
        return self._devices.foot_has_left

    def advance(
        self,
        command: OperatorSample | None,
        held: tuple[bool, bool],
        footing: Footing,
        com: ComMotion,
        time: float,
        *,
        rescuing: bool,
    ) -> bool:
        """Move the mode on if something happened; return whether it did."""
        devices, machine, mode = self._devices, self._machine, self.mode
        devices.update(command, held, footing)
        if mode.support is None:
            lifted = devices.lifted()
            event = None if lifted is None else LIFT[lifted]
            if event is not None:
                self.ended = None
        elif mode.single:
            swing = 1 - mode.support
            load = float(footing.sense.loads[swing]) / footing.biped.weight
            event = self._ended(
                devices.end_of_swing(swing, load, rescuing=rescuing), ModeEvent.LANDED
            )
        else:
            ended = devices.end_of_shift(1 - mode.support, time - machine.since)
            event = self._ended(ended, ModeEvent.CANCEL) or self._shift(footing, com)
        return event is not None and machine.advance(event, time)

    def begin(self) -> None:
        """Start the detectors of a mode that has just begun; the feet's places are known."""
        self._shifted = 0.0
        if self.mode is Mode.D:
            self._devices.stand()
        elif self.mode.support is not None:
            self._devices.take_off(1 - self.mode.support)

    def _ended(self, ended: StepEnd | None, event: ModeEvent) -> ModeEvent | None:
        if ended is None:
            return None
        self.ended = ended
        return event

    def _shift(self, footing: Footing, com: ComMotion) -> ModeEvent | None:
        """The weight is on the foot that shall carry, for long enough."""
        self._shifted = self._shifted + self._dt if self._has_shifted(footing, com) else 0.0
        return ModeEvent.SHIFTED if self._shifted > self._numbers.shift_time else None

    def _has_shifted(self, footing: Footing, motion: ComMotion) -> bool:
        """Eq. (14e), and the CoM too: while it brakes, the ZMP is there and the CoM is not."""
        p, com, place = self._numbers, footing.dynamics.com[:2], footing.zmp_reference
        if np.linalg.norm(footing.sense.zmp - place) > p.r_lift:
            return False
        if np.linalg.norm(motion.cart_table_zmp(com) - place) > p.ct_zmp_max:
            return False
        # As commanded, and as it is: the robot lags behind a command that has just turned.
        return all(
            np.linalg.norm(com + velocity / motion.omega - place) < p.capture_max
            for velocity in (motion.velocity, motion.observed)
        )


class VelocityLevel(Level):
    """Events (14), references (15), CoM shifter (37), body rotator (39) and P controllers (17)."""

    def __init__(
        self,
        biped: Biped,
        parameters: TeleopParameters,
        numbers: VelocityNumbers,
        reach: FootRange,
        estimator: StanceEstimator,
        limbs: Sequence[JointTask],
        driver: ComDriver,
        *,
        rotator: bool,
    ) -> None:
        self._tasks = VelocityTasks(biped, parameters.dt, numbers, limbs, rotator=rotator)
        super().__init__(biped, parameters, reach, estimator, self._tasks.stack)
        self._driver, self._numbers = driver, numbers
        self._rotates = rotator
        self._region = SingleSupportRegion(
            sizes=biped.sizes, margin=biped.margin, arrived=numbers.capture_max
        )

    @property
    def mode(self) -> Mode:
        """Feet that carry the robot."""
        return self._events.mode

    def controller(self, dynamics: Dynamics, time_limit: float | None) -> Controller:
        """Return the controller of the stack."""
        return self._tasks.controller(dynamics, time_limit)

    def outcome(self, footing: Footing) -> LevelTick:
        """Return the outcome of the last tick."""
        cart_table_zmp = self._com.cart_table_zmp(footing.com[:2])
        return LevelTick(self._sent, footing.zmp_reference, cart_table_zmp, self._events.ended)

    def reset(self) -> None:
        """Stand on both feet as at the start."""
        self._tasks.reset()
        self._begin(self._driver.omega, self._region)
        p, numbers = self._parameters, self._numbers
        self._com = ComMotion(self._driver, p.dt, numbers.velocity_leak)
        self._events = PaperEvents(p, numbers)
        rotator = BodyRotator(self._biped.weight) if self._rotates else None
        self._momentum = BodyMomentum(rotator, p.dt, numbers.momentum_leak)
        self._target, self._foot = FootTarget(self._reach, p), FootVelocity(p)
        self._height = ComHeight(self._biped.height, self._reach, p, numbers)

    def lead(self, state: RobotState, operator: OperatorTick) -> bool:
        """Set the stack for a tick."""
        dynamics, com = self._estimator.dynamics, self._com
        com.observe(dynamics.com_velocity[:2])
        self._move_mode(operator, state.time)
        self.footing = footing = self._footing()
        self._height.offset = operator.body.height
        com.drive(footing)
        self._momentum.turn(footing, com.cart_table_zmp(footing.com[:2]))
        below, gives_way = self._height.room(footing)
        falling = gives_way or (footing.mode.single and footing.capture_depth < 0.0)
        target = self._sent = self._target.place(
            footing, operator.command, room_below=below, falling=falling
        )
        foot = self._foot.towards(footing, target, self._target.rate, hurry=self._target.rescuing)
        desired = DesiredMotion(
            com=np.array([*com.velocity.tolist(), self._height.velocity(footing, target)]),
            com_acceleration=com.acceleration,
            momentum=self._momentum.reference,
            foot=foot,
        )
        self._tasks.ask(footing, desired, upright=operator.upright)
        return False

    def _move_mode(self, operator: OperatorTick, time: float) -> None:
        events, before = self._events, self._events.mode
        if events.advance(
            operator.command,
            operator.guard.held,
            self._footing(),
            self._com,
            time,
            rescuing=self._target.rescuing,
        ):
            self._estimator.begin(before, events.mode)
            if before.single or events.mode.single:
                # Not at every change of mode: an operator who cannot decide makes many, and each
                # restart takes in noise.
                self._com.restart()
            events.begin()
            self._momentum.restart()
            self._target.restart()
            self._foot.restart()
        self._estimator.follow(events.mode)

    def _footing(self) -> Footing:
        return self._stand(
            mode=self._events.mode,
            com_velocity=self._com.observed,
            has_left=self._events.foot_has_left,
        )
