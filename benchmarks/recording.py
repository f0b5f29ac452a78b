"""`record_run`: a moving run, recorded once, so that every method is timed on the same states.

`bench_stack`: the tasks that are timed, on two feet or on one. `Path`, `Loop`: where targets are.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from benchmarks.methods import REFERENCE, Method
from poise.control import make_controller
from poise.dynamics import Dynamics, RobotState, least_jerk
from poise.errors import ConfigurationError, PoiseError
from poise.robots import Robot
from poise.sim import Plant, rollout
from poise.stack import (
    BalanceLimit,
    ComTask,
    Contact,
    FrameTask,
    PostureTask,
    Stack,
    SurfaceContact,
    Task,
    default_stack,
)

STANCES = ("double", "single")
"""Feet on the ground: both, or the right one."""

STACKS = ("table1", "default")
"""Stacks: the four levels of the paper's table, or Poise's own with a posture level."""

_FRICTION = 0.7
"""Of `paper_contacts`."""


def swing_sole(robot: Robot) -> str:
    """The sole that is in the air in single support: the left one."""
    return next(iter(robot.soles))


def support_sole(robot: Robot) -> str:
    """The sole that stays on the ground in single support: the right one."""
    return list(robot.soles)[1]


def check_biped(robot: Robot) -> None:
    """Refuses a robot that cannot stand on two soles."""
    if not robot.floating_base or len(robot.soles) < 2:
        raise ConfigurationError(
            "a benchmark of a standing robot needs a floating base and two soles",
            got=robot.name,
            wanted="a biped, such as humanoid33 or g1",
        )


def bench_stack(robot: Robot, kind: str, stance: str) -> Stack:
    """A new stack: the levels to time.

    "table1" is Table 1 of Ahn et al. 2024: dynamics and torque limits; contacts, wrench cones and
    acceleration limits; CoM and pelvis orientation; poses of the end effectors. It has no balance
    limit and no bound on the change of torques, as the paper has none, and `paper_contacts`.
    "default" is `default_stack`, which adds the torso's orientation and, below everything, a level
    with the posture of all joints. In single support the swing foot is one more end effector.
    """
    base = default_stack(robot)
    levels = [list(level) for level in base.levels]
    if kind == "table1":
        levels = [[task for task in level if not _is_extra(task, robot)] for level in levels]
        levels = [level for level in levels if level]
    contacts = paper_contacts(robot) if kind == "table1" else list(base.contacts)
    if stance == "single":
        contacts = [c for c in contacts if c.frame != swing_sole(robot)]
        swing = FrameTask(swing_sole(robot), kp=100.0)
        # With the hands, second in importance to balance; alone there on a robot without hands.
        if len(levels) > 1 and not isinstance(levels[1][0], PostureTask):
            levels[1].append(swing)
        else:
            levels.insert(1, [swing])
    return Stack(
        contacts,
        levels,
        balance_limit=BalanceLimit(enabled=kind != "table1"),
        # Table 1 of the paper is strict.
        softening=0.0 if kind == "table1" else default_stack(robot).softening,
    )


def paper_contacts(robot: Robot) -> list[Contact]:
    """Contacts of all soles with the ten rows of Ahn et al. 2024, as other packages have them.

    The yaw moment is bounded by half of what friction holds on four corners that share the load,
    wherever the centre of pressure is.
    """
    contacts: list[Contact] = []
    for sole in robot.soles.values():
        corner = 0.5 * math.hypot(sole.length, sole.width)
        torsion = 0.5 * _FRICTION * corner
        contacts.append(SurfaceContact(sole.name, friction=_FRICTION, torsion=torsion))
    return contacts


def _is_extra(task: Task, robot: Robot) -> bool:
    """What the default stack has and the paper's table has not."""
    turns_torso = isinstance(task, FrameTask) and task.frame == robot.torso != robot.pelvis
    return isinstance(task, PostureTask) or turns_torso


Point = tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3"], Float64[np.ndarray, "3"]]
"""Position [m], velocity [m/s] and acceleration [m/s^2] of a target in the world."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Path:
    """A target over the ticks of a recording."""

    position: Float64[np.ndarray, "ticks 3"]  # in the world [m]
    velocity: Float64[np.ndarray, "ticks 3"]  # [m/s]
    acceleration: Float64[np.ndarray, "ticks 3"]  # [m/s^2]

    @classmethod
    def of(cls, points: list[Point]) -> "Path":
        """The path through points, one a tick."""
        position, velocity, acceleration = (
            np.array(column) for column in zip(*points, strict=True)
        )
        return cls(position=position, velocity=velocity, acceleration=acceleration)


@dataclass(frozen=True, kw_only=True, eq=False)
class Loop:
    """A point on centre + displacement s(t) + amplitude r(t) sin(2 pi f t + phase)."""

    centre: Float64[np.ndarray, "3"]  # where it is before anything moves [m]
    # Of the centre, by a motion of least jerk with the phase s [m]
    displacement: Float64[np.ndarray, "3"]
    shift: tuple[float, float]  # when that motion begins, and how long it takes [s]
    amplitude: Float64[np.ndarray, "3"]  # by axis [m]
    phase: Float64[np.ndarray, "3"]  # by axis [rad]
    frequency: float  # f [1/s]
    # When the amplitude begins to grow, r from zero to one, and how long it takes [s]
    swell: tuple[float, float]

    def at(self, time: float) -> Point:
        """The point at a time [s]."""
        s, ds, dds = least_jerk(time, *self.shift)
        r, dr, ddr = least_jerk(time, *self.swell)
        w = 2.0 * np.pi * self.frequency
        angle = w * time + self.phase
        sine, cosine = np.sin(angle), np.cos(angle)
        swing, rate = self.amplitude * sine, self.amplitude * w * cosine
        return (
            self.centre + s * self.displacement + r * swing,
            ds * self.displacement + dr * swing + r * rate,
            dds * self.displacement + ddr * swing + 2.0 * dr * rate - r * w * w * swing,
        )


Progress = Callable[[float, float], None]
"""Called with what is done and what there is in all."""

SWELL = 0.4
"""The motion reaches its full size after this long; recording starts then [s]."""

_RAISE = 0.8
"""How long the hands take to where they have room to go round [s]."""

_SHIFT, _UNLOAD, _LIFT = 1.8, 0.2, 0.6
"""Single support: how long the weight shifts, the foot is unloaded, the foot is lifted [s]."""

_COM_SHARE = np.array([0.015, 0.02, 0.015])
"""Amplitude of the CoM on two feet, as a share of its height; a third of it on one foot."""

_HAND_SHARE = 0.03
"""Radius of the hands' circles, as a share of the height of the CoM."""

_RAISE_SHARE = np.array([0.05, 0.0, 0.05])
"""Where the hands go first, from hanging arms that have no way to go down, as a share likewise."""

_FOOT_SHARE = 0.08
"""Lift of the swing foot by the height of the CoM."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Recording:
    """States and targets of a run, tick by tick."""

    robot: Robot  # whose run
    stance: str  # one of `STANCES`
    states: tuple[RobotState, ...]  # what the controller was told, one a tick
    paths: Mapping[str, Path]  # moving targets by task name
    # Orientations that are held, world_R_frame by task name
    rotations: Mapping[str, Float64[np.ndarray, "3 3"]]

    def prepare(self, stack: Stack) -> None:
        """Gives a bound stack the targets that stay the same."""
        _hold(stack, self.rotations)

    def aim(self, stack: Stack, tick: int) -> None:
        """Gives a bound stack the moving targets of a tick."""
        for _, task in stack.tasks():
            path = self.paths.get(task.name)
            if path is not None:
                point = (path.position[tick], path.velocity[tick], path.acceleration[tick])
                _set_point(task, point)


def record_run(
    robot: Robot,
    stance: str,
    ticks: int,
    progress: Progress | None = None,
    *,
    method: Method = REFERENCE,
) -> Recording:
    """Runs a robot in simulation and records it while everything moves.

    On two feet the CoM and both hands go round; on one foot the weight is shifted and the left
    foot lifted first, then CoM, hands and foot go round. What happens before is not recorded. The
    levels are those of the robot's default stack, at the plant's own period.
    """
    check_biped(robot)
    plant = Plant(robot)
    # Both contacts, whatever the stance: the swing foot is unloaded on the way.
    levels = bench_stack(robot, "default", stance).levels
    stack = Stack(
        default_stack(robot).contacts,
        levels,
        balance_limit=BalanceLimit(enabled=False),
    )
    controller = make_controller(robot, stack, method.plan())
    begin = _loops_begin(stance)
    loops, rotations = _choreograph(robot, stack, stance, begin)
    states: list[RobotState] = []
    points: dict[str, list[Point]] = {name: [] for name in loops}
    _hold(stack, rotations)
    released = stance == "double"
    total = begin + SWELL + ticks * plant.config.control_dt

    def lead(state: RobotState) -> None:
        nonlocal released
        if not released and state.time >= _SHIFT:
            stack.contact(swing_sole(robot)).release(_UNLOAD)
            released = True
        for name, loop in loops.items():
            point = loop.at(state.time)
            _set_point(stack.task(name), point)
            if state.time >= begin + SWELL:
                points[name].append(point)

    for tick in rollout(plant, controller, lead):
        if tick.time >= begin + SWELL:
            states.append(tick.state)
        if plant.fallen:
            raise PoiseError(f"{robot.name} fell at {plant.time:.3f} s while recording the run")
        if progress is not None:
            progress(plant.time, total)
        if len(states) == ticks:
            break
    return Recording(
        robot=robot,
        stance=stance,
        states=tuple(states),
        paths={name: Path.of(column) for name, column in points.items()},
        rotations=rotations,
    )


def _loops_begin(stance: str) -> float:
    """When everything starts to go round [s]."""
    return _RAISE if stance == "double" else _SHIFT + _UNLOAD + _LIFT


def _choreograph(
    robot: Robot, stack: Stack, stance: str, begin: float
) -> tuple[dict[str, Loop], dict[str, Float64[np.ndarray, "3 3"]]]:
    """Moving points and held orientations by task name, from the home posture."""
    dynamics = Dynamics(robot)
    height = float(dynamics.com[2])
    swell = (begin, SWELL)
    loops: dict[str, Loop] = {}
    rotations: dict[str, Float64[np.ndarray, "3 3"]] = {}
    for _, task in stack.tasks():
        if isinstance(task, ComTask):
            displacement, scale = np.zeros(3), 1.0
            if stance == "single":
                sole = dynamics.frame(robot.frame_id(support_sole(robot))).position
                displacement[:2], scale = sole[:2] - dynamics.com[:2], 1.0 / 3.0
            loops[task.name] = Loop(
                centre=dynamics.com.copy(),
                displacement=displacement,
                shift=(0.0, _SHIFT),
                amplitude=scale * height * _COM_SHARE,
                phase=np.array([0.0, 0.5 * np.pi, 0.0]),
                frequency=0.5,
                swell=swell,
            )
        elif isinstance(task, FrameTask):
            frame = dynamics.frame(robot.frame_id(task.frame))
            rotations[task.name] = frame.rotation.copy()
            if task.frame in robot.hands or task.frame in robot.soles:
                loops[task.name] = _limb_loop(robot, task.frame, frame.position, height, swell)
    return loops, rotations


def _limb_loop(
    robot: Robot,
    name: str,
    position: Float64[np.ndarray, "3"],
    height: float,
    swell: tuple[float, float],
) -> Loop:
    if name in robot.soles:
        displacement, shift = np.array([0.0, 0.0, _FOOT_SHARE]), (_SHIFT + _UNLOAD, _LIFT)
        amplitude = 0.5 * _FOOT_SHARE * np.array([1.0, 0.0, 0.5])
    else:
        displacement, shift = _RAISE_SHARE, (0.0, _RAISE)
        amplitude = _HAND_SHARE * np.array([1.0, 0.5, 1.0])
    return Loop(
        centre=position.copy(),
        displacement=height * displacement,
        shift=shift,
        amplitude=height * amplitude,
        phase=np.array([0.0, 0.0, 0.5 * np.pi]),
        frequency=0.7,
        swell=swell,
    )


def _hold(stack: Stack, rotations: Mapping[str, Float64[np.ndarray, "3 3"]]) -> None:
    for _, task in stack.tasks():
        if isinstance(task, FrameTask) and task.name in rotations:
            task.set_target(rotation=rotations[task.name])


def _set_point(task: object, point: Point) -> None:
    position, velocity, acceleration = point
    if isinstance(task, ComTask):
        task.set_target(position, velocity, acceleration)
    elif isinstance(task, FrameTask):
        still = np.zeros(3)
        task.set_target(
            position=position,
            velocity=np.concatenate((velocity, still)),
            acceleration=np.concatenate((acceleration, still)),
        )
