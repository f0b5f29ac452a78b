"""`Director`: leads the tasks and contacts of a stack as a scenario wants it.

How far an arm reaches, from the robot's own kinematics.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.apps.scenarios._scenario import ContactChange, Motion, Scenario
from poise.dynamics import Dynamics, Quintic, RobotState, least_jerk
from poise.errors import ConfigurationError, UnknownNameError
from poise.locomotion import CarriedTarget, Walker
from poise.robots import Robot
from poise.sim import Value
from poise.stack import ComTask, FrameTask, JointTask, Stack, Task


def reach_point(
    robot: Robot,
    dynamics: Dynamics,
    hand: str,
    direction: Float64[np.ndarray, "3"],
    ratio: float,
) -> Float64[np.ndarray, "3"]:
    """A point along a direction from the shoulder, at a fraction of the arm's length.

    The shoulder is the first joint between torso and hand; the arm's length is the sum of its
    links' lengths, an upper bound that offsets between joint axes keep from being reached exactly.
    """
    chain = require_arm(robot, hand)
    model = robot.model
    hand_frame = model.frames[robot.frame_id(hand)]
    length = float(np.linalg.norm(hand_frame.placement.translation))
    length += sum(float(np.linalg.norm(model.jointPlacements[j].translation)) for j in chain[1:])
    shoulder = dynamics.joint_position(chain[0])
    return shoulder + ratio * length * direction


def require_arm(robot: Robot, hand: str) -> list[int]:
    """Pinocchio's indices of the joints from the torso to a hand, shoulder first."""
    model = robot.model
    torso = model.frames[robot.frame_id(robot.torso)].parentJoint
    torso_chain = set(model.supports[torso].tolist())
    hand_joint = model.frames[robot.frame_id(hand)].parentJoint
    chain = [j for j in model.supports[hand_joint].tolist() if j not in torso_chain]
    if not chain:
        raise ConfigurationError(
            "no joint between torso and frame to reach with",
            got=hand,
            wanted="a frame at the end of an arm",
            choices=robot.hands,
        )
    return chain


TOUCHDOWN_PATIENCE = 1.0
"""A contact that waits for touchdown is loaded after this long at the latest [s]."""


@dataclass(slots=True)
class _Running:
    """A motion under way: of a point, a posture, or a rotation vector on top of `rotation`."""

    task: FrameTask | ComTask | JointTask
    motion: Motion
    trajectory: Quintic
    rotation: Float64[np.ndarray, "3 3"] | None = None
    carried: CarriedTarget | None = None


class Director:
    """Moves targets and contacts of a stack along a scenario: a `poise.stack.Leader`.

    Attributes:
        stack: what it leads.
        walker: what leads the feet and the balance of a robot that walks; None for others.
    """

    def __init__(self, scenario: Scenario, stack: Stack, robot: Robot) -> None:
        self.stack, self._robot = stack, robot
        self._dynamics = Dynamics(robot)
        self._motions = sorted(scenario.motions, key=lambda m: m.at)
        self._changes = sorted(scenario.contact_changes, key=lambda c: c.at)
        self._running: list[_Running] = []
        tasks = {task.name: task for _, task in stack.tasks()}
        contacts = {contact.name: contact for contact in stack.contacts}
        for motion in self._motions:
            _require(motion.task, tasks, "a motion names an unknown task")
            _check_goal(motion, tasks[motion.task], robot)
        for change in self._changes:
            _require(change.contact, contacts, "a contact change names an unknown contact")
        self._tasks, self._contacts = tasks, contacts
        self.walker = scenario.walker(robot, stack)
        self._velocities = [] if scenario.drive is None else list(scenario.drive.velocities)
        if self.walker is not None:
            _check_beside_walk(scenario, self.walker, tasks)

    def _change_contacts(self, state: RobotState) -> None:
        """Applies changes that are due; one that still waits for touchdown gives way to a later."""
        made = [change for change in self._changes if self._apply(change, state)]
        latest = {change.contact: change.at for change in made}
        self._changes = [
            change
            for change in self._changes
            if change not in made and change.at > latest.get(change.contact, -math.inf)
        ]

    def lead(self, state: RobotState) -> None:
        """Applies everything that is due at the state's time."""
        time = state.time
        if self._changes:
            self._change_contacts(state)
        while self._motions and self._motions[0].at <= time:
            motion = self._motions.pop(0)
            replaced = [r for r in self._running if _replaces(motion, r.motion)]
            for old in replaced:
                _follow(old, motion.at)
            self._running = [r for r in self._running if r not in replaced]
            self._running.append(self._begin(motion, state, replaced[-1] if replaced else None))
        for running in self._running:
            _follow(running, time)
        if self._running:
            self._running = [r for r in self._running if not r.trajectory.is_over(time)]
        if self.walker is not None:
            while self._velocities and self._velocities[0].at <= time:
                self.walker.set_velocity(*self._velocities.pop(0).velocity)
            self.walker.lead(state)

    def signals(self) -> dict[str, Value | str]:
        """What a recorder should know of the last tick: how the walk stands, if there is one."""
        if self.walker is None:
            return {}
        return dict(self.walker.signals())

    def _apply(self, change: ContactChange, state: RobotState) -> bool:
        if state.time < change.at:
            return False
        contact = self._contacts[change.contact]
        if not change.load:
            contact.release(change.over)
            return True
        measured = state.contacts.get(contact.frame)
        touched = measured is not None and measured[2] >= change.touchdown
        if touched or change.touchdown == 0.0 or state.time >= change.at + TOUCHDOWN_PATIENCE:
            contact.engage(change.over)
            return True
        return False

    def _begin(self, motion: Motion, state: RobotState, old: _Running | None) -> _Running:
        """Starts a motion, where the one that it replaces is and as fast as that goes."""
        self._dynamics.update(state)
        task = self._tasks[motion.task]
        if isinstance(task, JointTask):
            start = self._posture_of(task, state)
            # Joints that are not named still arrive where the replaced motion was taking them.
            goal = start.copy() if old is None else old.trajectory.goal
            names = task.joints or self._robot.joint_names
            for joint, angle in (motion.joints or {}).items():
                goal[names.index(joint)] = angle
            return _Running(task, motion, _trajectory(motion, start, goal, old))
        if motion.kind == "turn" and isinstance(task, FrameTask):
            rotation = task.target_rotation
            if rotation is None or self._rests_on_contact(task):
                rotation = self._dynamics.frame(self._robot.frame_id(task.frame)).rotation
            # From rest: rates of two rotation vectors about different axes do not add up.
            return _Running(
                task, motion, _trajectory(motion, np.zeros(3), motion.vector, None), rotation
            )
        carried = None if self.walker is None else self.walker.carried.get(task.name)
        start = self._point_of(task) if carried is None else carried.target_position
        goal = self._goal(motion, task, start)
        moved = task if isinstance(task, ComTask) else _as_frame(task)
        return _Running(moved, motion, _trajectory(motion, start, goal, old), carried=carried)

    def _posture_of(self, task: JointTask, state: RobotState) -> Float64[np.ndarray, " m"]:
        if task.target_position is not None:
            return task.target_position.copy()
        names = task.joints or self._robot.joint_names
        first = self._robot.nq - self._robot.nj
        return state.q[[first + self._robot.joint_index(n) for n in names]]

    def _point_of(self, task: Task) -> Float64[np.ndarray, "3"]:
        if isinstance(task, ComTask):
            target = task.target_position
            return (self._dynamics.com if target is None else target).copy()
        frame_task = _as_frame(task)
        target = frame_task.target_position
        if target is None or self._rests_on_contact(frame_task):
            target = self._dynamics.frame(self._robot.frame_id(frame_task.frame)).position
        return target.copy()

    def _rests_on_contact(self, task: FrameTask) -> bool:
        # A frame in contact is where the contact holds it, whatever its old target.
        return any(c.frame == task.frame and c.active for c in self.stack.contacts)

    def _goal(
        self, motion: Motion, task: Task, start: Float64[np.ndarray, "3"]
    ) -> Float64[np.ndarray, "3"]:
        if motion.kind == "to":
            return motion.vector
        if motion.kind == "by":
            return start + motion.vector
        if motion.reach is not None:
            frame, ratio = _as_frame(task).frame, motion.reach.ratio
            return reach_point(self._robot, self._dynamics, frame, motion.vector, ratio)
        ids = [self._robot.frame_id(sole) for sole in motion.above or ()]
        middle = np.mean([self._dynamics.frame(i).position for i in ids], axis=0)
        return np.array([middle[0], middle[1], start[2]])


def _trajectory(
    motion: Motion,
    start: Float64[np.ndarray, " m"],
    goal: Float64[np.ndarray, " m"],
    old: _Running | None,
) -> Quintic:
    velocity, acceleration = 0.0, 0.0
    if old is not None:
        _, velocity, acceleration = old.trajectory.sample(motion.at)
    return Quintic(
        start=motion.at,
        duration=motion.over,
        position=start,
        goal=goal,
        velocity=velocity,
        acceleration=acceleration,
    )


def _follow(running: _Running, time: float) -> None:
    position, velocity, acceleration = _sample(running.trajectory, time)
    target = (running.carried or running.task).overwrite_target()
    if running.rotation is not None:
        target[1:4] = pin.exp3(position) @ running.rotation
        target[5], target[7] = velocity, acceleration
    elif isinstance(running.task, FrameTask):
        target[0], target[4], target[6] = position, velocity, acceleration
    else:
        target[:] = position, velocity, acceleration


def _sample(
    trajectory: Quintic, time: float
) -> tuple[Float64[np.ndarray, " m"], Float64[np.ndarray, " m"], Float64[np.ndarray, " m"]]:
    """Sample a trajectory, by its phase alone where it began at rest."""
    if not isinstance(trajectory.velocity, float):
        return trajectory.sample(time)
    phase, rate, second = least_jerk(time, trajectory.start, trajectory.duration)
    way = trajectory.goal - trajectory.position
    return trajectory.position + phase * way, rate * way, second * way


def _replaces(new: Motion, old: Motion) -> bool:
    """A later motion of the same quantity takes over where the earlier one is."""
    return new.task == old.task and (new.kind == "turn") == (old.kind == "turn")


def _require(name: str, known: Iterable[str], what: str) -> None:
    if name not in known:
        raise UnknownNameError(what, got=name, choices=known)


def _as_frame(task: Task) -> FrameTask:
    if not isinstance(task, FrameTask):
        raise ConfigurationError(
            f"task {task.name!r} has no point to move", wanted="a com or frame task"
        )
    return task


def _check_goal(motion: Motion, task: Task, robot: Robot) -> None:
    """Refuses before the first tick what `_begin` could not do, or what would move nothing."""
    allowed: tuple[str, ...] = ()
    points = ("to", "by", "above", "reach")
    if isinstance(task, JointTask):
        allowed = ("joints",)
    elif isinstance(task, ComTask):
        allowed = ("to", "by", "above")
    elif isinstance(task, FrameTask):
        allowed = {"m": points, "rad": ("turn",)}.get(task.unit, (*points, "turn"))
    if motion.kind not in allowed:
        raise ConfigurationError(
            f"a motion of task {task.name!r} cannot be given like this",
            got=motion.kind,
            choices=allowed,
        )
    for sole in motion.above or ():
        robot.frame_id(sole)
    if motion.kind == "reach" and isinstance(task, FrameTask):
        require_arm(robot, task.frame)
    if isinstance(task, JointTask):
        names = task.joints or robot.joint_names
        for joint, angle in (motion.joints or {}).items():
            _require(joint, names, f"a motion of task {task.name!r}: unknown joint")
            _check_angle(joint, angle, robot)


def _check_beside_walk(scenario: Scenario, walker: Walker, tasks: Mapping[str, Task]) -> None:
    """Refuses motions and contact changes that the walk leads itself."""
    for motion in scenario.motions:
        task = tasks[motion.task]
        if walker.leads(task):
            raise ConfigurationError(
                "a motion of a task that the walk leads",
                got=motion.task,
                choices=[t.name for t in tasks.values() if not walker.leads(t)],
            )
        if motion.task in walker.carried and motion.kind != "by":
            raise ConfigurationError(
                f"a motion of task {motion.task!r}, which goes along with the walk",
                got=motion.kind,
                wanted='a shift "by", or a walk that does not carry the task',
            )
    for change in scenario.contact_changes:
        if walker.holds(change.contact):
            raise ConfigurationError(
                "a contact change of a sole that walks", got=change.contact, wanted="no change"
            )


def _check_angle(joint: str, angle: float, robot: Robot) -> None:
    i = robot.joint_index(joint)
    low, high = float(robot.q_min[i]), float(robot.q_max[i])
    if not low <= angle <= high:
        raise ConfigurationError(
            f"a motion takes joint {joint!r} beyond its limits",
            got=angle,
            wanted=f"{low:g} to {high:g} rad",
        )
