"""`Footing`: mode, soles and trunk of one tick; `TrunkPose`: references of the trunk."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.locomotion._stepping._biped import Biped
from poise.locomotion._stepping._estimator import StanceEstimator
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

_CLEAR_HEIGHT = 0.04
"""Height above the ground from which a foot is free to move along it, for the paper's robot [m]."""


@dataclass(kw_only=True, eq=False)
class Footing:
    """State, mode and stance of a tick; places stay those of the tick when `dynamics` moves on."""

    biped: Biped
    estimator: StanceEstimator
    mode: Mode
    omega: float  # sqrt(g / H) [1/s]
    region: SingleSupportRegion
    parts: Sequence[SolePart | None] = (None, None)  # loaded areas; None for all of a sole
    com_velocity: Vector2 | None = None  # observed; that of `dynamics` when None
    has_left: bool = True  # the swing foot has left the ground

    def __post_init__(self) -> None:
        biped, estimator = self.biped, self.estimator
        # Places where each sole was last put down [m].
        self.anchors, self.dynamics = estimator.anchors, estimator.dynamics
        # The foot that is taken to be at rest: the stance foot in single support.
        self.stance, self.pressed = estimator.stance, estimator.pressed
        self.other, placement = 1 - self.stance, self.dynamics.placement
        self.sense = sense = estimator.sense
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


_RATE = 0.5
"""Rate of the trunk towards a lean over a foot, the heading of the feet and the command [rad/s]."""

TORSO_MOST = (0.3, 0.4, 0.5)
"""Largest commanded roll, pitch and yaw of the torso: the range of most waists [rad]."""

UPRIGHT = (0.0, 0.0, 0.0)
LEVEL = np.eye(3)


class TrunkPose:
    """References of pelvis and torso: upright, or leaning over a foot for a weak hip."""

    def __init__(
        self, relief: tuple[float, float], dt: float, waist: Float64[np.ndarray, "3 2"]
    ) -> None:
        self._goals, self._dt = (-relief[0], relief[1]), dt
        self._waist: list[list[float]] = waist.tolist()
        self.reset()

    def reset(self) -> None:
        """Upright, facing as the feet do."""
        self._lean = 0.0
        self._facing: float | None = None
        self._torso = UPRIGHT

    @property
    def upright(self) -> bool:
        """True while the torso is in line with the pelvis, as commanded."""
        return self._torso == UPRIGHT

    def rotations(
        self, footing: Footing, facing: float, torso: tuple[float, float, float] = UPRIGHT
    ) -> tuple[Rotation, Rotation]:
        """Return world_R_pelvis and world_R_torso of this tick."""
        carries = footing.mode.support
        goal = 0.0 if carries is None else self._goals[carries]
        self._lean = _towards(self._lean, goal, _RATE * self._dt)
        before = facing if self._facing is None else self._facing
        # The shorter way, also where angles pass from pi to -pi.
        self._facing = _towards(before, before + wrapped(facing - before), _RATE * self._dt)
        pelvis = LEVEL
        if self._lean != 0.0:
            x, y = footing.heading.tolist()
            pelvis = pin.exp3(self._lean * np.array([x, y, 0.0]))
        if self._facing != 0.0:
            turn = turn_to_left(self._facing)
            pelvis = turn if pelvis is LEVEL else pelvis.dot(turn)
        if torso != self._torso:
            roll, pitch, yaw = (
                _towards(now, max(-most, min(most, angle)), _RATE * self._dt)
                for now, angle, most in zip(self._torso, torso, TORSO_MOST, strict=True)
            )
            self._torso = roll, pitch, yaw
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


def _towards(now: float, goal: float, most: float) -> float:
    return now + max(-most, min(most, goal - now))
