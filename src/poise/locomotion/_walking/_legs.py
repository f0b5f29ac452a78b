"""Legs: a measured `Leg`, and its reach: `LegRoom`, `FootRange` and `check_reach`."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.dynamics import Dynamics, RobotState
from poise.errors import ConfigurationError
from poise.locomotion._support import Point, Vector2, Vector3
from poise.locomotion._walking._footsteps import FootstepPlan, Stand, beside
from poise.locomotion._walking._ground import CLEARANCE, Placement
from poise.robots import GRAVITY, Robot, frame_error, inverse_kinematics

KNEE = 3
"""Place of the knee among the joints of a leg: behind the hip's three, in any order."""

_KNEE_MIN = 0.08
"""Least bend of a knee: straighter the leg is singular [rad]."""

_KNEE_LOAD, _HIP_LOAD, _RANGE = 0.7, 0.75, 0.8
"""Parts of a joint's torque and of its range to stand with: the rest raises the body again, and
swings the other leg."""

_STRAIGHT = 0.99
"""Ratio of a straight leg's length that a foothold may use which is moved to catch the robot."""

_RELIEF_MAX = 0.2
"""The body leans over the foot that carries by no more [rad]."""

_PITCH, _ROLL = 1, 0
"""Axes of the ankle in the body: across the leg and along the foot."""


def _side(longest: float, x: float, y: float = 0.0) -> float:
    """Return the third side of a box with that diagonal."""
    return math.sqrt(max(longest**2 - x * x - y * y, 0.0))


@dataclass(frozen=True, kw_only=True, eq=False)
class Leg:
    """Thigh and shank between ankle and hip, the point nearest to the axes of the hip's joints."""

    joints: tuple[int, ...]  # from the hip on, among the robot's joints; a waist is no part
    size: Point  # length and width of the sole [m]
    pelvis: int  # frame
    hip: Vector3  # in the pelvis's frame [m]
    ankle: Vector3  # origin of the last joint, in the sole's frame [m]
    length: float  # from hip to ankle with the knee as straight as it may be [m]
    thigh: float  # from hip to knee [m]
    shank: float  # from knee to ankle [m]
    knee_range: Point  # angles of the knee that leave it bent [rad]
    lean_max: float  # largest lean of the shank forward over a level sole [rad]
    roll_max: float  # largest lean to either side [rad]
    knee_lever: float  # distance of the knee from the line of the weight at which it holds all [m]
    relief: float  # lean of the body over the stance foot that a weak hip needs [rad]
    span: float  # from the first joint to the last of a leg that is nearly straight [m]
    rise: float  # height of the first joint over the last, less that of the CoM over the sole [m]
    quickness: float  # acceleration of the foot by its quickest joint at its limit [m/s^2]

    def beside(self, height: float) -> float:
        """Return the distance of a foot beside its hip by the height of the CoM over it [m]."""
        return _side(self.span, height + self.rise)

    def highest(self, aside: float) -> float:
        """Return the largest height of the CoM above a foot [m]."""
        return _side(self.span, aside) - self.rise


class _Posed:
    """A leg in a posture: origins [m] and axes of its joints, and its hip [m]."""

    def __init__(
        self,
        dynamics: Dynamics,
        sole: str,
        q: Float64[np.ndarray, " nq"],
        angles: Float64[np.ndarray, " n"] | None = None,
    ) -> None:
        robot = dynamics.robot
        # Pinocchio counts the world and the floating base before the joints.
        ids = np.array(robot.leg_joints(sole))
        if angles is not None:
            q = q.copy()
            q[5 + ids] = angles
        dynamics.update(RobotState(q, np.zeros(robot.nv)))
        self.com, self.foot = dynamics.com, dynamics.frame(robot.frame_id(sole))
        self.pelvis, self.pelvis_R = dynamics.placement(robot.frame_id(robot.pelvis))
        self.origins = np.array([dynamics.joint_position(int(j)) for j in ids])
        self.axes = self.foot.jacobian[3:, robot.base_dofs - 2 + ids].T
        self.knee, self.ankle = self.origins[min(KNEE, len(ids) - 1)], self.origins[-1]
        # The point with the least sum of squared distances from the axes of the hip.
        across = np.eye(3) - self.axes[:KNEE, :, None] * self.axes[:KNEE, None, :]
        lines = np.einsum("kij,kj->i", across, self.origins[:KNEE])
        self.hip = np.linalg.lstsq(across.sum(axis=0), lines, rcond=None)[0]


def measure_leg(dynamics: Dynamics, sole: str, q: Float64[np.ndarray, " nq"]) -> Leg:
    """Measure the leg of a robot that stands in a posture."""
    robot, size = dynamics.robot, dynamics.robot.soles[sole]
    joints = [j - 2 for j in robot.leg_joints(sole)]
    # Of legs with fewer joints the first and the last count alone.
    knee = min(KNEE, len(joints) - 1)
    stands = _Posed(dynamics, sole, q)
    J = stands.foot.rotation.T[0] @ stands.foot.jacobian[:3]
    quickest = max((robot.base_dofs + j for j in joints), key=lambda k: abs(float(J[k])))
    force = abs(float(J[quickest])) * float(robot.tau_max[quickest - robot.base_dofs])
    quickness = force / float(dynamics.M[quickest, quickest])
    over = float(stands.ankle[2]) - float(stands.foot.position[2])
    neutral = _Posed(dynamics, sole, pin.neutral(robot.model))
    home = _Posed(dynamics, sole, robot.q_home)
    bent = _knee_range(home, knee, float(robot.q_home[7 + joints[knee]]))
    lower, upper = robot.q_min[joints].copy(), robot.q_max[joints].copy()
    lower[knee], upper[knee] = max(lower[knee], bent[0]), min(upper[knee], bent[1])
    leg = _Posed(dynamics, sole, robot.q_home, np.clip(0.0, lower, upper))
    axes = leg.axes @ leg.foot.rotation
    below = sum(float(robot.model.inertias[j + 2].mass) for j in joints[knee:])
    held = _KNEE_LOAD * float(robot.tau_max[joints[knee]])
    return Leg(
        joints=tuple(joints),
        size=(size.length, size.width),
        pelvis=robot.frame_id(robot.pelvis),
        hip=leg.pelvis_R.T @ (leg.hip - leg.pelvis),
        ankle=leg.foot.rotation.T @ (leg.ankle - leg.foot.position),
        length=float(np.linalg.norm(leg.ankle - leg.hip)),
        thigh=float(np.linalg.norm(leg.knee - leg.hip)),
        shank=float(np.linalg.norm(leg.ankle - leg.knee)),
        knee_range=bent,
        lean_max=_range_about(axes, _PITCH, lower, upper)[0],
        roll_max=min(_range_about(axes, _ROLL, lower, upper)),
        knee_lever=held / (GRAVITY * (robot.mass - below)),
        relief=_hip_relief(robot, joints, home),
        span=_STRAIGHT * float(np.linalg.norm(neutral.ankle - neutral.origins[0])),
        rise=float(stands.origins[0, 2]) - float(stands.com[2]) - over,
        quickness=quickness,
    )


def _knee_range(home: _Posed, knee: int, angle: float) -> Point:
    """Return angles that leave a knee bent to the side to which it is at home [rad]."""
    axis = home.axes[knee]
    thigh, shank = (
        link - axis * (axis @ link) for link in (home.knee - home.hip, home.ankle - home.knee)
    )
    bend = math.atan2(float(axis @ np.cross(thigh, shank)), float(thigh @ shank))
    # Rounding alone would move the limits of knees that are straight at zero.
    straight = round(angle - bend, 6)
    if bend < 0.0:
        return -math.inf, straight - _KNEE_MIN
    return straight + _KNEE_MIN, math.inf


def _hip_relief(robot: Robot, joints: list[int], home: _Posed) -> float:
    """Return the lean of the body over a foot with which its hip carries it alone [rad]."""
    # Upright the leg of length l is turned in by y / l and the hip holds the weight at the lever y.
    # A lean phi takes back phi of the turn, and weight times height over the hip times phi.
    roll = int(np.argmax(np.abs(home.axes[:KNEE, _ROLL])))
    about, joint, hip = float(home.axes[roll, _ROLL]), joints[roll], home.hip
    masses = [robot.model.inertias[j + 2].mass for j in joints]
    leg = float(sum(masses))
    carried = robot.mass - leg
    middle = (robot.mass * home.com - masses @ home.origins) / carried
    offset = abs(float(hip[1] - home.pelvis[1]))
    # The leg's own weight, half way, has to be balanced by the body's.
    moment = GRAVITY * (carried + 0.5 * leg) * offset
    height = max(float(middle[2] - hip[2]), 0.1 * float(hip[2]))
    lacking = moment - _HIP_LOAD * float(robot.tau_max[joint]) * abs(about)
    inwards = about * (1.0 if hip[1] < home.pelvis[1] else -1.0) > 0.0
    angle = float(robot.q_home[7 + joint])
    limit = robot.q_max[joint] - angle if inwards else angle - robot.q_min[joint]
    turn = offset / float(hip[2] - home.ankle[2]) - _RANGE * float(limit)
    return min(max(lacking / (GRAVITY * carried * height), turn, 0.0), _RELIEF_MAX)


def _range_about(
    axes: Float64[np.ndarray, "n 3"],
    axis: int,
    lower: Float64[np.ndarray, " n"],
    upper: Float64[np.ndarray, " n"],
) -> Point:
    """Return the range of the leg over the sole about an axis of it, either way [rad]."""
    first = min(KNEE + 1, len(axes) - 1)
    joint = first + int(np.argmax(np.abs(axes[first:, axis])))
    forward, back = -float(lower[joint]), float(upper[joint])
    if axes[joint, axis] < 0.0:
        forward, back = back, forward
    return max(forward, 0.0), max(back, 0.0)


class StepBounds(NamedTuple):
    """Bounds of a foothold, along the stance foot and away from it."""

    near: float  # nearest beside, so that feet neither cross nor touch [m]
    wide: float  # farthest beside [m]
    reach: float  # farthest ahead and behind, and from the place `beside` [m]
    beside: float  # where it is side by side, half way between what is near and comfortable [m]

    def nearest(self, place: Point) -> Point:
        """The nearest place inside; the second coordinate counts away from the stance foot."""
        x, y = place
        distance = math.hypot(x, max(y - self.beside, 0.0))
        if distance > self.reach:
            ratio = self.reach / distance
            x *= ratio
            if y > self.beside:
                y = self.beside + ratio * (y - self.beside)
        return x, min(max(y, self.near), self.wide)


class LegRoom(NamedTuple):
    """Workspace of a foothold beside the other foot."""

    sizes: tuple[Point, Point]  # length and width of both soles [m]
    width: float  # of the feet side by side [m]
    clearance: float  # least distance of their edges [m]
    ahead: float  # farthest ahead and behind [m]
    far: float  # the same where the body goes down for it, to catch the robot [m]
    wide: float  # farthest beside [m]
    turn: float  # most that a foot is turned outwards from the other [rad]
    turn_in: float  # and inwards [rad]
    quickness: float  # acceleration of a foot in the air, at most [m/s^2]

    def shortest_swing(self, way: float) -> float:
        """Return the duration of a rest-to-rest motion of a foot with the least jerk [s]."""
        # A quintic of least jerk peaks at 10 / sqrt(3) of its way by its time squared.
        return math.sqrt(10.0 / math.sqrt(3.0) * way / self.quickness)

    def near(self, yaw: float) -> float:
        """Return the least distance of the soles' centres, turned against each other [m]."""
        return self.clearance + beside(self.sizes, yaw)

    def bounds(self, yaw: float, *, far: bool = False) -> StepBounds:
        """Return the region of a foothold."""
        near = min(self.near(yaw), self.width)
        return StepBounds(near, self.wide, self.far if far else self.ahead, self.width)


GIVES = 0.01
"""Distance of the hip below where a knee holds it, beyond which the swing foot is put down [m]."""

_MARGIN = 0.02
"""Part of the leg's length by which a commanded foot stays within it."""

_FOLD, _SERVO_FOLD = 0.78, 0.5
"""Least distance of hip and ankle of a loaded leg, over its length: by torques farther than the
stack's balance limit keeps, which brakes before it."""

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

    def __init__(
        self,
        legs: tuple[Leg, Leg],
        *,
        step_max: float,
        lift_max: float,
        gap: float = CLEARANCE,
        servos: bool = False,
    ) -> None:
        self._legs, self._step_max, self._lift_max, self._gap = legs, step_max, lift_max, gap
        # A few numbers each tick are several times as quick as such than as arrays.
        self._ankles: list[list[float]] = [leg.ankle.tolist() for leg in legs]
        self._reach = [(1.0 - _MARGIN) * leg.length for leg in legs]
        self._fold = [(_SERVO_FOLD if servos else _FOLD) * leg.length for leg in legs]
        # Held up by its knee: alone, and beside the other one.
        self._strong = [(_strong_lean(leg, 1.0), _strong_lean(leg, 0.5)) for leg in legs]
        # A level sole beside the hip takes as much roll of the ankle as the leg leans.
        sides = [
            reach * math.sin(min(_RANGE * leg.roll_max, 0.5 * math.pi)) + abs(float(leg.hip[1]))
            for leg, reach in zip(legs, self._reach, strict=True)
        ]
        self._apart = sum(0.5 * leg.size[1] for leg in legs) + gap
        self._aside_max = max(self._apart, min(step_max, *sides))

    def hip(self, foot: int, dynamics: Dynamics) -> Vector3:
        """Return the position of the hip of a foot's leg [m]."""
        leg = self._legs[foot]
        position, rotation = dynamics.placement(leg.pelvis)
        return position + rotation.dot(leg.hip)

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
        # Along the ground only: the ground and the knee limit how far down a foot gets.
        (arm_x, arm_y, arm_z), (hip_x, hip_y, hip_z) = self._ankles[foot], hip.tolist()
        room = _side(self._reach[foot], hip_z - arm_z - max(z, support_z) - lower)
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
                    # Half of what each sole takes across the edge.
                    size = -x * ahead
                    for leg, turn in zip(self._legs, turns, strict=True):
                        (length, width), c, s = leg.size, math.cos(turn), math.sin(turn)
                        size += 0.5 * (length * abs(x * c + y * s) + width * abs(y * c - x * s))
                    needed = min(needed, size / abs(y))
        return needed

    def spans(self, left: Vector3, right: Vector3, heading: Vector2) -> bool:
        """Return whether feet stand hardly farther apart than commands may place them."""
        x, y, _ = (left - right).tolist()
        forward_x, forward_y = heading.tolist()
        aside, ahead = y * forward_x - x * forward_y, x * forward_x + y * forward_y
        return aside <= self._aside_max + _SPARE and abs(ahead) <= self._step_max + _SPARE

    def too_high(self, foot: int, place: Vector3, hip: Vector3, shift: Point) -> float:
        """Return the excess height of the hip for a foot to reach a position [m]."""
        (x, y, z), (arm_x, arm_y, arm_z) = place.tolist(), self._ankles[foot]
        (hip_x, hip_y, hip_z), (shift_x, shift_y) = hip.tolist(), shift
        x, y = x + arm_x - hip_x - shift_x, y + arm_y - hip_y - shift_y
        return hip_z - z - arm_z - _side(self._reach[foot], x, y)

    def too_low(
        self, foot: int, place: Vector3, hip: Vector3, heading: Vector2, *, alone: bool
    ) -> float:
        """Return the depth of the hip below where a loaded leg holds it; negative for room [m]."""
        ahead, aside, z = self._to_hip(foot, place, hip, heading)
        lean = min(_LEAN_RATIO * self._legs[foot].lean_max, self._strong[foot][0 if alone else 1])
        folded = _side(self._fold[foot], ahead, aside)
        return max(self._level(foot, ahead, aside, lean), folded) - z

    def too_weak(self, foot: int, place: Vector3, hip: Vector3, heading: Vector2) -> float:
        """Return the missing height of the hip for the knee of a stance leg; negative if enough."""
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
        thigh = _side(leg.thigh, ahead - leg.shank * math.sin(lean), aside)
        return leg.shank * math.cos(lean) + thigh


def _strong_lean(leg: Leg, share: float) -> float:
    """Return the lean of a shank with which its knee holds a part of the weight [rad]."""
    ahead = leg.knee_lever / share - float(leg.ankle[0])
    return math.asin(min(max(ahead / leg.shank, 0.0), 1.0))


_MISS = 0.01
"""A foot this far from its place, or a joint this far beyond its limit, is out of reach [m, rad]:
the pelvis is known only as moving with the CoM."""


def check_reach(robot: Robot, plan: FootstepPlan, height: float) -> None:
    """Raises ConfigurationError if a foot does not reach its place, with the body at a height [m].

    Looks at both feet at each touchdown and the next lift-off, the CoM between them.
    """
    start = pin.XYZQUATToSE3(plan.q[:7])
    base_from_com = start.translation - np.array(plan.com)
    heading = 0.5 * sum(place.yaw for place in plan.start)
    for done in range(plan.count + 1):
        places = plan.placements(done)
        landed = plan.steps[max(done - 1, 0)].foot
        behind, ahead = np.array(places[1 - landed].position), np.array(places[landed].position)
        turn = pin.utils.rotate("z", 0.5 * (places[0].yaw + places[1].yaw) - heading)
        for way in (0.5, 0.5 + plan.gait.double_support / plan.gait.step_time):
            com = behind + way * (ahead - behind)
            com[2] = min(behind[2], ahead[2]) + height
            base = pin.SE3(turn @ start.rotation, com + turn @ base_from_com)
            for foot, name in enumerate(plan.soles):
                problem = _miss(robot, plan, foot, places[foot], base)
                if problem:
                    raise ConfigurationError(
                        f"{name} of robot {robot.name!r} is out of reach"
                        f" {f'after step {done}' if done else 'before its first step'}",
                        got=problem,
                        wanted="shorter steps, another width, or more crouch",
                    )


def _miss(robot: Robot, stand: Stand, foot: int, place: Placement, base: pin.SE3) -> str:
    """Return the fault of a foot's place at one moment; "" for none."""
    model, data, name = robot.model, robot.model.createData(), stand.soles[foot]
    goal = pin.SE3(pin.utils.rotate("z", place.yaw), np.array(place.position))
    frame, sole, chain = robot.frame_id(name), robot.soles[name], robot.leg_joints(name)
    led = list(sole.controlled)

    def linearize(
        q: Float64[np.ndarray, " nq"],
    ) -> list[tuple[Float64[np.ndarray, " m"], Float64[np.ndarray, "m nv"]]]:
        pin.computeJointJacobians(model, data, q)
        error, J = frame_error(model, data, frame, goal)
        return [(error[led], J[led])]

    q = stand.q.copy()
    q[:7] = pin.SE3ToXYZQUAT(base)
    q, ((error, _),) = inverse_kinematics(
        model,
        q,
        linearize,
        [model.joints[j].idx_v for j in chain],
        tolerance=1e-3,
        damping=1e-6,
        step_max=0.3,
        iterations=25,
    )
    short = float(np.linalg.norm(error[:3]))
    if short > _MISS:
        return f"{short:.3f} m short"
    # A sole that its leg does not turn points where the body does.
    turn = pin.log3(base.rotation @ pin.XYZQUATToSE3(stand.q[:7]).rotation.T)[2]
    aside = 0.0 if sole.turns else abs(place.yaw - stand.start[foot].yaw - float(turn))
    if aside > _MISS:
        return f"{aside:.3f} rad aside"
    first = robot.nq - robot.nj
    for k in (model.joints[j].idx_q - first for j in chain):
        angle, low, high = float(q[first + k]), robot.q_min[k], robot.q_max[k]
        if not low - _MISS <= angle <= high + _MISS:
            return f"joint {robot.joint_names[k]!r} at {angle:.2f} of {low:.2f} to {high:.2f} rad"
    return ""
