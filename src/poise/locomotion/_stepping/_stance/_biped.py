"""Legs of a robot that is stepped: `LegGeometry`, `Biped` and `FootRange`."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from poise.dynamics import Dynamics, RobotState
from poise.errors import ConfigurationError
from poise.locomotion._stepping._stance._parameters import RobotSize, TeleopParameters
from poise.locomotion._support import Point, Vector2, Vector3, two_soles
from poise.locomotion._walking import CLEARANCE
from poise.robots import GRAVITY, Robot

KNEE = 3
"""Place of the knee among the joints of a leg: behind the hip's three, in any order."""

BASE_JOINT = 1
"""Pinocchio's index of the floating base; joint 0 is the world."""

_KNEE_MIN = 0.08
"""Least bend of a knee: straighter the leg is singular [rad]."""

_KNEE_LOAD, _HIP_LOAD, _RANGE = 0.7, 0.75, 0.8
"""Parts of a joint's torque and of its range to stand with: the rest raises the body again, and
swings the other leg."""

_PITCH, _ROLL = 1, 0
"""Axes of the ankle in the body: across the leg and along the foot."""


def leg_joints(robot: Robot, sole: str) -> list[int]:
    """Joints from the hip to a sole, as indices among the robot's joints; a waist is no part."""
    # Joint 0 is the world, joint 1 the floating base.
    joints = [j - 2 for j in robot.leg_joints(sole)]
    if len(joints) < 6:
        raise ConfigurationError(
            f"the leg of {sole} has too few joints for step teleoperation",
            got=[robot.joint_names[j] for j in joints],
            wanted="six joints or more",
        )
    return joints


@dataclass(frozen=True, kw_only=True, eq=False)
class LegGeometry:
    """Thigh and shank between ankle and hip, the point nearest to the axes of the hip's joints."""

    hip: Vector3  # in the pelvis's frame [m]
    ankle: Vector3  # origin of the last joint, in the sole's frame [m]
    length: float  # from hip to ankle with the knee as straight as it may be [m]
    thigh: float  # from hip to knee [m]
    shank: float  # from knee to ankle [m]
    knee_range: tuple[float, float]  # angles of the knee that leave it bent [rad]
    lean_max: float  # largest lean of the shank forward over a level sole [rad]
    roll_max: float  # largest lean to either side [rad]
    knee_lever: float  # distance of the knee from the line of the weight at which it holds all [m]
    relief: float  # lean of the body over the stance foot that a weak hip needs [rad]


def leg_geometry(robot: Robot, sole: str) -> LegGeometry:
    """Measures a leg, with its knee as straight as it may be and the others near to zero."""
    joints = leg_joints(robot, sole)
    lower, upper = robot.q_min[joints].copy(), robot.q_max[joints].copy()
    dynamics = Dynamics(robot)
    knee_range = _knee_range(dynamics, sole)
    relief = _hip_relief(dynamics, sole)
    lower[KNEE], upper[KNEE] = max(lower[KNEE], knee_range[0]), min(upper[KNEE], knee_range[1])
    angles = np.clip(0.0, lower, upper)
    hip, axes = _leg_at(dynamics, sole, angles)
    origins = np.array([dynamics.joint_position(j + 2) for j in joints])
    foot, pelvis = (
        dynamics.frame(robot.frame_id(sole)),
        dynamics.frame(robot.frame_id(robot.pelvis)),
    )
    knee, ankle = origins[KNEE], origins[-1]
    return LegGeometry(
        hip=pelvis.rotation.T @ (hip - pelvis.position),
        ankle=foot.rotation.T @ (ankle - foot.position),
        length=float(np.linalg.norm(ankle - hip)),
        thigh=float(np.linalg.norm(knee - hip)),
        shank=float(np.linalg.norm(ankle - knee)),
        knee_range=knee_range,
        lean_max=_range_about(axes @ foot.rotation, _PITCH, lower, upper)[0],
        roll_max=min(_range_about(axes @ foot.rotation, _ROLL, lower, upper)),
        knee_lever=_knee_lever(robot, joints),
        relief=relief,
    )


def _knee_lever(robot: Robot, joints: list[int]) -> float:
    """Lever at which a knee holds all that is above it, by what of its torque it may [m]."""
    below = sum(float(robot.model.inertias[j + 2].mass) for j in joints[KNEE:])
    torque = float(robot.tau_max[joints[KNEE]])
    return _KNEE_LOAD * torque / (GRAVITY * (robot.mass - below))


_RELIEF_MAX = 0.2
"""The body leans over the foot that carries by no more [rad]."""


def _hip_relief(dynamics: Dynamics, sole: str) -> float:
    """Return the lean of the body over a foot with which its hip carries it alone [rad]."""
    # Upright the leg of length l is turned in by y / l and the hip holds the weight at the lever y.
    # A lean phi takes back phi of the turn, and weight times height over the hip times phi.
    robot = dynamics.robot
    joints = leg_joints(robot, sole)
    hip, axes = _leg_at(dynamics, sole, robot.q_home[7 + np.array(joints)])
    roll = max(range(KNEE), key=lambda j: abs(float(axes[j, _ROLL])))
    joint = joints[roll]
    pelvis, _ = dynamics.placement(robot.frame_id(robot.pelvis))
    ankle = dynamics.joint_position(joints[-1] + 2)
    model = robot.model
    leg = sum(float(model.inertias[j + 2].mass) for j in joints)
    carried = robot.mass - leg
    levers = [model.inertias[j + 2].mass * dynamics.joint_position(j + 2) for j in joints]
    middle = (robot.mass * dynamics.com - np.sum(levers, axis=0)) / carried
    offset = abs(float(hip[1] - pelvis[1]))
    # The leg's own weight, half way, has to be balanced by the body's.
    moment = GRAVITY * (carried + 0.5 * leg) * offset
    height = max(float(middle[2] - hip[2]), 0.1 * float(hip[2]))
    lacking = moment - _HIP_LOAD * float(robot.tau_max[joint]) * abs(float(axes[roll, _ROLL]))
    inwards = float(axes[roll, _ROLL]) * (1.0 if hip[1] < pelvis[1] else -1.0) > 0.0
    home = float(robot.q_home[7 + joint])
    limit = robot.q_max[joint] - home if inwards else home - robot.q_min[joint]
    turn = offset / float(hip[2] - ankle[2]) - _RANGE * float(limit)
    return min(max(lacking / (GRAVITY * carried * height), turn, 0.0), _RELIEF_MAX)


def _leg_at(
    dynamics: Dynamics, sole: str, angles: Float64[np.ndarray, " n"]
) -> tuple[Vector3, Float64[np.ndarray, "n 3"]]:
    """Takes a leg's joints to some angles [rad]; its hip [m], and the axes of its joints."""
    robot = dynamics.robot
    joints = np.array(leg_joints(robot, sole))
    q = robot.q_home.copy()
    q[7 + joints] = angles
    dynamics.update(RobotState(q, np.zeros(robot.nv)))
    axes = dynamics.frame(robot.frame_id(sole)).jacobian[3:, robot.base_dofs + joints].T
    # Pinocchio counts the world and the floating base before the joints.
    origins = np.array([dynamics.joint_position(int(j) + 2) for j in joints[:KNEE]])
    return _nearest_to_lines(origins, axes[:KNEE]), axes


def _knee_range(dynamics: Dynamics, sole: str) -> tuple[float, float]:
    """Angles at which the knee is bent enough, on the side to which it is bent at home [rad]."""
    robot = dynamics.robot
    joints = leg_joints(robot, sole)
    home = robot.q_home[7 + np.array(joints)]
    hip, axes = _leg_at(dynamics, sole, home)
    axis = axes[KNEE]
    knee, ankle = (dynamics.joint_position(joints[i] + 2) for i in (KNEE, -1))
    thigh, shank = (link - axis * (axis @ link) for link in (knee - hip, ankle - knee))
    bend = math.atan2(float(axis @ np.cross(thigh, shank)), float(thigh @ shank))
    # What is left of rounding would move the limits of knees that are straight at zero.
    straight = round(float(home[KNEE]) - bend, 6)
    if bend < 0.0:
        return -math.inf, straight - _KNEE_MIN
    return straight + _KNEE_MIN, math.inf


def _nearest_to_lines(
    points: Float64[np.ndarray, "k 3"], directions: Float64[np.ndarray, "k 3"]
) -> Vector3:
    """The point with the least sum of squared distances from lines."""
    across = np.eye(3) - directions[:, :, None] * directions[:, None, :]
    return np.linalg.solve(across.sum(axis=0), np.einsum("kij,kj->i", across, points))


def _range_about(
    axes: Float64[np.ndarray, "n 3"],
    axis: int,
    lower: Float64[np.ndarray, " n"],
    upper: Float64[np.ndarray, " n"],
) -> tuple[float, float]:
    """Return the range of the leg over the sole about an axis of it, either way [rad]."""
    joint = max(range(KNEE + 1, len(axes)), key=lambda j: abs(float(axes[j, axis])))
    forward, back = -float(lower[joint]), float(upper[joint])
    if axes[joint, axis] < 0.0:
        forward, back = back, forward
    return max(forward, 0.0), max(back, 0.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Biped:
    """Two feet, the joints of two legs, and a torso."""

    robot: Robot
    soles: tuple[str, str]  # names of the left and the right sole
    frames: tuple[int, int]  # of the soles
    sizes: tuple[tuple[float, float], tuple[float, float]]  # lengths and widths of the soles [m]
    base: int  # frame of the floating base
    pelvis: int  # frame of the body from which the legs hang
    torso: int  # frame
    weight: float  # m g [N]
    size: RobotSize  # at the start
    legs: tuple[str, ...]  # names of the legs' joints, the left leg's first
    knees: Mapping[str, tuple[float, float]]  # angles that leave a knee bent, by its name [rad]
    relief: tuple[float, float]  # lean over the left and the right foot to stand on it [rad]


def biped_of(robot: Robot, size: RobotSize) -> Biped:
    """Looks up what a robot walks with."""
    left, right = soles = two_soles(robot)
    left_leg, right_leg = (
        [robot.joint_names[joint] for joint in leg_joints(robot, sole)] for sole in soles
    )
    left_geometry, right_geometry = (leg_geometry(robot, sole) for sole in soles)
    return Biped(
        robot=robot,
        soles=soles,
        frames=(robot.frame_id(left), robot.frame_id(right)),
        sizes=(_size(robot, left), _size(robot, right)),
        base=robot.model.getFrameId(robot.model.names[BASE_JOINT]),
        pelvis=robot.frame_id(robot.pelvis),
        torso=robot.frame_id(robot.torso),
        weight=robot.weight,
        size=size,
        legs=(*left_leg, *right_leg),
        knees={
            left_leg[KNEE]: left_geometry.knee_range,
            right_leg[KNEE]: right_geometry.knee_range,
        },
        relief=(left_geometry.relief, right_geometry.relief),
    )


def _size(robot: Robot, name: str) -> tuple[float, float]:
    return robot.soles[name].length, robot.soles[name].width


GIVES = 0.01
"""Distance of the hip below where a knee holds it, beyond which the swing foot is put down [m]."""

_MARGIN = 0.02
"""Part of the leg's length by which a commanded foot stays within it."""

_FOLD, _SERVO_FOLD = 0.78, 0.5
"""Least distance of hip and ankle of a loaded leg, over its length: by torques farther than the
stack's balance limit keeps, which brakes before it."""

_NARROW_GAP = 0.09
"""Least distance of narrow soles' edges by torques, over the COM's height, to hold a push aside."""

_LEAN_RATIO = 0.9
"""Part of the ankle's pitch that the shank may lean forward by."""

_TURNED = 0.05
"""Soles that are turned by less than this against where the robot faces lie side by side [rad]."""

_ROUNDING = 1e-6
"""An edge whose normal points aside by less than this faces ahead."""

_SPARE = 0.08
"""Distance beyond the operator's limits at which feet may stand where the robot put them [m]."""


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
        self._strong = [(_strong_lean(leg, 1.0), _strong_lean(leg, 0.5)) for leg in self._legs]
        # A level sole beside the hip takes as much roll of the ankle as the leg leans.
        sides = [
            reach * float(np.sin(min(_RANGE * leg.roll_max, 0.5 * np.pi))) + abs(float(leg.hip[1]))
            for leg, reach in zip(self._legs, self._reach, strict=True)
        ]
        sizes = [robot.soles[name] for name in soles]
        self._halves = [(0.5 * sole.length, 0.5 * sole.width) for sole in sizes]
        narrow = biped.size.narrow and not servos
        self._gap = max(CLEARANCE, _NARROW_GAP * biped.size.height if narrow else 0.0)
        self._apart = sum(width for _, width in self._halves) + self._gap
        self._step_max, self._lift_max = parameters.step_max, parameters.lift_max
        self._aside_max = max(self._apart, min(parameters.step_max, *sides))

    def hip(self, foot: int, dynamics: Dynamics) -> Vector3:
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
        support: Vector3,
        hip: Vector3,
        heading: Vector2,
        *,
        lower: float = 0.0,
        turns: tuple[float, float] = (0.0, 0.0),
    ) -> Vector3:
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
        """Return the distance aside at which a turned sole is clear of the other [m]."""
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

    def spans(self, left: Vector3, right: Vector3, heading: Vector2) -> bool:
        """Return whether feet stand hardly farther apart than commands may place them."""
        x, y, _ = (left - right).tolist()
        forward_x, forward_y = heading.tolist()
        aside, ahead = y * forward_x - x * forward_y, x * forward_x + y * forward_y
        return aside <= self._aside_max + _SPARE and abs(ahead) <= self._step_max + _SPARE

    def too_high(self, foot: int, place: Vector3, hip: Vector3, shift: Point) -> float:
        """Return how far the hip is too high for a foot to reach a place [m]."""
        (x, y, z), (arm_x, arm_y, arm_z) = place.tolist(), self._ankles[foot]
        (hip_x, hip_y, hip_z), (shift_x, shift_y) = hip.tolist(), shift
        across = (x + arm_x - hip_x - shift_x) ** 2 + (y + arm_y - hip_y - shift_y) ** 2
        return hip_z - z - arm_z - math.sqrt(max(self._reach[foot] ** 2 - across, 0.0))

    def too_low(
        self, foot: int, place: Vector3, hip: Vector3, heading: Vector2, *, alone: bool
    ) -> float:
        """Return the depth of the hip below where a loaded leg holds it; negative for room [m]."""
        ahead, aside, z = self._to_hip(foot, place, hip, heading)
        lean = min(_LEAN_RATIO * self._legs[foot].lean_max, self._strong[foot][0 if alone else 1])
        folded = math.sqrt(max(self._fold[foot] ** 2 - ahead * ahead - aside * aside, 0.0))
        return max(self._level(foot, ahead, aside, lean), folded) - z

    def too_weak(self, foot: int, place: Vector3, hip: Vector3, heading: Vector2) -> float:
        """Return how far the hip is too low for the knee of a stance leg; negative for room."""
        ahead, aside, z = self._to_hip(foot, place, hip, heading)
        return self._level(foot, ahead, aside, self._strong[foot][0]) - z

    def _to_hip(
        self, foot: int, place: Vector3, hip: Vector3, heading: Vector2
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
    """Return the lean of a shank with which its knee holds a part of the weight [rad]."""
    ahead = leg.knee_lever / share - float(leg.ankle[0])
    return math.asin(min(max(ahead / leg.shank, 0.0), 1.0))
