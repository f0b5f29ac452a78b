"""`CarriedTarget`: a task's target that travels with the body.

`WalkTasks`: the tasks and contacts of a stack that a walk sets, found before anything moves.
`walking_stack`: a stack that has them.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._checks import Numbers
from poise._compiled import compiled
from poise.errors import ConfigurationError, UnknownNameError
from poise.locomotion._support import Point, two_soles
from poise.locomotion._walking._flight import HeldFlight
from poise.locomotion._walking._footsteps import Stand
from poise.locomotion._walking._sense import WalkSense
from poise.robots import Robot
from poise.stack import (
    LINEAR_SPEED,
    SMOOTH_RATE,
    ComTask,
    Contact,
    FrameTask,
    JointLimit,
    JointTask,
    Pose,
    PoseTarget,
    PostureTask,
    SelfCollisionLimit,
    Stack,
    SurfaceContact,
    Task,
    TorqueLimit,
)

T = TypeVar("T")

ComMotion = Sequence[tuple[float, float, float]]
"""Position, velocity and acceleration of the CoM [m, m/s, m/s^2]."""


class CarriedTarget:
    """The target of a frame task, given as if the robot had not walked.

    Hands, torso and pelvis go where the body goes: with the body's displacement d and turn psi
    since the beginning, and the target p and R as it would be had the robot not walked,

        world_p = o + d + R_z(psi) (p - o)
        world_R = R_z(psi) R

    where o is the point at which the body began.
    """

    def __init__(
        self,
        task: FrameTask,
        position: Float64[np.ndarray, "3"],
        rotation: Float64[np.ndarray, "3 3"],
        origin: Float64[np.ndarray, "3"],
    ) -> None:
        self.task = task
        self._origin = origin.copy()
        self._target = PoseTarget(f"carried task {task.name!r}", sorted(task.components))
        self._given = self._target.overwrite()
        self.set_target(position, rotation)

    @property
    def target_position(self) -> Float64[np.ndarray, "3"]:
        """Target position of the frame, without the displacement of the walk [m]."""
        return self._given[0].copy()

    def set_target(
        self,
        position: Pose | None = None,
        rotation: Numbers | None = None,
        velocity: Numbers | None = None,
        acceleration: Numbers | None = None,
    ) -> None:
        """Move the target, as if the robot had not walked; what is not given stays as it is."""
        self._target.set(position, rotation, velocity, acceleration)

    def overwrite_target(self) -> Float64[np.ndarray, "8 3"]:
        """Return the target's numbers as `FrameTask.overwrite_target` does."""
        return self._given

    def write(self, body: Float64[np.ndarray, "3 4"]) -> None:
        """Set the task's target.

        Args:
            body: displacement and turn of the body, then their rates, a row each [m, rad].
        """
        _carry(body, self._given, self._origin, self.task.overwrite_target())


@compiled
def _carry(
    body: Float64[np.ndarray, "3 4"],
    given: Float64[np.ndarray, "8 3"],
    origin: Float64[np.ndarray, "3"],
    out: Float64[np.ndarray, "8 3"],
) -> None:
    """Take a target along with a body."""
    c, s, rate, second = math.cos(body[0, 3]), math.sin(body[0, 3]), body[1, 3], body[2, 3]
    for k in range(3):
        x, y = given[1, k], given[2, k]
        out[1, k], out[2, k], out[3, k] = c * x - s * y, s * x + c * y, given[3, k]
    x, y = c * given[5, 0] - s * given[5, 1], s * given[5, 0] + c * given[5, 1]
    out[5, 0], out[5, 1], out[5, 2] = x, y, given[5, 2] + rate
    # The axes that the target spins about turn with the body.
    out[7, 0] = c * given[7, 0] - s * given[7, 1] - rate * y
    out[7, 1] = s * given[7, 0] + c * given[7, 1] + rate * x
    out[7, 2] = given[7, 2] + second
    x, y = given[0, 0] - origin[0], given[0, 1] - origin[1]
    px, py = c * x - s * y, s * x + c * y
    vx, vy = c * given[4, 0] - s * given[4, 1], s * given[4, 0] + c * given[4, 1]
    ax, ay = c * given[6, 0] - s * given[6, 1], s * given[6, 0] + c * given[6, 1]
    out[0, 0], out[0, 1] = origin[0] + body[0, 0] + px, origin[1] + body[0, 1] + py
    out[4, 0], out[4, 1] = body[1, 0] + vx - rate * py, body[1, 1] + vy + rate * px
    # Tangential, centripetal and Coriolis acceleration.
    out[6, 0] = body[2, 0] + ax - second * py - rate * (rate * px + 2.0 * vy)
    out[6, 1] = body[2, 1] + ay + second * px - rate * (rate * py - 2.0 * vx)
    out[0, 2], out[4, 2] = body[0, 2] + given[0, 2], body[1, 2] + given[4, 2]
    out[6, 2] = body[2, 2] + given[6, 2]


@dataclass(frozen=True, kw_only=True)
class WalkTasks:
    """Tasks and contacts that a walk sets."""

    com: ComTask
    feet: tuple[FrameTask, FrameTask]  # the pose of the left and of the right sole
    contacts: tuple[Contact, Contact]  # of the left and of the right sole
    carried: dict[str, CarriedTarget]  # targets that move with the body, by their task's name

    def lead_foot(self, sense: WalkSense, flight: HeldFlight) -> None:
        """Move a swing foot along its path, by the lower edge of a tilted sole."""
        target, (drop, rate) = (
            self.feet[flight.foot].overwrite_target(),
            sense.edge_drop(flight.foot),
        )
        target[0], target[1:4] = flight.position, flight.rotation
        target[4:6] = flight.velocity.reshape(2, 3)
        target[6:] = flight.acceleration.reshape(2, 3)
        target[0, 2] += drop
        target[4, 2] += rate

    def lead_com(self, sense: WalkSense, com: ComMotion, horizontal: Point) -> None:
        """Height by the task's own gains, the rest by the feedback."""
        task, (place, velocity, acceleration) = self.com, com
        task.overwrite_target()[:] = com
        height, speed = place[2] - sense.com[2], velocity[2] - sense.com_velocity[2]
        asked = task.overwrite_acceleration()
        asked[0], asked[1] = horizontal
        asked[2] = acceleration[2] + float(task.kp[2]) * height + float(task.kd[2]) * speed


def find_walk_tasks(
    robot: Robot, stand: Stand, stack: Stack, carry: Sequence[str] | None
) -> WalkTasks:
    """Look for everything that a walk needs."""
    tasks, contacts = [task for _, task in stack.tasks()], stack.contacts
    names, frames = [task.name for task in tasks], [contact.frame for contact in contacts]

    def foot(sole: str) -> FrameTask:
        led = set(robot.soles[sole].controlled)
        of_it = (t for t in tasks if isinstance(t, FrameTask) and t.frame == sole)
        whole = (t for t in of_it if t.components >= led)
        return _first(whole, "task", names, f"a FrameTask of the pose of {sole!r}")

    def contact(sole: str) -> Contact:
        of_it = (contact for contact in contacts if contact.frame == sole)
        return _first(of_it, "contact", frames, f"a contact on {sole!r}")

    coms = (task for task in tasks if isinstance(task, ComTask) and task.dim == 3)
    left, right = stand.soles
    return WalkTasks(
        com=_first(coms, "task", names, "a ComTask of all three axes"),
        feet=(foot(left), foot(right)),
        contacts=(contact(left), contact(right)),
        carried=_carried(robot, stand, stack, carry),
    )


def _first(found: Iterable[T], kind: str, got: list[str], wanted: str) -> T:
    for one in found:
        return one
    raise ConfigurationError(f"a stack without a {kind} that a walk needs", got=got, wanted=wanted)


def _carried(
    robot: Robot, stand: Stand, stack: Stack, names: Sequence[str] | None
) -> dict[str, CarriedTarget]:
    frames = {
        task.name: task
        for _, task in stack.tasks()
        if isinstance(task, FrameTask) and task.frame not in stand.soles
    }
    for name in names or ():
        if name not in frames:
            raise UnknownNameError("no frame task to carry", got=name, choices=frames)
    model, data = robot.model, robot.model.createData()
    pin.framesForwardKinematics(model, data, stand.q)
    origin = np.array([*stand.com[:2], stand.middle[2]])
    carried: dict[str, CarriedTarget] = {}
    # Compiled now, not in the first tick.
    nothing = np.zeros((8, 3))
    _carry(np.zeros((3, 4)), nothing, nothing[0], nothing)
    for name, task in frames.items():
        if names is None or name in names:
            pose = data.oMf[robot.frame_id(task.frame)]
            carried[name] = CarriedTarget(task, pose.translation, pose.rotation, origin)
    return carried


_SWING_BRAKING = 60.0
"""Deceleration with which the joints of legs plan to stop before their limits [rad/s^2].

A foot that catches the robot brakes with over 60 m/s^2 at the end of a leg of 0.7 m, and its ankle
and knee turn with it. A joint that planned to stop more gently would be kept slow far from its
limit: with 8 rad/s^2, half a radian before it, an ankle may turn by no more than 2.8 rad/s, and a
foot that has to stay flat then comes short by centimetres.
"""


def stepping_stack(
    robot: Robot,
    levels: Sequence[Sequence[Task]],
    *,
    contacts: Sequence[Contact] = (),
    position_range: Mapping[str, tuple[float, float]] | None = None,
    collides: bool = True,
) -> Stack:
    """Levels above limits of a robot that steps: legs alone stop hard, and no torque jumps."""
    legs = {joint for sole in robot.soles for joint in robot.leg_joints(sole)}
    # An arm that came to its stop as hard would shake the robot that carries it.
    braking = {robot.model.names[joint]: _SWING_BRAKING for joint in legs}
    return Stack(
        contacts=contacts or [SurfaceContact(sole) for sole in robot.soles],
        levels=levels,
        torque_limit=TorqueLimit(rate=SMOOTH_RATE),
        joint_limit=JointLimit(position_range=position_range, braking_of=braking),
        self_collision_limit=SelfCollisionLimit() if collides else None,
    )


_UPPER = 0.03
"""Weight of trunk and hands: 1 rad/s^2 of all above the legs, of inertia I, moves the ZMP by
I / (m g), and 1 m/s^2 of the CoM by H / g. Their ratio I / (m H) is 0.016 to 0.061 on five robots
of 28 to 100 kg."""


def walking_stack(
    robot: Robot, arms: JointTask | None = None, neck: JointTask | None = None
) -> Stack:
    """CoM, feet, pelvis, torso and hands in one level, strictly above the posture.

    With c'' and L' of all tasks together, L about the CoM at height H, the ground would have to
    push at

        z_x = c_x - (H c_x'' + L_y' / m) / g        z_y = c_y - (H c_y'' - L_x' / m) / g

    While z lies in the soles, all tasks are met that torques and joints allow, as in strict levels.
    Beyond an edge they share what is missing by their weights, ways of the ZMP: CoM and feet one, a
    turn of a foot half the sole's length, trunk and hands I / (m H), their inertia over mass and
    height.

    Measured cost of strictness: with trunk and hands strictly below CoM and feet the trunk turns by
    all that is missing, also where a sole bears on less than it is taken to. Down a ramp of 8
    degrees a humanoid of 100 kg fell in 3 of 14 walks, with weights in none; pushed by 0.6 m/s
    while they walked, two robots fell in 5 of 32 walks, with weights in 4.

    Soles that lean are nothing but edges: there, all weigh one.

    Args:
        robot: on two soles.
        arms: of their joints, set by another leader, instead of hands that move with the body; the
            robot's links are kept off each other.
        neck: of its joints, set by another leader.

    Returns:
        A new stack.

    Raises:
        RobotError: the robot does not stand on two soles.
    """
    soles = two_soles(robot)
    leans = any(robot.soles[sole].leans for sole in soles)
    balance: list[Task] = [ComTask(kp=40.0, speed=LINEAR_SPEED)]
    for sole in soles:
        lever = 0.5 * robot.soles[sole].length
        weight = [1.0 if row < 3 else lever for row in sorted(robot.soles[sole].controlled)]
        name = sole.replace("sole", "foot")
        balance.append(FrameTask(sole, kp=300.0, weight=weight, name=name))
    upper: list[Task] = [
        FrameTask(robot.pelvis, "orientation", kp=100.0, name="pelvis"),
        FrameTask(robot.torso, "orientation", kp=50.0, name="torso"),
    ]
    if arms is None:
        upper += [FrameTask(hand, "position", kp=100.0, name=hand) for hand in robot.hands]
    else:
        upper.append(arms)
    if neck is not None:
        upper.append(neck)
    if not leans:
        for task in upper:
            task.set_weight(_UPPER)
    # Hands that move with the body follow the plan; other leaders may move them anywhere.
    return stepping_stack(robot, [[*balance, *upper], [PostureTask()]], collides=arms is not None)
