"""Stack of the velocity level: `VelocityTasks`, `VelocityNumbers` and `SoleGrounds`."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.control import (
    Controller,
    ControllerPlan,
    DifferentialIK,
    refuse_solver_settings,
)
from poise.dynamics import Dynamics, rotation_vector, saturate
from poise.locomotion._stepping._biped import Biped
from poise.locomotion._stepping._footing import LEVEL, Footing, TrunkPose
from poise.locomotion._support import Rotation, Vector2, Vector3
from poise.locomotion._walking import CLEARANCE, LOADED, Mode
from poise.stack import (
    ComTask,
    FrameTask,
    JointLimit,
    JointTask,
    MomentumTask,
    SelfCollisionLimit,
    Stack,
    SurfaceContact,
)


@dataclass(frozen=True, kw_only=True)
class VelocityNumbers:
    """Numbers of Zhang and Kikuuwe, section 3 to 5, and those that the paper leaves open."""

    r_lift: float  # distance of ZMP and reference at which a foot may leave the ground [m]
    capture_max: float  # largest distance of the DCM from the stance foot at lift-off [m]
    ct_zmp_max: float  # largest distance of the CT-ZMP from there [m]
    w_L: float  # weight of the angular momentum in single support
    lift_speed: float  # largest vertical speed of the CoM [m/s]
    lift_acceleration: float  # largest vertical acceleration of the CoM [m/s^2]
    acceleration_max: float = 0.8  # a_lim [m/s^2]
    shift_time: float = 0.01  # time for which a weight shift has to be complete [s]
    k_omega: float = 10.0  # gain of the angular velocities [1/s]
    omega_lim: float = 0.8  # largest angular velocity [rad/s]
    k_level: float = 8.0  # gain with which a stance sole is levelled [1/s]
    w_B: float = 100.0  # weight of the torso's angular velocity in double support
    w_B1: float = 3.0  # the same in single support
    w_S1: float = 30.0  # weight of the swing foot's velocity
    w_S2: float = 1e4  # weight of the other foot's velocity in double support
    epsilon: float = 1e-3  # weight of what should not count
    tilt_soft: float = 0.2  # tilt of the torso at which its attitude weighs twice as much [rad]
    momentum_leak: float = 5.0  # decay of the desired angular momentum [1/s]
    velocity_leak: float = 5.0  # decay of the commanded CoM velocity into the measured one [1/s]


def velocity_numbers(biped: Biped) -> VelocityNumbers:
    """Scale the numbers from the paper's robot: 65 kg, feet 0.42 m apart.

    With a_lim as it is, the first swing of the ZMP, a_lim / omega^2, keeps its ratio to the CoM's
    height; `r_lift` keeps its ratio to the distance of the feet, within half a sole. Angular
    momentum weighs as much as the paper's beside the swing foot's velocity: it goes with m h.
    """
    return VelocityNumbers(
        r_lift=min(0.12 * biped.apart / 0.42, biped.half_sole),
        capture_max=0.06 * biped.wide,
        ct_zmp_max=0.12 * biped.wide,
        w_L=(65.0 / biped.robot.mass / biped.tall) ** 2,
        lift_speed=0.3 * biped.tall,
        lift_acceleration=1.5 * biped.tall,
    )


_FOLLOW, _CORRECT = 5.0, 20.0
"""Rates at which the tilt of a ground follows that of a sole which lies flat on it, and that of a
sole which could not be tilted as it is otherwise [1/s]."""

_ON_EDGE, _FLAT = 0.9, 0.6
"""Distance of the centre of pressure from the sole's, over half the sole: beyond the first the sole
may be on its edge, within the second it lies flat."""

_SEEK = 0.5
"""Angular velocity of a sole on its edge that has not lain flat yet [rad/s]."""


class SoleGrounds:
    """The tilt of the ground under each foot, as the inertial unit has it."""

    # A sole pressed well inside lies flat. One pressed at an edge may be raised on the other side,
    # but not tilted the other way. Ground that no sole has lain flat on since landing is unknown.

    def __init__(self, dt: float) -> None:
        self._follow, self._correct = dt * _FOLLOW, dt * _CORRECT
        self.reset()

    def reset(self) -> None:
        """Nothing is known of the ground."""
        self._tilts = [np.zeros(3), np.zeros(3)]
        self._known = [[False, False], [False, False]]

    def update(self, footing: Footing) -> None:
        """Advance by one tick."""
        for foot in (0, 1):
            if footing.mode.single and foot == footing.other:
                # It will land on what the other stands on, for all that is known.
                self._tilts[foot] = self._tilts[1 - foot].copy()
                self._known[foot] = [False, False]
                continue
            pressed = _pressed(footing, foot)
            if pressed is None:
                continue
            off = _sole_tilt(footing, foot) - self._tilts[foot]
            for axis, part in enumerate(pressed):
                self._tilts[foot][axis] += self._believed(foot, axis, float(off[axis]), part)

    def _believed(self, foot: int, axis: int, off: float, pressed: float) -> float:
        """Return the part of a difference of tilts about an axis that is the ground's [rad]."""
        if not self._known[foot][axis]:
            self._known[foot][axis] = abs(pressed) < _ON_EDGE
            return off
        edge = min(1.0, max(0.0, (abs(pressed) - _FLAT) / (_ON_EDGE - _FLAT)))
        # On the lowered edge a sole may be tilted, with the raised one down it cannot be.
        impossible = edge if off * pressed < 0.0 else 0.0
        return (self._follow * (1.0 - edge) + self._correct * impossible) * off

    def rotation(self, foot: int) -> Rotation:
        """Return world_R_ground under a foot."""
        return pin.exp3(self._tilts[foot])

    def seeking(self, footing: Footing, foot: int) -> Vector3:
        """Angular velocity of a sole on an edge whose ground is not known, its free edge down."""
        rate, pressed = np.zeros(3), _pressed(footing, foot)
        if pressed is not None:
            for axis, part in enumerate(pressed):
                if not self._known[foot][axis]:
                    rate[axis] = -math.copysign(_SEEK, part)
        return rate

    def righting(self, footing: Footing, foot: int, gain: float) -> Vector3:
        """Angular velocity with which a sole that carries is turned onto its ground."""
        lift = _sole_tilt(footing, foot) - self._tilts[foot]
        return self.seeking(footing, foot) - gain * lift


def _sole_tilt(footing: Footing, foot: int) -> Vector3:
    """Return the tilt of a sole from level, horizontal axis times angle [rad]."""
    _, rotation = footing.dynamics.placement(footing.biped.frames[foot])
    tilt = rotation_vector(rotation, LEVEL)
    tilt[2] = 0.0
    return tilt


def _pressed(footing: Footing, foot: int) -> tuple[float, float] | None:
    """Return the centre of pressure over half the sole, by turns about x and y that lower it."""
    centre = footing.sense.centres[foot]
    if centre is None:
        return None
    length, width = footing.biped.sizes[foot]
    return -2.0 * centre[1] / width, 2.0 * centre[0] / length


_ROLL_OFF = 0.3
"""Angular velocity of a sole over the distance of its centre of pressure from its goal
[rad/s per m]; servos are stiff: ten times as much makes feet shake."""

_GIVE = (0.15, 0.15, 0.03)
"""Velocity of a foot over a force that squeezes, over the weight [m/s]; legs are stiffest
along their length."""


# Two feet on the ground are a closed chain: one gives way to forces that only squeeze. It turns
# until its centre of pressure is as far ahead as the other's and in the middle across the line
# between the feet, moves with what its pull exceeds the share of its load, and rises or sinks until
# it bears the load that the ZMP asks for.


def yielding_turn(footing: Footing) -> Vector2 | None:
    """Return the angular velocity of the other sole, x and y; None without load [rad/s]."""
    sense, other = footing.sense, footing.other
    here, there = sense.centres[other], sense.centres[footing.stance]
    if here is None or there is None:
        return None
    along = _between(footing)
    along /= np.linalg.norm(along)
    aim = np.array(there)
    off_x, off_y = (np.array(here) - aim + along * along.dot(aim)).tolist()
    _, rotation = footing.dynamics.placement(footing.biped.frames[other])
    share = min(1.0, 2.0 * float(sense.loads[other]) / footing.biped.weight)
    return _ROLL_OFF * share * rotation[:2, :2].dot(np.array([off_y, -off_x]))


def yielding_velocity(footing: Footing, velocity: Vector3, zmp: Vector2, dt: float) -> Vector3:
    """Return the velocity of the other foot, whose anchor settles where it stands [m/s]."""
    sense, other = footing.sense, footing.other
    total, weight = float(sense.loads.sum()), footing.biped.weight
    if sense.centres[other] is None or total < LOADED * weight:
        return velocity
    part, along = float(sense.loads[other]) / total, _between(footing)
    from_stance = zmp - footing.sole(footing.stance)[:2]
    wanted = min(1.0, max(0.0, float(from_stance.dot(along) / along.dot(along))))
    pull, counter = (
        np.array((sense.wrenches[foot] or (0.0, 0.0))[:2]) for foot in (other, footing.stance)
    )
    give = np.array([*((1.0 - part) * pull - part * counter), (part - wanted) * total])
    share = min(1.0, 2.0 * part)
    anchor = footing.anchors[other]
    anchor += dt * _FOLLOW * share * (footing.sole(other) - anchor)
    return (1.0 - share) * velocity + share / weight * np.array(_GIVE) * give


def _between(footing: Footing) -> Vector2:
    """From the stance to the other foot, along the ground [m]."""
    return (footing.sole(footing.other) - footing.sole(footing.stance))[:2]


class VelocityTasks:
    """The two levels of (19) as tasks of a stack, with (17b) and (17d) for torso and sole."""

    def __init__(
        self,
        biped: Biped,
        dt: float,
        numbers: VelocityNumbers,
        limbs: Sequence[JointTask],
        *,
        rotator: bool,
    ) -> None:
        self._biped, self._dt, self._numbers = biped, dt, numbers
        self._led = [task.name for task in limbs]
        self._lean = TrunkPose(biped.relief, dt, np.zeros((3, 2)))
        self._grounds = SoleGrounds(dt)
        self._rotator = rotator
        self._com = ComTask()
        self._momentum = MomentumTask("angular_xy")
        self._torso = FrameTask(biped.robot.torso, "orientation", name="torso")
        self._turns = [FrameTask(s, "orientation", name=f"{s} level") for s in biped.soles]
        self._places = [FrameTask(s, "position", name=f"{s} place") for s in biped.soles]
        self._contacts = [SurfaceContact(sole) for sole in biped.soles]
        self.stack = Stack(
            contacts=self._contacts,
            levels=[
                [self._com, *self._turns],
                [self._momentum, self._torso, *self._places],
                *([limbs] if limbs else []),
            ],
            joint_limit=JointLimit(position_margin=0.0, position_range=biped.knees),
            self_collision_limit=SelfCollisionLimit(legs_only=True, margin=CLEARANCE),
        )
        self.stack.bind(biped.robot)
        self.reset()

    def reset(self) -> None:
        """No foot is the stance yet."""
        self._stance = -1
        self._lean.reset()
        self._grounds.reset()

    def controller(self, dynamics: Dynamics, time_limit: float | None) -> Controller:
        """Make the controller, (19) to (23)."""
        refuse_solver_settings(ControllerPlan(name="differential_ik", time_limit=time_limit))
        robot = self._biped.robot
        return DifferentialIK(
            robot,
            self.stack,
            dt=self._dt,
            joints=[robot.joint_names[j] for leg in self._biped.legs for j in leg.joints],
            led=self._led,
            limit_time=10.0 * self._dt,
            dynamics=dynamics,
        )

    def ask(
        self,
        footing: Footing,
        *,
        com: Vector3,
        cart_table_zmp: Vector2,
        momentum: Vector2,
        foot: Vector3,
        upright: bool,
    ) -> None:
        """Set contacts, v_d of (16) and weights for a tick."""
        biped, dynamics = self._biped, footing.dynamics
        stance, other = footing.stance, footing.other
        if stance != self._stance:
            self._stance = stance
            self._contacts[stance].engage(0.0)
            self._contacts[other].release(0.0)
        # A controller with one foot as its contact has no tasks for feet at rest.
        self.stack.self_collision_limit.rest(not footing.mode.single)
        self._grounds.update(footing)
        # The whole robot turns about the stance sole, which is turned onto its ground.
        rate = self._righting(footing, stance)
        frames = biped.frames
        (centre, _), (place, _) = (dynamics.placement(frames[foot]) for foot in (stance, other))
        # Turned by its base alone, joint 1, the robot is rigid: A_G has its inertia about the
        # base's axes.
        world_R_base = dynamics.joint_rotation(1)
        turned = dynamics.momentum_matrix[3:5, 3:6].dot(rate.dot(world_R_base))
        _, torso = footing.torso
        self._com.set_velocity(com - _across(rate, dynamics.com - centre))
        self._turns[other].set_velocity(self._other_sole(footing) - rate)
        self._momentum.set_velocity(momentum - turned)
        self._torso.set_velocity(self._upright(torso, self._lean.rotations(footing, 0.0)[0]) - rate)
        if not footing.mode.single:
            # What is measured lags behind a shift; by what is commanded the robot would sway by a
            # centimetre at rest.
            zmp = footing.sense.zmp if footing.mode is Mode.D else cart_table_zmp
            foot = yielding_velocity(footing, foot, zmp, self._dt)
        self._places[other].set_velocity(foot - _across(rate, place - centre))
        weighed = self._momentum, self._torso, self._places[other]
        for task, weight in zip(weighed, self._weights(footing, upright=upright), strict=True):
            task.set_weight((weight / DifferentialIK.ROW_WEIGHT) ** 0.5)

    def _weights(self, footing: Footing, *, upright: bool) -> tuple[float, float, float]:
        """W_A of momentum, torso and foot; (39c) and (39d) chatter with the measured ZMP."""
        p = self._numbers
        if not footing.mode.single:
            return p.epsilon, p.w_B, p.w_S2
        # Firm on the ground, so that momentum does not drag the foot; the paper's once clear of it.
        clear = footing.clearance(footing.ground_below)
        foot = p.w_S2 ** (1.0 - clear) * p.w_S1**clear
        if not self._rotator:
            return p.epsilon, p.w_B, foot
        # A torso that leans as far as the momentum asks for takes the hips to their limits.
        torso = p.w_B1 * (1.0 + (footing.tilt / p.tilt_soft) ** 4)
        return p.w_L, p.w_B if upright else torso, foot

    def _other_sole(self, footing: Footing) -> Float64[np.ndarray, "3"]:
        """Eq. (17d), parallel to the stance's ground; one that carries yields instead [rad/s]."""
        other, grounds = footing.other, self._grounds
        _, attitude = footing.dynamics.placement(footing.biped.frames[other])
        turn = self._upright(attitude, grounds.rotation(footing.stance))
        yielding = None if footing.mode.single else yielding_turn(footing)
        if yielding is not None:
            turn[:2] = yielding + self._righting(footing, other)[:2]
        return turn

    def _righting(self, footing: Footing, foot: int) -> Float64[np.ndarray, "3"]:
        p = self._numbers
        return saturate(p.omega_lim, self._grounds.righting(footing, foot, p.k_level))

    def _upright(
        self,
        rotation: Float64[np.ndarray, "3 3"],
        target: Float64[np.ndarray, "3 3"] = LEVEL,
    ) -> Float64[np.ndarray, "3"]:
        """Eqs (17b) and (17d) [rad/s]."""
        p = self._numbers
        return saturate(p.omega_lim, p.k_omega * rotation_vector(target, rotation))


def _across(rate: Vector3, arm: Vector3) -> Vector3:
    """Return rate x arm, of a rate about level axes."""
    (wx, wy, _), (x, y, z) = rate.tolist(), arm.tolist()
    return np.array([wy * z, -wx * z, wx * y - wy * x])
