"""`Footing`: mode, soles and trunk of one tick, with `StanceChoice` and `TrunkPose`."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.locomotion._stepping._stance._estimator import StanceEstimator, ZmpSensor
from poise.locomotion._stepping._stance._parameters import Biped
from poise.locomotion._support import (
    Rotation,
    SingleSupportRegion,
    SolePart,
    SupportPolygon,
    Vector2,
    Vector3,
    both_soles,
)
from poise.locomotion._walking import Mode, turn_to_left, wrapped

POSITION_GAIN = 10.0
"""k_v of (17a) and (17c), from distances to velocities of CoM and feet [1/s]."""


@dataclass(slots=True, kw_only=True, eq=False)
class DesiredMotion:
    """v_d of (16), less what is kept level and upright by itself, and the CoM's acceleration."""

    com: Vector3  # velocity of the CoM [m/s]
    com_acceleration: Vector2  # of the CoM along the ground [m/s^2]
    momentum: Vector2  # angular, about the CoM, x and y [kg m^2/s]
    foot: Vector3  # velocity of the sole that is not the stance [m/s]


LANDED = 0.047
"""Load at which a foot has landed, over the weight: 30 N of the paper's robot."""

_PRESS_SPEED = 0.1
"""Largest speed downwards of a foot without load in double support, for the paper's soles [m/s]."""

_CLEAR_HEIGHT = 0.04
"""Height above the ground from which a foot is free to move along it, for the paper's robot [m]."""

_LOAD_RATIO = 1.2
"""In double support a foot becomes the stance that carries this many times the other's load."""


class StanceChoice:
    """Keeps the estimator's stance and the feet's places up to date."""

    def __init__(
        self, estimator: StanceEstimator, sensor: ZmpSensor, biped: Biped, dt: float
    ) -> None:
        self._estimator, self._sensor = estimator, sensor
        self._least_load = LANDED * biped.weight
        self._speed, self._dt = _PRESS_SPEED * biped.wide, dt
        self._pressing, self.pressed = False, 0.0

    def begin(self, before: Mode, mode: Mode) -> None:
        """Place a foot that has landed, and stand on the other of one that is lifted."""
        estimator = self._estimator
        if mode is Mode.D and before.single:
            estimator.put_down(1 - estimator.stance)
        if mode.single and mode.support is not None:
            estimator.stand_on(mode.support)

    def follow(self, mode: Mode) -> None:
        """Each tick with both feet on the ground: the one that carries more is the stance."""
        if mode.single:
            return
        estimator, loads = self._estimator, self._sensor.loads
        stance = estimator.stance
        if loads[1 - stance] > _LOAD_RATIO * loads[stance]:
            estimator.stand_on(1 - stance)
        other = 1 - estimator.stance
        # One that is about to be lifted is to lose its load.
        if mode.support in (None, other):
            self._press(other)
        else:
            self._pressing, self.pressed = False, 0.0

    def _press(self, foot: int) -> None:
        """Sends a foot down until it carries something."""
        anchor, height = self._estimator.anchors[foot], float(self._estimator.sole(foot)[2])
        if self._sensor.loads[foot] < self._least_load:
            anchor[2] = min(float(anchor[2]), height)
            deeper = self.pressed + self._dt * self._speed
            self.pressed = min(deeper, self._speed / POSITION_GAIN)
            self._pressing = True
        elif self._pressing:
            anchor[2], self._pressing, self.pressed = height, False, 0.0


@dataclass(kw_only=True, eq=False)
class Footing:
    """State, mode and stance of a tick; places stay those of the tick when `dynamics` moves on."""

    biped: Biped
    estimator: StanceEstimator
    mode: Mode
    stance: int  # foot that is taken to be at rest; the stance foot in single support
    omega: float  # sqrt(g / H) [1/s]
    region: SingleSupportRegion
    sensor: ZmpSensor
    pressed: float = 0.0  # how far below its place the other foot is sent in double support [m]
    parts: Sequence[SolePart | None] = (None, None)  # loaded areas; None for all of a sole
    com_velocity: Vector2 | None = None  # observed; that of `dynamics` when None
    has_left: bool = True  # the swing foot has left the ground

    def __post_init__(self) -> None:
        biped, estimator = self.biped, self.estimator
        # Places where each sole was last put down [m].
        self.anchors, self.dynamics = estimator.anchors, estimator.dynamics
        self.other, placement = 1 - self.stance, self.dynamics.placement
        sense = estimator.sense
        self.soles = sense.sole(0), sense.sole(1)
        self.pelvis, self.torso = placement(biped.pelvis), placement(biped.torso)
        self.com = self.dynamics.com
        left, right = sense.rotations
        self.yaws = math.atan2(left[3], left[0]), math.atan2(right[3], right[0])

    @cached_property
    def zmp_reference(self) -> Vector2:
        """Eq. (15a): between the feet, or on the foot that shall carry [m]."""
        carries = self.mode.support
        if carries is None:
            (x, y, _), (other_x, other_y, _) = self.sole(0).tolist(), self.sole(1).tolist()
            return np.array([0.5 * (x + other_x), 0.5 * (y + other_y)])
        return np.array(self.region.rest(carries, self.anchors[carries], self.soles[carries][1]))

    @cached_property
    def heading(self) -> Vector2:
        """Unit vector where the pelvis faces, along the ground: legs cross or not as it turns."""
        (x, _, _), (y, _, _), _ = self.pelvis[1].tolist()
        length = math.hypot(x, y)
        return np.array([x / length, y / length])

    @property
    def tilt(self) -> float:
        """Angle of the torso against upright [rad]."""
        return math.acos(max(-1.0, min(1.0, float(self.torso[1][2, 2]))))

    @cached_property
    def support(self) -> SupportPolygon:
        """Support of the soles on the ground, with a margin."""
        if self.mode.single:
            return self.region.support(self.stance, *self.soles[self.stance])
        return both_soles(self.soles, self.biped.sizes, self.region.margin, self.parts)

    @cached_property
    def capture_depth(self) -> float:
        """Depth of the DCM p + pdot / omega inside the support [m]."""
        velocity = self.com_velocity
        velocity = self.dynamics.com_velocity[:2] if velocity is None else velocity
        (x, y, _), (speed_x, speed_y) = self.com.tolist(), velocity.tolist()
        return self.support.depth((x + speed_x / self.omega, y + speed_y / self.omega))

    def sole(self, foot: int) -> Vector3:
        """Return the position of a sole's centre [m]."""
        return self.soles[foot][0]

    @property
    def ground(self) -> float:
        """Height of the ground that carries: of the stance foot, or the middle of both feet [m]."""
        if self.mode.single:
            return float(self.anchors[self.stance][2])
        return 0.5 * float(self.anchors[0][2] + self.anchors[1][2])

    @property
    def lowest_ground(self) -> float:
        """Height of the lower of the places where the feet were put down [m]."""
        return min(float(self.anchors[0][2]), float(self.anchors[1][2]))

    @property
    def highest_ground(self) -> float:
        """Height of the higher of them [m]."""
        return max(float(self.anchors[0][2]), float(self.anchors[1][2]))

    @property
    def ground_below(self) -> float:
        """Height of the ground that the foot that is not the stance may touch [m]."""
        return self.lowest_ground if self.has_left else float(self.anchors[self.other][2])

    def clearance(self, ground: float) -> float:
        """Return the clearance of the other foot over a ground, from 0 on it to 1."""
        clear = _CLEAR_HEIGHT * self.biped.tall
        return min(1.0, max(0.0, (float(self.sole(self.other)[2]) - ground) / clear))


_RATE = 0.3
"""Rate of the lean over a foot, and back [rad/s]."""

_TURN_RATE, _POSE_RATE = 0.5, 0.6
"""Rates of the trunk towards the heading of the feet, and towards the command [rad/s]."""

TORSO_MOST = (0.3, 0.4, 0.5)
"""Roll, pitch and yaw of the torso that can be commanded: what most waists do [rad]."""

UPRIGHT = (0.0, 0.0, 0.0)
LEVEL = np.eye(3)


class TrunkLean:
    """Upright, or leaning over the foot that carries where its hip needs that."""

    def __init__(self, relief: tuple[float, float], dt: float) -> None:
        self._goals = (-relief[0], relief[1])
        self._step = _RATE * dt
        self._angle = 0.0

    def reset(self) -> None:
        """Upright."""
        self._angle = 0.0

    def rotation(self, footing: Footing) -> Rotation:
        """Return world_R_trunk of this tick."""
        carries = footing.mode.support
        goal = 0.0 if carries is None else self._goals[carries]
        self._angle += max(-self._step, min(self._step, goal - self._angle))
        if self._angle == 0.0:
            return LEVEL
        x, y = footing.heading.tolist()
        return pin.exp3(self._angle * np.array([x, y, 0.0]))


class TrunkPose:
    """References of pelvis and torso, where both can be turned."""

    def __init__(
        self, relief: tuple[float, float], dt: float, waist: Float64[np.ndarray, "3 2"]
    ) -> None:
        self._lean, self._dt = TrunkLean(relief, dt), dt
        self._waist: list[list[float]] = waist.tolist()
        self.reset()

    def reset(self) -> None:
        """Upright, facing as the feet do."""
        self._lean.reset()
        self._facing: float | None = None
        self._torso = UPRIGHT

    @property
    def upright(self) -> bool:
        """True while the torso is in line with the pelvis, as commanded."""
        return self._torso == UPRIGHT

    def rotations(
        self, footing: Footing, facing: float, torso: tuple[float, float, float]
    ) -> tuple[Rotation, Rotation]:
        """World_R_pelvis and world_R_torso in this tick."""
        before = facing if self._facing is None else self._facing
        most = _TURN_RATE * self._dt
        # The shorter way, also where angles pass from pi to -pi.
        turn = wrapped(facing - before)
        self._facing = before + max(-most, min(most, turn))
        if torso != self._torso:
            self._torso = self._moved(torso)
        pelvis = self._lean.rotation(footing)
        if self._facing != 0.0:
            turn = turn_to_left(self._facing)
            pelvis = turn if pelvis is LEVEL else pelvis.dot(turn)
        if self.upright:
            return pelvis, pelvis
        turned = pelvis @ pin.rpy.rpyToMatrix(np.array(self._torso))
        pairs = zip(self._torso, self._waist, strict=True)
        bent = tuple(max(least, min(most, angle)) for angle, (least, most) in pairs)
        if bent != self._torso:
            # What the waist cannot do the pelvis does: asked to stay upright beneath a torso that
            # is asked to bend, both would go half the way.
            pelvis = turned @ pin.rpy.rpyToMatrix(np.array(bent)).T
        return pelvis, turned

    def _moved(self, torso: tuple[float, float, float]) -> tuple[float, float, float]:
        """Roll, pitch and yaw of the torso, rate-limited towards what is commanded [rad]."""
        most = _POSE_RATE * self._dt
        roll, pitch, yaw = (
            before + max(-most, min(most, max(-largest, min(largest, angle)) - before))
            for before, angle, largest in zip(self._torso, torso, TORSO_MOST, strict=True)
        )
        return roll, pitch, yaw
