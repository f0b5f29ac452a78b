"""Targets that no robot reaches: far ahead of a hand, or turning on behind a pelvis."""

import math
from dataclasses import asdict, dataclass

import numpy as np
import pinocchio as pin

from poise.control import WholeBodyController
from poise.dynamics import Dynamics, RobotState
from poise.locomotion import Walker, walking_stack
from poise.robots import Robot, load_robot
from poise.sim import Plant, PlantConfig, rollout
from poise.stack import (
    ComTask,
    FrameTask,
    PostureTask,
    Stack,
    SurfaceContact,
    TorqueLimit,
    default_stack,
)

PERIOD = 0.002
"""Control period [s]."""

FAR_HANDS = (
    ("g1", "walking", 10.0),
    ("g1", "walking", 30.0),
    ("humanoid33", "walking", 30.0),
    ("g1", "standing", 300.0),
)
"""Robot, what it does, and how far ahead of its left hand the target is [m]."""

TURNED = (("humanoid33", True), ("humanoid33", False), ("g1", False), ("g1", True))
"""Robots that stand on one leg while the target of their pelvis turns, and whether COM, pelvis and
raised foot share a level, as in the scenario `balance_one_leg`, or the COM stands above."""

_BEGIN, _FALLS = 1.0, 5.0
"""When a hand's target jumps, and for how long a robot has to stand afterwards [s]."""

_WALK = 0.25
"""Commanded velocity of a walk [m/s]."""

_SHIFT, _LIFTED, _TURN_BEGIN, _TURN_TIME = 2.5, 4.5, 5.0, 15.0
"""When the weight is over one foot, when the other one is up, when the pelvis's target begins to
turn, and for how long it does [s]."""

_YAW_RATE, _LIFT, _UNLOAD = 0.5, 0.08, 0.3
"""Of the target that turns [rad/s]; how high the foot goes [m]; how long it is unloaded [s]."""

_TORQUE_RATE = 250.0
"""Largest rate of a torque, by its limit, as the default stack has it [1/s]."""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Outcome of a trial.

    Attributes:
        fell: whether it fell.
        time: how long it ran after the target had left [s].
        fallbacks: ticks without an answer.
        torque: largest torque, by its limit.
        torque_step: largest change of a torque from tick to tick, by its limit.
    """

    fell: bool
    time: float
    fallbacks: int
    torque: float
    torque_step: float


def far_hand(
    name: str, doing: str, distance: float, *, speed: float | None = None
) -> dict[str, float]:
    """Sets the target of the left hand far ahead, of a robot that walks or stands.

    Args:
        name: of the robot.
        doing: "walking" or "standing".
        distance: of the target ahead of the hand [m].
        speed: of the hand's task [m/s]; as it is when None.
    """
    robot = load_robot(name)
    stack = walking_stack(robot) if doing == "walking" else default_stack(robot)
    hand = _left_hand(stack)
    if speed is not None:
        hand.set_speed(speed)
    leader = _FarHand(robot, stack, hand, distance, walks=doing == "walking")
    return asdict(_run(robot, stack, leader, _BEGIN, _BEGIN + _FALLS))


def turning_pelvis(name: str, shared: bool, *, speed: float | None = None) -> dict[str, float]:
    """Turns the target of the pelvis on and on, of a robot that stands on its right leg.

    Args:
        name: of the robot.
        shared: whether COM, pelvis and raised foot share a level.
        speed: of the pelvis's task [rad/s]; as it is when None.
    """
    robot = load_robot(name)
    left, right = "left_sole", "right_sole"
    pelvis = FrameTask(robot.pelvis, "orientation", kp=100.0, name="pelvis")
    if speed is not None:
        pelvis.set_speed(speed)
    com, foot = ComTask(kp=40.0), FrameTask(left, kp=100.0, name="foot")
    stack = Stack(
        [SurfaceContact(left), SurfaceContact(right)],
        [
            *([[com, pelvis, foot]] if shared else [[com], [pelvis, foot]]),
            [FrameTask(robot.torso, "orientation", kp=50.0, name="torso")],
            [PostureTask()],
        ],
        torque_limit=TorqueLimit(rate=_TORQUE_RATE),
    )
    leader = _OnOneLeg(robot, stack, left, right)
    return asdict(_run(robot, stack, leader, _TURN_BEGIN, _TURN_BEGIN + _TURN_TIME))


class _FarHand:
    def __init__(
        self, robot: Robot, stack: Stack, hand: FrameTask, distance: float, *, walks: bool
    ) -> None:
        self.stack, self._hand = stack, hand
        self._walker = Walker(robot, stack) if walks else None
        self._ahead = np.array([distance, 0.0, 0.0])
        self._begun = False

    def lead(self, state: RobotState) -> None:
        """Walks on, and moves the target once it is time."""
        walker, begins = self._walker, state.time >= _BEGIN and not self._begun
        self._begun |= begins
        if walker is None:
            if begins and self._hand.target_position is not None:
                self._hand.set_target(self._hand.target_position + self._ahead)
            return
        if begins:
            walker.set_velocity(_WALK, 0.0, 0.0)
            carried = walker.carried["left_hand"]
            carried.set_target(carried.target_position + self._ahead)
        walker.lead(state)


class _OnOneLeg:
    def __init__(self, robot: Robot, stack: Stack, left: str, right: str) -> None:
        self.stack = stack
        self._com, self._pelvis = stack.task("com"), stack.task("pelvis")
        self._foot, self._contact = stack.task("foot"), stack.contact(left)
        home = Dynamics(robot)
        home.update(RobotState(robot.q_home, np.zeros(robot.nv)))
        self._rotation = home.placement(robot.frame_id(robot.pelvis))[1].copy()
        sole = home.placement(robot.frame_id(right))[0]
        self._above = np.array([*sole[:2], home.com[2]])
        self._begin = home.com.copy()
        self._place = home.placement(robot.frame_id(left))[0].copy()
        self._released = False

    def lead(self, state: RobotState) -> None:
        """Shifts the weight, lifts a foot, and turns the pelvis's target."""
        t = state.time
        self._com.set_target(self._begin + _blend(t / _SHIFT) * (self._above - self._begin))
        if t >= _SHIFT and not self._released:
            self._contact.release(_UNLOAD)
            self._released = True
        up = _blend((t - _SHIFT - _UNLOAD) / (_LIFTED - _SHIFT - _UNLOAD))
        self._foot.set_target(self._place + np.array([0.0, 0.0, _LIFT * up]))
        angle = max(t - _TURN_BEGIN, 0.0) * _YAW_RATE
        rate = np.array([0.0, 0.0, 0.0, 0.0, 0.0, _YAW_RATE if angle > 0.0 else 0.0])
        turn = pin.exp3(np.array([0.0, 0.0, angle]))
        self._pelvis.set_target(rotation=turn @ self._rotation, velocity=rate)


def _run(
    robot: Robot, stack: Stack, leader: _FarHand | _OnOneLeg, begin: float, end: float
) -> Outcome:
    plant = Plant(robot, PlantConfig(control_dt=PERIOD))
    controller = WholeBodyController(robot, stack)
    last, fallbacks, most, step = None, 0, 0.0, 0.0
    for tick in rollout(plant, controller, leader, duration=end):
        fallbacks += not tick.command.status.ok
        torque = tick.command.torque
        if torque is not None:
            used = torque / robot.tau_max
            most = max(most, float(np.abs(used).max()))
            if last is not None:
                step = max(step, float(np.abs(used - last).max()))
            last = used
    return Outcome(
        fell=plant.fallen,
        time=plant.time - begin,
        fallbacks=fallbacks,
        torque=most,
        torque_step=step,
    )


def _left_hand(stack: Stack) -> FrameTask:
    return next(
        task
        for _, task in stack.tasks()
        if isinstance(task, FrameTask) and task.frame == "left_hand"
    )


def _blend(part: float) -> float:
    part = min(max(part, 0.0), 1.0)
    return 0.5 - 0.5 * math.cos(math.pi * part)
