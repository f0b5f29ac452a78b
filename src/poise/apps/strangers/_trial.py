"""`try_out`: a robot stands, squats and reaches in simulation, and what went wrong is said.

One with a fixed base holds still and reaches.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin
from jaxtyping import Bool, Float64

from poise._show import few
from poise.control import WholeBodyController
from poise.dynamics import RobotState
from poise.errors import RobotError
from poise.robots import Robot, standing_posture
from poise.sim import Plant, Tick, rollout
from poise.stack import ComTask, FrameTask, PostureTask, Stack, SurfaceContact, Task

_DEPTHS = (0.1, 0.075, 0.05, 0.025)
"""A squat goes down by the first of these parts of the COM's height that the legs' limits allow."""

_SWING = 0.5
"""Hands go where a joint of the arm takes them by turning this much [rad]."""

_FORWARD_AND_UP = np.array([0.6, 0.0, 0.8])
"""Direction in which a reach should go."""

_STOP = 0.02
"""A joint stands at its stop within this part of its range: limits brake it before."""

_LOW = 0.9
"""A squat counts where this part of its depth was reached."""

_FREE_LEG = 6
"""Joints that a leg needs for a pelvis that holds its place and its orientation."""

_CLOSE = 0.15
"""A hand has arrived within this part of the way it had to go."""

_DRIFT = 0.01
"""The COM of a robot that stands and hands that are held end this near to where they began [m]."""

_SATURATED = 0.999
"""Part of its torque limit at which a joint has no more to give."""

_SETTLED = 0.3
"""Torques are judged after this time [s]: a plant may begin with a landing."""


@dataclass(frozen=True, kw_only=True)
class Attempt:
    """One thing tried.

    Attributes:
        name: "stand", "squat", "hold" or "reach".
        ok: whether it went well.
        words: what was wrong, as sentences; what was reached where nothing was.
        seconds: wall-clock time it took [s].
        com_error: largest distance of the COM from its target, level, after settling [m].
        reached: how far the COM came down, for a squat [m].
        torque_ratio: largest part of a torque limit that was asked for, after settling.
        weakest: the joint it was asked of.
    """

    name: str
    ok: bool
    words: tuple[str, ...]
    seconds: float
    com_error: float
    reached: float
    torque_ratio: float
    weakest: str


@dataclass(frozen=True, kw_only=True)
class Trial:
    """What a robot did when it was tried out.

    Attributes:
        robot: which robot.
        attempts: one for each thing tried, in order.
    """

    robot: Robot = field(repr=False)
    attempts: tuple[Attempt, ...]

    @property
    def ok(self) -> bool:
        """Whether all went well."""
        return all(attempt.ok for attempt in self.attempts)


def try_out(robot: Robot) -> Trial:
    """Let a biped stand, squat and, where it has hands, reach: balance first, then hands.

    A robot with a fixed base holds its posture in place of standing and squatting.

    Args:
        robot: a biped, or a robot with a fixed base.

    Returns:
        What went well, and in words what did not.

    Raises:
        RobotError: the robot cannot be simulated.
    """
    attempts = [_attempt(robot, _STAND if robot.soles else _HOLD)]
    if attempts[0].ok:
        if robot.soles:
            attempts.append(_attempt(robot, _SQUAT))
        if robot.hands:
            attempts.append(_attempt(robot, _REACHING))
    return Trial(robot=robot, attempts=tuple(attempts))


@dataclass
class _Motion:
    """What is asked of a robot, and whether it came about."""

    name: str
    duration: float
    lead: Callable[["_Scene", float], None]
    judge: Callable[["_Scene"], list[str]]


class _Scene:
    """A robot in its plant under a controller, and what a rollout shows of them."""

    def __init__(self, robot: Robot) -> None:
        self.robot, self.plant = robot, Plant(robot)
        self.hands = {hand: FrameTask(hand, axes="position", kp=60.0) for hand in robot.hands}
        self.com, self.posture = ComTask(kp=60.0), PostureTask()
        self.controller = WholeBodyController(robot, self._stack())
        self.start = np.array(self.controller.dynamics.com)
        self.begun = {hand: self.place(hand) for hand in self.hands}
        swings = {hand: _swing(robot, hand) for hand in self.hands}
        self.ways = {hand: way for hand, (way, _) in swings.items()}
        self.turn = sum((turned for _, turned in swings.values()), np.zeros(robot.nj))
        self.posture_home = robot.q_home[robot.nq - robot.nj :].copy()
        self.depth = _depth(robot, float(self.start[2])) if robot.soles else 0.0
        self.lowest = float(self.start[2])
        self.peak = np.zeros(robot.nj)
        self.error = self.end = 0.0
        self.missed = self.ticks = 0
        self.at_stop: set[str] = set()

    def _stack(self) -> Stack:
        """As the shipped scenarios have it: balance, then hands, then the rest.

        Legs of five joints cannot hold COM and pelvis both: the waist and the arms would have to
        swing for it. There the pelvis comes after the hands.
        """
        hands: list[Task] = [*self.hands.values()]
        if not self.robot.soles:
            return Stack(levels=[level for level in (hands, [self.posture]) if level])
        com: list[Task] = [self.com]
        pelvis: list[Task] = [FrameTask(self.robot.pelvis, axes="orientation", kp=100.0)]
        six = all(len(self.robot.leg_joints(sole)) >= _FREE_LEG for sole in self.robot.soles)
        levels = [com + pelvis, hands] if six else [com, hands, pelvis]
        contacts = [SurfaceContact(sole) for sole in self.robot.soles]
        filled = [level for level in levels if level]
        return Stack(contacts=contacts, levels=[*filled, [self.posture]])

    def place(self, frame: str) -> Float64[np.ndarray, "3"]:
        """Where a frame is [m]."""
        return np.array(self.controller.dynamics.frame(self.robot.frame_id(frame)).position)

    def observe(self, tick: Tick) -> None:
        """Takes a tick in."""
        robot, command, com = self.robot, tick.command, self.controller.dynamics.com
        self.ticks, self.end = self.ticks + 1, tick.time
        self.missed += not command.status.ok
        self.lowest = min(self.lowest, float(com[2]))
        if command.torque is not None and (tick.time > _SETTLED or self.plant.fallen):
            self.peak = np.maximum(self.peak, np.abs(command.torque) / robot.tau_max)
            self.error = max(self.error, float(np.linalg.norm((com - self.start)[:2])))
        joints = tick.state.q[robot.nq - robot.nj :]
        margin = _STOP * (robot.q_max - robot.q_min)
        stops = (joints < robot.q_min + margin) | (joints > robot.q_max - margin)
        self.at_stop |= {robot.joint_names[i] for i in np.flatnonzero(stops)}


def _attempt(robot: Robot, motion: _Motion) -> Attempt:
    """A rollout of a motion, and what is wrong with it."""
    begin = time.perf_counter()
    scene = _Scene(robot)

    def lead(state: RobotState) -> None:
        motion.lead(scene, state.time)

    for tick in rollout(scene.plant, scene.controller, lead, duration=motion.duration):
        scene.observe(tick)
    wrong = [f"it fell after {scene.end:.2f} s of {motion.duration:g} s"]
    if not scene.plant.fallen:
        wrong = motion.judge(scene)
    if scene.missed:
        wrong.append(f"{scene.missed} of {scene.ticks} ticks had no solution")
    if wrong:
        wrong += _causes(scene)
    worst = int(np.argmax(scene.peak))
    return Attempt(
        name=motion.name,
        ok=not wrong,
        words=tuple(wrong),
        seconds=time.perf_counter() - begin,
        com_error=scene.error,
        reached=float(scene.start[2]) - scene.lowest,
        torque_ratio=float(scene.peak[worst]),
        weakest=robot.joint_names[worst],
    )


def _causes(scene: _Scene) -> Iterator[str]:
    """What may be behind something that went wrong."""
    robot = scene.robot
    if weak := _where(robot, scene.peak > _SATURATED):
        yield f"torques at their limits: {few(weak)}"
    if scene.at_stop:
        yield f"joints at their stops: {few(sorted(scene.at_stop))}"
    if bare := _where(robot, robot.model.armature[robot.nv - robot.nj :] == 0.0):
        yield f"no rotor inertia (armature): {few(bare)}"


def _where(robot: Robot, mask: Bool[np.ndarray, " nj"]) -> list[str]:
    return [robot.joint_names[i] for i in np.flatnonzero(mask)]


def _ramp(time: float, *points: tuple[float, float]) -> float:
    """Between points in time and value, smooth where a value stays."""
    part = float(np.interp(time, [t for t, _ in points], [v for _, v in points]))
    return part * part * (3.0 - 2.0 * part)


def _hold(scene: _Scene, _time: float) -> None:
    scene.com.set_target(scene.start)


def _held(scene: _Scene) -> list[str]:
    drift = float(np.linalg.norm(scene.controller.dynamics.com - scene.start))
    return [f"its COM went {1e3 * drift:.0f} mm astray"] if drift > _DRIFT else []


def _leave(_scene: _Scene, _time: float) -> None:
    """Targets stay where they begin."""


def _stayed(scene: _Scene) -> list[str]:
    wrong: list[str] = []
    for hand, begun in scene.begun.items():
        drift = float(np.linalg.norm(scene.place(hand) - begun))
        if drift > _DRIFT:
            wrong.append(f"{hand} went {1e3 * drift:.0f} mm astray")
    return wrong


def _down_and_up(scene: _Scene, time: float) -> None:
    part = _ramp(time, (0.3, 0.0), (1.8, 1.0), (2.3, 1.0), (3.8, 0.0))
    scene.com.set_target(scene.start - [0.0, 0.0, part * scene.depth])


def _depth(robot: Robot, height: float) -> float:
    """How far a squat goes down [m]."""
    for part in _DEPTHS:
        try:
            # A little further than asked for: the controller brakes before a limit.
            standing_posture(robot, com_height=(1.0 - 1.2 * part) * height)
        except RobotError:
            continue
        return part * height
    # Legs of five joints have no such posture with toes straight ahead: they are tried anyhow.
    return _DEPTHS[0] * height


def _came_down(scene: _Scene) -> list[str]:
    wrong = _held(scene)
    depth, came = scene.depth, scene.start[2] - scene.lowest
    if came < _LOW * depth:
        wrong.append(f"it came down by {1e3 * came:.0f} mm of {1e3 * depth:.0f} mm")
    return wrong


def _swing(robot: Robot, hand: str) -> tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, " nj"]]:
    """How one joint of the arm takes the hand furthest forward and up: [m], and by joint [rad].

    Where none does, as with an arm that points up, the furthest anywhere.
    """
    model, data, q = robot.model, robot.model.createData(), robot.q_home
    frame, trunk = robot.frame_id(hand), robot.joints_above(robot.torso)
    best, most, turned = np.zeros(3), (False, 0.0), np.zeros(robot.nj)
    pin.framesForwardKinematics(model, data, q)
    begun = data.oMf[frame].translation.copy()
    for joint in robot.joints_above(hand):
        if joint in trunk:
            continue
        place, index = model.joints[joint].idx_q, robot.joint_index(model.names[joint])
        for swing in (_SWING, -_SWING):
            moved = q.copy()
            moved[place] = np.clip(q[place] + swing, robot.q_min[index], robot.q_max[index])
            pin.framesForwardKinematics(model, data, moved)
            way = data.oMf[frame].translation - begun
            there = float(way @ _FORWARD_AND_UP)
            far = (there > 0.0, there if there > 0.0 else float(np.linalg.norm(way)))
            if far > most:
                best, most = way, far
                turned = (moved - q)[robot.nq - robot.nj :]
    return best, turned


def _out(scene: _Scene, time: float) -> None:
    part = _ramp(time, (0.3, 0.0), (2.0, 1.0))
    # The arm's own posture goes along, or it may end up at a stop beside the way.
    scene.posture.set_target(scene.posture_home + part * scene.turn)
    for hand, task in scene.hands.items():
        task.set_target(scene.begun[hand] + part * scene.ways[hand])


def _arrived(scene: _Scene) -> list[str]:
    wrong: list[str] = []
    for hand in scene.hands:
        way = scene.ways[hand]
        missing = float(np.linalg.norm(scene.begun[hand] + way - scene.place(hand)))
        if missing > _CLOSE * float(np.linalg.norm(way)):
            wrong.append(f"{hand} stayed {1e3 * missing:.0f} mm away from its target")
    return wrong


_STAND = _Motion("stand", 2.0, _hold, _held)
_HOLD = _Motion("hold", 2.0, _leave, _stayed)
_SQUAT = _Motion("squat", 4.3, _down_and_up, _came_down)
_REACHING = _Motion("reach", 3.0, _out, _arrived)
