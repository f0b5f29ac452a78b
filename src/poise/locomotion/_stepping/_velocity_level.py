"""`VelocityLevel`: step teleoperation by commanded velocities, and `check_sway`.

`ComDriver`: from ZMP references to velocities of the CoM.
"""

import math
from collections.abc import Sequence
from typing import Protocol, runtime_checkable

import numpy as np

from poise._checks import checked_number
from poise.control import Controller
from poise.dynamics import Dynamics, RobotState
from poise.errors import ConfigurationError
from poise.locomotion._pendulum import BodyRotator, ComShifter
from poise.locomotion._stepping._biped import Biped, TeleopParameters
from poise.locomotion._stepping._estimator import POSITION_GAIN, StanceEstimator
from poise.locomotion._stepping._feet import LevelTick, SteppingLevel
from poise.locomotion._stepping._footing import Footing
from poise.locomotion._stepping._guard import OperatorGuard
from poise.locomotion._stepping._sample import BodyCommand, OperatorSample
from poise.locomotion._stepping._velocity_tasks import VelocityNumbers, VelocityTasks
from poise.locomotion._support import SingleSupportRegion, Vector2, Vector3
from poise.locomotion._walking import (
    LIFT,
    FootRange,
    Mode,
    ModeEvent,
    StepEnd,
    StepMachine,
)
from poise.stack import JointTask

_GROWTH_MAX = 0.5
"""Sway may grow by e in no less than two seconds, for which a foot is in the air [1/s]."""

_WAYS = ("forward", "sideways")


def sway_stiffness(
    biped: Biped, dynamics: Dynamics, foot: int, stiffness: float
) -> tuple[Vector2, tuple[str, str]]:
    """Return the stiffness with which the servos of one leg hold the CoM, and the weakest joint."""
    # A force F on the CoM asks each joint j of the leg that stands for the torque G_j F, with G the
    # CoM's Jacobian while the sole rests; joints give way in series, so 1 / K = sum G_j^2 / k_j.
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
    """Return the growth of sway on one foot, negative where it decays [1/s]."""
    # The CoM p over a sole at rest is an inverted pendulum on the servos' spring. They follow the
    # integral P of the commanded velocity V, which the shifter (37) computes from p, with a leak:
    #     p'' = omega^2 p - (k / m) (p - P) - (d / m) (p' - V)      P' = V
    #     V'  = -k_p p - k_d V + lambda (p' - V)
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
    """Refuses a robot that the CoM shifter would throw over through servos that are too soft."""
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
                    f"{sole} it would sway {way} ever more, its servos too soft for the CoM "
                    "shifter",
                    got=f"sway that grows by {growth:.2g} /s, servos that hold the CoM at "
                    f"{math.sqrt(stiffness):.1f} rad/s over a pendulum of {omega:.1f}; what gives "
                    f"way most is {joint}, {torque:.3g} N m",
                    wanted=f"at most {_GROWTH_MAX:g} /s: actuation 'torque', which needs no "
                    f"servos; stronger joints; or servo_gains above {gain:g} /rad, if so they are",
                )


_OBSERVED = 20.0
"""Rate at which the observed velocity of the CoM follows the measured one [1/s]: noise and the
shock of a landing are gone in two ticks, a sway is not."""


@runtime_checkable
class ComDriver(Protocol):
    """From ZMP references to velocities of the CoM.

    Attributes:
        omega: sqrt(g / H) [1/s].
    """

    omega: float

    def drive(
        self, reference: Vector2, position: Vector2, velocity: Vector2, dt: float
    ) -> tuple[Vector2, Vector2]:
        """One tick."""
        ...

    def restart(self, commanded: Vector2, measured: Vector2) -> Vector2:
        """Initial velocity after a change of mode, commanded or measured [m/s]."""
        ...


class ComMotion:
    """Integrate the driver's reference, within the support of the soles."""

    def __init__(self, driver: ComDriver | ComShifter, dt: float, leak: float) -> None:
        self.omega = driver.omega
        # Commanded in the last tick [m/s, m/s^2].
        self.velocity: Vector2 = np.zeros(2)
        self.acceleration: Vector2 = np.zeros(2)
        # As measured, smoothed with the commanded acceleration [m/s].
        self.observed: Vector2 = np.zeros(2)
        self._driver, self._dt, self._leak = driver, dt, leak

    def observe(self, measured: Vector2) -> None:
        """Take a measured velocity, once a tick and before all else."""
        dt = self._dt
        expected = self.observed + dt * self.acceleration
        gain = dt * _OBSERVED / (1.0 + dt * _OBSERVED)
        self.observed = expected + gain * (measured - expected)

    def restart(self) -> None:
        """Go on from what is when contacts have changed, or from what a driver has."""
        driver, observed = self._driver, self.observed.copy()
        shifts = isinstance(driver, ComShifter)
        self.velocity = observed if shifts else driver.restart(self.velocity, observed)

    def cart_table_zmp(self, com: Vector2) -> Vector2:
        """CT-ZMP, eq. (26), of the commanded acceleration [m]."""
        return com - self.acceleration / self.omega**2

    def drive(self, footing: Footing) -> None:
        """One tick."""
        dt, dynamics, before = self._dt, footing.dynamics, self.velocity
        com, reference = dynamics.com[:2], footing.zmp_reference
        # While a sole rocks on its edge the CoM moves by itself, which an integral does not notice.
        before = before + dt * self._leak * (dynamics.com_velocity[:2] - before)
        driver = self._driver
        if not isinstance(driver, ComShifter):
            self.velocity, self.acceleration = driver.drive(reference, com, before, dt)
            return
        # Saturated on a straight line as the CoM sets off, and not as it brakes.
        free = driver.unlimited(reference, com, before)
        (free_x, free_y), (velocity_x, velocity_y) = free.tolist(), before.tolist()
        setting_off = free_x * velocity_x + free_y * velocity_y >= 0.0
        most, limit = max(abs(free_x), abs(free_y)), driver.acceleration_max
        if setting_off and most > limit:
            free *= limit / most
        (x, y), (goal_x, goal_y) = com.tolist(), (com - free / self.omega**2).tolist()
        support, goal = footing.support, (goal_x, goal_y)
        kept_x, kept_y = support.towards((x, y), goal) if setting_off else support.nearest(goal)
        self.acceleration = self.omega**2 * np.array([x - kept_x, y - kept_y])
        self.velocity = before + dt * self.acceleration


_BRAKED = 0.2
"""Part of its largest acceleration with which the CoM is braked before a knee is at its limit."""

_LATE = 0.2
"""Delay of braking where the knee of the stance leg is at its limit [s]."""

_DEEPER = 0.01
"""Depth below a swing foot to which the body is lowered for it before it meets a floor [m]."""


class ComHeight:
    """Eq. (15b) with (17a); lower where the legs need it, and steady."""

    def __init__(
        self,
        height: float,
        reach: FootRange,
        parameters: TeleopParameters,
        numbers: VelocityNumbers,
    ) -> None:
        self._height, self._range, self._numbers = height, reach, numbers
        self._dt, self.lowest = parameters.dt, (1.0 - parameters.stoop_max) * height
        self._velocity = self.offset = 0.0

    def velocity(self, footing: Footing, target: Vector3) -> float:
        """Velocity of the CoM upwards [m/s]."""
        p = self._numbers
        hips = [self._range.hip(foot, footing.dynamics) for foot in (0, 1)]
        too_low = self._too_low(footing, hips)
        way = self._reference(footing, target, hips, too_low) - float(footing.dynamics.com[2])
        # At v_lim downwards the robot would fall faster than its legs can carry; and one that is
        # not braked in time goes on beyond where a knee still holds it.
        braking = _BRAKED * p.lift_acceleration
        braked = math.sqrt(2.0 * braking * max(-too_low, 0.0))
        carries = footing.mode.support
        if carries is not None:
            foot = footing.anchors[carries]
            too_weak = self._range.too_weak(carries, foot, hips[carries], footing.heading)
            room = max(-too_weak, 0.0)
            braked = min(braked, braking * (math.sqrt(_LATE**2 + 2.0 * room / braking) - _LATE))
        velocity = max(-min(p.lift_speed, braked), min(p.lift_speed, POSITION_GAIN * way))
        change = self._dt * p.lift_acceleration
        self._velocity = max(self._velocity - change, min(self._velocity + change, velocity))
        return self._velocity

    def _too_low(self, footing: Footing, hips: Sequence[Vector3]) -> float:
        """Return the depth of the hips below where the legs hold them; negative for room [m]."""
        carries, heading = footing.mode.support, footing.heading
        feet = (footing.stance,) if footing.mode.single else (0, 1)
        return max(
            self._range.too_low(
                foot, footing.anchors[foot], hips[foot], heading, alone=foot == carries
            )
            for foot in feet
        )

    def _reference(
        self, footing: Footing, target: Vector3, hips: Sequence[Vector3], too_low: float
    ) -> float:
        """Eq. (15b), lower where a leg could not reach its foot, now or at the end [m]."""
        reach, stance, anchors = self._range, footing.stance, footing.anchors
        x, y, height = footing.dynamics.com.tolist()
        zmp_x, zmp_y = footing.zmp_reference.tolist()
        too_high = -math.inf
        for foot, place in (
            (stance, anchors[stance]),
            (footing.other, _limit_to_floor(footing, target)),
        ):
            for shift in ((0.0, 0.0), (zmp_x - x, zmp_y - y)):
                too_high = max(too_high, reach.too_high(foot, place, hips[foot], shift))
        lowest = max(height + too_low, self.lowest + footing.ground)
        usual = self._height + footing.ground
        asked = max(usual + self.offset, min(usual, lowest))
        return min(asked, max(height - too_high, lowest))


def _limit_to_floor(footing: Footing, target: Vector3) -> Vector3:
    """A target no lower than the floor; where there is none, no lower than just below the foot."""
    if not footing.mode.single:
        return target
    x, y, z = target.tolist()
    floor = min(footing.lowest_ground, float(footing.sole(footing.other)[2]) - _DEEPER)
    return np.array([x, y, max(z, floor)])


class VelocityLevel(SteppingLevel):
    """Events (14), references (15), CoM shifter (37), body rotator (39) and P controllers (17)."""

    def __init__(
        self,
        biped: Biped,
        parameters: TeleopParameters,
        numbers: VelocityNumbers,
        estimator: StanceEstimator,
        limbs: Sequence[JointTask],
        driver: ComDriver | ComShifter,
        *,
        rotator: bool,
    ) -> None:
        self._tasks = VelocityTasks(biped, parameters.dt, numbers, limbs, rotator=rotator)
        super().__init__(biped, parameters, estimator, self._tasks.stack, servos=True)
        self._driver, self._numbers = driver, numbers
        self._rotator = BodyRotator(biped.weight) if rotator else None
        self._region = SingleSupportRegion(
            sizes=biped.sizes, margin=biped.margin, arrived=numbers.capture_max
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

    def reset(self) -> None:
        """Stand on both feet as at the start."""
        self._tasks.reset()
        self._begin(self._driver.omega, self._region)
        p, numbers = self._parameters, self._numbers
        self._com = ComMotion(self._driver, p.dt, numbers.velocity_leak)
        self._height = ComHeight(self._biped.height, self._reach, p, numbers)
        self._momentum: Vector2 = np.zeros(2)  # about the CoM, x and y [kg m^2/s]
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
        devices.limit_descent(self._height.lowest)
        devices.falling |= footing.mode.single and footing.capture_depth < 0.0
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
            self._estimator.begin(before, mode)
            if before.single or mode.single:
                # Not at every change of mode: an operator who cannot decide makes many, and each
                # restart takes in noise.
                self._com.restart()
            self._shifted, self._momentum = 0.0, np.zeros(2)
            if mode.support is None:
                self._devices.stand()
            else:
                self._devices.take_off(1 - mode.support)
        self._estimator.follow(self.mode)

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
            event, load = ModeEvent.LANDED, float(footing.sense.loads[swing])
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
        if np.linalg.norm(footing.sense.zmp - place) > p.r_lift:
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
            com_velocity=self._com.observed,
            has_left=self._devices.foot_has_left,
        )
