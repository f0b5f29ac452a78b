"""Stack of the velocity level: `VelocityTasks` and `VelocityNumbers`."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from poise.control import (
    Controller,
    ControllerPlan,
    DifferentialIK,
    refuse_solver_settings,
)
from poise.dynamics import Dynamics, rotation_vector, saturate
from poise.locomotion._stepping._by_velocity._soles import SoleGrounds, SoleYield
from poise.locomotion._stepping._stance import (
    BASE_JOINT,
    LEVEL,
    Biped,
    DesiredMotion,
    Footing,
    TrunkPose,
)
from poise.locomotion._walking import CLEARANCE, Mode
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

    acceleration_max: float  # a_lim [m/s^2]
    r_lift: float  # distance of ZMP and reference at which a foot may leave the ground [m]
    capture_max: float  # largest distance of the DCM from the stance foot at lift-off [m]
    ct_zmp_max: float  # largest distance of the CT-ZMP from there [m]
    w_L: float  # weight of the angular momentum in single support
    lift_speed: float  # largest vertical speed of the COM [m/s]
    lift_acceleration: float  # largest vertical acceleration of the COM [m/s^2]
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
    velocity_leak: float = 5.0  # decay of the commanded COM velocity into the measured one [1/s]


def velocity_numbers(biped: Biped) -> VelocityNumbers:
    """Scale the numbers from the paper's robot: 65 kg, feet 0.42 m apart.

    The first swing of the ZMP, a_lim / omega^2, keeps its ratio to the COM's height; `r_lift` keeps
    its ratio to the distance of the feet, within half a sole. Angular momentum weighs as much as
    the paper's beside the swing foot's velocity: it goes with m h.
    """
    return VelocityNumbers(
        acceleration_max=biped.by_stiffness(0.8 * biped.tall),
        r_lift=min(0.12 * biped.apart / 0.42, biped.half_sole),
        capture_max=0.06 * biped.wide,
        ct_zmp_max=0.12 * biped.wide,
        w_L=(65.0 / biped.robot.mass / biped.tall) ** 2,
        lift_speed=0.3 * biped.tall,
        lift_acceleration=1.5 * biped.tall,
    )


_LIMIT_TIME = 0.05
"""Time in which a joint may at most reach its position limit [s]."""


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
        self._grounds, self._yield = SoleGrounds(dt), SoleYield(dt)
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
        """Solves the stack, (19) to (23)."""
        refuse_solver_settings(ControllerPlan(name="differential_ik", time_limit=time_limit))
        robot = self._biped.robot
        return DifferentialIK(
            robot,
            self.stack,
            dt=self._dt,
            joints=[robot.joint_names[j] for leg in self._biped.legs for j in leg.joints],
            led=self._led,
            limit_time=_LIMIT_TIME,
            dynamics=dynamics,
        )

    def ask(self, footing: Footing, desired: DesiredMotion, *, upright: bool) -> None:
        """Sets contacts, velocities and weights for a tick."""
        biped, dynamics, other = self._biped, footing.dynamics, footing.other
        self._stand_on(footing.stance)
        # Feet that stand are no matter of a controller that knows one of them as a contact.
        self.stack.self_collision_limit.rest(not footing.mode.single)
        self._grounds.update(footing)
        turn = _Turn(footing, self._righting(footing, footing.stance))
        place, _ = dynamics.placement(biped.frames[other])
        _, torso = dynamics.placement(biped.torso)
        self._com.set_velocity(desired.com - turn.velocity_at(dynamics.com))
        self._turns[other].set_velocity(self._other_sole(footing) - turn.rate)
        self._momentum.set_velocity(desired.momentum - turn.momentum())
        self._torso.set_velocity(
            self._upright(torso, self._lean.rotations(footing, 0.0)[0]) - turn.rate
        )
        foot = desired.foot
        if not footing.mode.single:
            zmp = footing.sense.zmp
            if footing.mode is not Mode.D:
                # The CT-ZMP (26) of the commanded acceleration: what is measured lags behind a
                # shift. At rest it is what is measured, or the robot would sway by a centimetre.
                zmp = dynamics.com[:2] - desired.com_acceleration / footing.omega**2
            foot = self._yield.move(footing, foot, zmp)
        self._places[other].set_velocity(foot - turn.velocity_at(place))
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
        yielding = None if footing.mode.single else self._yield.turn(footing)
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

    def _stand_on(self, foot: int) -> None:
        if foot == self._stance:
            return
        self._stance = foot
        self._contacts[foot].engage(0.0)
        self._contacts[1 - foot].release(0.0)


class _Turn:
    """Motion of the whole robot about a stance sole that is turned onto its ground, at a rate."""

    def __init__(self, footing: Footing, rate: Float64[np.ndarray, "3"]) -> None:
        self._footing, self.rate = footing, rate
        self._sole, _ = footing.dynamics.placement(footing.biped.frames[footing.stance])

    def velocity_at(self, point: Float64[np.ndarray, "3"]) -> Float64[np.ndarray, "3"]:
        """Velocity of a point of the robot, rate x (point - sole) [m/s]."""
        (x, y, z), (sole_x, sole_y, sole_z) = point.tolist(), self._sole.tolist()
        wx, wy, _ = self.rate.tolist()
        x, y, z = x - sole_x, y - sole_y, z - sole_z
        return np.array([wy * z, -wx * z, wx * y - wy * x])

    def momentum(self) -> Float64[np.ndarray, "2"]:
        """Angular momentum about the COM, x and y [kg m^2/s]."""
        dynamics = self._footing.dynamics
        world_R_base = dynamics.joint_rotation(BASE_JOINT)
        # Turned by its base alone the robot is rigid: A_G has its inertia about the base's axes.
        return dynamics.momentum_matrix[3:5, 3:6].dot(self.rate.dot(world_R_base))
