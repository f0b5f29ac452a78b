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
    ComDriver,
    ComHeight,
    ComMotion,
)
from poise.locomotion._stepping._by_velocity._velocity_tasks import VelocityNumbers, VelocityTasks
from poise.locomotion._stepping._feet import Level, LevelTick
from poise.locomotion._stepping._operator import BodyCommand, OperatorGuard, OperatorSample
from poise.locomotion._stepping._stance import (
    Biped,
    Footing,
    FootRange,
    StanceEstimator,
    TeleopParameters,
    ZmpSensor,
    leg_joints,
)
from poise.locomotion._support import SingleSupportRegion, Vector2
from poise.locomotion._walking import LIFT, Mode, ModeEvent, StepEnd, StepMachine
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
    joints = np.array(leg_joints(robot, biped.soles[foot]))
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
        self._rotator = BodyRotator(biped.weight) if rotator else None
        self._region = SingleSupportRegion(
            sizes=biped.sizes, margin=biped.size.margin, arrived=numbers.capture_max
        )

    @property
    def mode(self) -> Mode:
        """Feet that carry the robot."""
        return self._machine.mode

    def controller(self, dynamics: Dynamics, time_limit: float | None) -> Controller:
        """Return the controller of the stack."""
        return self._tasks.controller(dynamics, time_limit)

    def outcome(self, footing: Footing) -> LevelTick:
        """Return the outcome of the last tick."""
        cart_table_zmp = self._com.cart_table_zmp(footing.com[:2])
        return LevelTick(self._devices.sent, footing.zmp_reference, cart_table_zmp, self._ended)

    def reset(self, sensor: ZmpSensor) -> None:
        """Stand on both feet as at the start."""
        self._tasks.reset()
        self._begin(sensor, self._driver.omega, self._region)
        p, numbers = self._parameters, self._numbers
        self._com = ComMotion(self._driver, p.dt, numbers.velocity_leak)
        self._height = ComHeight(self._biped.size.height, self._reach, p, numbers)
        self._momentum: Vector2 = np.zeros(2)  # about the COM, x and y [kg m^2/s]
        self._machine, self._shifted = StepMachine(), 0.0
        self._ended: StepEnd | None = None

    def lead(
        self,
        state: RobotState,
        guard: OperatorGuard,
        command: OperatorSample | None,
        body: BodyCommand,
    ) -> bool:
        """Set the stack for a tick; no walk by velocity ends in it."""
        dynamics, com, devices = self._estimator.dynamics, self._com, self._devices
        com.observe(dynamics.com_velocity[:2])
        footing = self._footing()
        devices.update(command, guard.held, footing)
        self._move_mode(footing, state.time)
        self.footing = footing = self._footing()
        devices.update(command, guard.held, footing)
        self._height.offset = body.height
        com.drive(footing)
        cart_table_zmp = com.cart_table_zmp(footing.com[:2])
        self._turn(footing, cart_table_zmp)
        devices.room_below, gives_way = self._height.room(footing)
        devices.falling = gives_way or (footing.mode.single and footing.capture_depth < 0.0)
        target = devices.aim()
        self._tasks.ask(
            footing,
            com=np.array([*com.velocity.tolist(), self._height.velocity(footing, target)]),
            cart_table_zmp=cart_table_zmp,
            momentum=self._momentum,
            foot=devices.velocity(),
            upright=command is not None and command.upright,
        )
        return False

    def _turn(self, footing: Footing, cart_table_zmp: Vector2) -> None:
        """Eqs (39a) and (39b): integrate in single support, with a leak; zero otherwise."""
        if self._rotator is None or not footing.mode.single:
            self._momentum = np.zeros(2)
            return
        # A pure integral drives the torso in a limit cycle.
        dt = self._parameters.dt
        rate = self._rotator.momentum_rate(footing.zmp_reference, cart_table_zmp)
        self._momentum = (1.0 - dt * self._numbers.momentum_leak) * self._momentum + dt * rate

    def _move_mode(self, footing: Footing, time: float) -> None:
        before, event = footing.mode, self._event(footing, time)
        if event is not None and self._machine.advance(event, time):
            mode = self.mode
            self._stance.begin(before, mode)
            if before.single or mode.single:
                # Not at every change of mode: an operator who cannot decide makes many, and each
                # restart takes in noise.
                self._com.restart()
            self._shifted, self._momentum = 0.0, np.zeros(2)
            if mode.support is None:
                self._devices.stand()
            else:
                self._devices.take_off(1 - mode.support)
        self._stance.follow(self.mode)

    def _event(self, footing: Footing, time: float) -> ModeEvent | None:
        """Return the event (14) of the tick, by devices and loads."""
        devices, mode = self._devices, footing.mode
        if mode.support is None:
            lifted = devices.lifted()
            if lifted is None:
                return None
            self._ended = None
            return LIFT[lifted]
        swing = 1 - mode.support
        if mode.single:
            event, load = ModeEvent.LANDED, float(footing.sensor.loads[swing])
            ended = devices.end_of_swing(swing, load / footing.biped.weight)
        else:
            event, ended = ModeEvent.CANCEL, devices.end_of_shift(swing, time - self._machine.since)
        if ended is not None:
            self._ended = ended
            return event
        if mode.single:
            return None
        # The weight is on the foot that shall carry, for long enough.
        self._shifted = self._shifted + self._parameters.dt if self._has_shifted(footing) else 0.0
        return ModeEvent.SHIFTED if self._shifted > self._numbers.shift_time else None

    def _has_shifted(self, footing: Footing) -> bool:
        """Eq. (14e), and the CoM too: while it brakes, the ZMP is there and the CoM is not."""
        p, motion, com, place = self._numbers, self._com, footing.com[:2], footing.zmp_reference
        if np.linalg.norm(footing.sensor.zmp - place) > p.r_lift:
            return False
        if np.linalg.norm(motion.cart_table_zmp(com) - place) > p.ct_zmp_max:
            return False
        # As commanded, and as it is: the robot lags behind a command that has just turned.
        return all(
            np.linalg.norm(com + velocity / motion.omega - place) < p.capture_max
            for velocity in (motion.velocity, motion.observed)
        )

    def _footing(self) -> Footing:
        return self._stand(
            mode=self.mode,
            stance=self._estimator.stance,
            pressed=self._stance.pressed,
            com_velocity=self._com.observed,
            has_left=self._devices.foot_has_left,
        )
