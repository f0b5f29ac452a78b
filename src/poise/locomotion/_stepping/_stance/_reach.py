"""`FootRange`: where the feet can go, and how far the body must come down for them to."""

import math

import numpy as np
from jaxtyping import Float64

from poise.dynamics import Dynamics
from poise.locomotion._stepping._stance._biped import Biped, LegGeometry, leg_geometry
from poise.locomotion._stepping._stance._parameters import TeleopParameters
from poise.locomotion._support import Point
from poise.locomotion._walking import CLEARANCE

GIVES = 0.01
"""Distance of the hip below where a knee holds it, beyond which the swing foot is put down [m]."""

_MARGIN = 0.02
"""Part of the leg's length by which a commanded foot stays within it."""

_FOLD, _SERVO_FOLD = 0.78, 0.5
"""Least distance of hip and ankle of a leg that carries, over its length: by torques the stack's
balance limit keeps 0.75, and brakes before it. Asked for less, a descending body
would be thrown up by that."""

_NARROW_GAP = 0.09
"""Least distance of narrow soles' edges by torques, over the COM's height: one behind the other, as
on a rope, they hold no push aside."""

_ROLL_RATIO = 0.8
"""Part of the ankle's roll that may be used for standing with the feet apart."""

_LEAN_RATIO = 0.9
"""Part of the ankle's pitch that the shank may lean forward by."""

_SHARED = 0.5
"""Part of the weight that a leg holds beside the other one."""

_TURNED = 0.05
"""Soles that are turned by less than this against where the robot faces lie side by side [rad]."""

_ROUNDING = 1e-6
"""An edge whose normal points aside by less than this faces ahead."""

_SPARE = 0.08
"""How much farther apart than they may be led feet may stand where the robot has put them [m]:
from twice as far apart as at home a shift takes an ankle of G1 beyond the end of its roll."""


class FootRange:
    """Keep a swing foot on its side of the other, and its ankle in a sphere around the hip."""

    def __init__(self, biped: Biped, parameters: TeleopParameters, *, servos: bool) -> None:
        robot, soles = biped.robot, biped.soles
        self._pelvis = robot.frame_id(robot.pelvis)
        self._legs = [leg_geometry(robot, name) for name in soles]
        # A few numbers each tick are several times as quick as such than as arrays.
        self._ankles: list[list[float]] = [leg.ankle.tolist() for leg in self._legs]
        self._reach = [(1.0 - _MARGIN) * leg.length for leg in self._legs]
        self._fold = [(_SERVO_FOLD if servos else _FOLD) * leg.length for leg in self._legs]
        # Held up by its knee: alone, and beside the other one.
        self._strong = [(_strong_lean(leg, 1.0), _strong_lean(leg, _SHARED)) for leg in self._legs]
        # A level sole beside the hip takes as much roll of the ankle as the leg leans.
        sides = [
            reach * float(np.sin(min(_ROLL_RATIO * leg.roll_max, 0.5 * np.pi)))
            + abs(float(leg.hip[1]))
            for leg, reach in zip(self._legs, self._reach, strict=True)
        ]
        sizes = [robot.soles[name] for name in soles]
        self._halves = [(0.5 * sole.length, 0.5 * sole.width) for sole in sizes]
        narrow = biped.size.narrow and not servos
        self._gap = max(CLEARANCE, _NARROW_GAP * biped.size.height if narrow else 0.0)
        self._apart = sum(width for _, width in self._halves) + self._gap
        self._step_max, self._lift_max = parameters.step_max, parameters.lift_max
        self._aside_max = max(self._apart, min(parameters.step_max, *sides))

    def hip(self, foot: int, dynamics: Dynamics) -> Float64[np.ndarray, "3"]:
        """Return the position of the hip of a foot's leg [m]."""
        position, rotation = dynamics.placement(self._pelvis)
        return position + rotation.dot(self._legs[foot].hip)

    def below_hip(self, foot: int, dynamics: Dynamics) -> tuple[float, float]:
        """Return x and y of a level sole whose ankle is below the hip of its leg [m]."""
        (x, y, _), (arm_x, arm_y, _) = self.hip(foot, dynamics).tolist(), self._ankles[foot]
        return x - arm_x, y - arm_y

    def bring_back(
        self,
        foot: int,
        target: tuple[float, float, float],
        support: Float64[np.ndarray, "3"],
        hip: Float64[np.ndarray, "3"],
        heading: Float64[np.ndarray, "2"],
        *,
        lower: float = 0.0,
        turns: tuple[float, float] = (0.0, 0.0),
    ) -> Float64[np.ndarray, "3"]:
        """The nearest position that the foot can be sent to."""
        (x, y, z), (support_x, support_y, support_z) = target, support.tolist()
        forward_x, forward_y = heading.tolist()
        across_x, across_y = (-forward_y, forward_x) if foot == 0 else (forward_y, -forward_x)
        x, y, z = x - support_x, y - support_y, min(z, support_z + self._lift_max)
        aside, ahead = x * across_x + y * across_y, x * forward_x + y * forward_y
        ahead = min(max(ahead, -self._step_max), self._step_max)
        apart = self._apart
        if max(map(abs, turns)) > _TURNED:
            apart = max(apart, self._gap + self._clear(foot, ahead, turns))
        aside = min(max(aside, apart), max(self._aside_max, apart))
        x = support_x + aside * across_x + ahead * forward_x
        y = support_y + aside * across_y + ahead * forward_y
        # Across the ground only: how far down a foot gets is for the ground and the knee to say.
        (arm_x, arm_y, arm_z), (hip_x, hip_y, hip_z) = self._ankles[foot], hip.tolist()
        drop = hip_z - arm_z - max(z, support_z) - lower
        room = math.sqrt(max(self._reach[foot] ** 2 - drop * drop, 0.0))
        offset_x, offset_y = x + arm_x - hip_x, y + arm_y - hip_y
        distance = math.hypot(offset_x, offset_y)
        if distance > room:
            shorter = 1.0 - room / distance
            x, y = x - shorter * offset_x, y - shorter * offset_y
        return np.array([x, y, z])

    def _clear(self, foot: int, ahead: float, turns: tuple[float, float]) -> float:
        """How far aside the centre of a turned sole has to be for its edges to be clear [m].

        Where two convex shapes touch, an edge of one of them lies between them.
        """
        out = 1.0 if foot == 0 else -1.0
        needed = math.inf
        for edge in turns:
            for x, y in ((math.cos(edge), math.sin(edge)), (-math.sin(edge), math.cos(edge))):
                # To the foot's own side; an edge that faces ahead alone asks for no room there.
                x, y = (x, y) if out * y > 0.0 else (-x, -y)
                if out * y > _ROUNDING:
                    halves = zip(self._halves, turns, strict=True)
                    size = sum(_half_across(x, y, *half, turn) for half, turn in halves)
                    needed = min(needed, (size - x * ahead) / abs(y))
        return needed

    def spans(
        self,
        left: Float64[np.ndarray, "3"],
        right: Float64[np.ndarray, "3"],
        heading: Float64[np.ndarray, "2"],
    ) -> bool:
        """Return whether feet stand hardly farther apart than commands may place them."""
        x, y, _ = (left - right).tolist()
        forward_x, forward_y = heading.tolist()
        aside, ahead = y * forward_x - x * forward_y, x * forward_x + y * forward_y
        return aside <= self._aside_max + _SPARE and abs(ahead) <= self._step_max + _SPARE

    def too_high(
        self,
        foot: int,
        place: Float64[np.ndarray, "3"],
        hip: Float64[np.ndarray, "3"],
        shift: Point,
    ) -> float:
        """Return how far the hip is too high for a foot to reach a place [m]."""
        (x, y, z), (arm_x, arm_y, arm_z) = place.tolist(), self._ankles[foot]
        (hip_x, hip_y, hip_z), (shift_x, shift_y) = hip.tolist(), shift
        across = (x + arm_x - hip_x - shift_x) ** 2 + (y + arm_y - hip_y - shift_y) ** 2
        return hip_z - z - arm_z - math.sqrt(max(self._reach[foot] ** 2 - across, 0.0))

    def too_low(
        self,
        foot: int,
        place: Float64[np.ndarray, "3"],
        hip: Float64[np.ndarray, "3"],
        heading: Float64[np.ndarray, "2"],
        *,
        alone: bool,
    ) -> float:
        """How far the hip is too low for a leg that carries; negative for room [m].

        Its ankle keeps the sole level: a leg that bends leans its shank forward, the more so the
        further the hip is ahead. So its knee comes ahead of the weight, no farther than its torque
        holds that. And it folds no deeper than it may.
        """
        ahead, aside, z = self._to_hip(foot, place, hip, heading)
        lean = min(_LEAN_RATIO * self._legs[foot].lean_max, self._strong[foot][0 if alone else 1])
        folded = math.sqrt(max(self._fold[foot] ** 2 - ahead * ahead - aside * aside, 0.0))
        return max(self._level(foot, ahead, aside, lean), folded) - z

    def too_weak(
        self,
        foot: int,
        place: Float64[np.ndarray, "3"],
        hip: Float64[np.ndarray, "3"],
        heading: Float64[np.ndarray, "2"],
    ) -> float:
        """Return how far the hip is too low for the knee of a stance leg; negative for room."""
        ahead, aside, z = self._to_hip(foot, place, hip, heading)
        return self._level(foot, ahead, aside, self._strong[foot][0]) - z

    def _to_hip(
        self,
        foot: int,
        place: Float64[np.ndarray, "3"],
        hip: Float64[np.ndarray, "3"],
        heading: Float64[np.ndarray, "2"],
    ) -> tuple[float, float, float]:
        """From ankle to hip, forward, to the left and up [m]."""
        arm_x, arm_y, arm_z = self._ankles[foot]
        forward_x, forward_y = heading.tolist()
        (hip_x, hip_y, hip_z), (x, y, z) = hip.tolist(), place.tolist()
        x, y, z = hip_x - x - arm_x, hip_y - y - arm_y, hip_z - z - arm_z
        return x * forward_x + y * forward_y, y * forward_x - x * forward_y, z

    def _level(self, foot: int, ahead: float, aside: float, lean: float) -> float:
        """Height of the hip over the ankle with the shank so far forward [m]."""
        leg = self._legs[foot]
        # From the knee to the hip.
        thigh = leg.thigh**2 - (ahead - leg.shank * math.sin(lean)) ** 2 - aside * aside
        return leg.shank * math.cos(lean) + math.sqrt(max(thigh, 0.0))


def _half_across(x: float, y: float, length: float, width: float, turn: float) -> float:
    """Half of a turned rectangle's extent along a direction, from its own halves [m]."""
    c, s = math.cos(turn), math.sin(turn)
    return length * abs(x * c + y * s) + width * abs(y * c - x * s)


def _strong_lean(leg: LegGeometry, share: float) -> float:
    """How far forward a shank may lean for its knee to hold a part of the weight [rad].

    The weight rests on the middle of the sole.
    """
    ahead = leg.knee_lever / share - float(leg.ankle[0])
    return math.asin(min(max(ahead / leg.shank, 0.0), 1.0))
