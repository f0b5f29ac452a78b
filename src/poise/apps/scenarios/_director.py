"""`Director`: a leader that moves tasks and contacts of a stack along a scenario."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.apps.scenarios._scenario import ContactChange, Scenario, TargetMotion
from poise.dynamics import Dynamics, Quintic, RobotState, least_jerk
from poise.errors import ConfigurationError, UnknownNameError
from poise.locomotion import CarriedTarget
from poise.robots import Robot
from poise.sim import Value
from poise.stack import ComTask, FrameTask, JointTask, Stack, Task

TOUCHDOWN_PATIENCE = 1.0
"""A contact that waits for touchdown is loaded after this long at the latest [s]."""

_POINTS = ("to", "by", "above", "reach")


@dataclass(slots=True)
class _Running:
    """A motion under way: of a point, a posture, or a rotation vector on top of `rotation`."""

    task: FrameTask | ComTask | JointTask
    motion: TargetMotion
    trajectory: Quintic
    rotation: Float64[np.ndarray, "3 3"] | None = None
    carried: CarriedTarget | None = None

    def follow(self, time: float) -> None:
        """Set the target at a time [s]."""
        course = self.trajectory
        if isinstance(course.velocity, float):
            # From rest the phase alone decides.
            phase, rate, second = least_jerk(time, course.start, course.duration)
            way = course.goal - course.position
            sample = course.position + phase * way, rate * way, second * way
        else:
            sample = course.sample(time)
        target = (self.carried or self.task).overwrite_target()
        if self.rotation is not None:
            target[1:4] = pin.exp3(sample[0]) @ self.rotation
            target[5], target[7] = sample[1:]
        elif isinstance(self.task, FrameTask):
            target[0], target[4], target[6] = sample
        else:
            target[:] = sample

    def gives_way_to(self, later: TargetMotion) -> bool:
        """True for the same quantity, which the later motion takes over where it is."""
        motion = self.motion
        return later.task == motion.task and (later.kind == "turn") == (motion.kind == "turn")


class Director:
    """Move targets and contacts of a stack along a scenario.

    Attributes:
        stack: the stack.
        walker: leader of the feet and the balance of a robot that walks; None for others.
    """

    def __init__(self, scenario: Scenario, stack: Stack, robot: Robot) -> None:
        self.stack, self._robot = stack, robot
        self._dynamics = Dynamics(robot)
        self._motions = sorted(scenario.motions, key=lambda m: m.at)
        self._changes = sorted(scenario.contact_changes, key=lambda c: c.at)
        self._running: list[_Running] = []
        self._tasks = {task.name: task for _, task in stack.tasks()}
        self._contacts = {contact.name: contact for contact in stack.contacts}
        for motion in self._motions:
            _require(motion.task, self._tasks, "a motion names an unknown task")
            _check_goal(motion, self._tasks[motion.task], robot)
        for change in self._changes:
            _require(change.contact, self._contacts, "a contact change names an unknown contact")
        self.walker = scenario.walker(robot, stack)
        self._velocities = [] if scenario.drive is None else list(scenario.drive.velocities)
        self._check_beside_walk()
        self._paused, self._last = 0.0, math.nan

    def pause(self, state: RobotState) -> None:
        """Leave the targets where they are, and begin later what comes; a walk goes on.

        Args:
            state: as the estimator gave it.
        """
        if self.walker is not None:
            self.lead(state)
            return
        if state.time > self._last:
            self._paused += state.time - self._last
        self._last = state.time

    def lead(self, state: RobotState) -> None:
        """Apply everything that is due at the state's time."""
        self._last = state.time
        time = state.time - self._paused
        if self._changes:
            self._change_contacts(state)
        while self._motions and self._motions[0].at <= time:
            motion = self._motions.pop(0)
            replaced = [r for r in self._running if r.gives_way_to(motion)]
            for old in replaced:
                old.follow(motion.at)
            self._running = [r for r in self._running if r not in replaced]
            self._running.append(self._begin(motion, state, replaced[-1] if replaced else None))
        for running in self._running:
            running.follow(time)
        if self._running:
            self._running = [r for r in self._running if not r.trajectory.is_over(time)]
        if self.walker is not None:
            while self._velocities and self._velocities[0].at <= time:
                self.walker.set_velocity(*self._velocities.pop(0).velocity)
            self.walker.lead(state)

    def signals(self) -> dict[str, Value | str]:
        """Signals of the walk in the last tick, if there is one."""
        return {} if self.walker is None else dict(self.walker.signals())

    def _change_contacts(self, state: RobotState) -> None:
        """Apply changes that are due; one that still waits for touchdown gives way to a later."""
        made = [change for change in self._changes if self._apply(change, state)]
        latest = {change.contact: change.at for change in made}
        self._changes = [
            change
            for change in self._changes
            if change not in made and change.at > latest.get(change.contact, -math.inf)
        ]

    def _apply(self, change: ContactChange, state: RobotState) -> bool:
        if state.time - self._paused < change.at:
            return False
        contact = self._contacts[change.contact]
        if not change.load:
            contact.release(change.over)
            return True
        measured = state.contacts.get(contact.frame)
        touched = measured is not None and measured[2] >= change.touchdown
        if (
            touched
            or change.touchdown == 0.0
            or state.time - self._paused >= change.at + TOUCHDOWN_PATIENCE
        ):
            contact.engage(change.over)
            return True
        return False

    def _begin(self, motion: TargetMotion, state: RobotState, old: _Running | None) -> _Running:
        """Start a motion, where the one that it replaces is and with its rates."""
        self._dynamics.update(state)
        task = self._tasks[motion.task]
        rotation, carried = None, None
        if isinstance(task, JointTask):
            start = self._posture_of(task, state)
            # Joints that are not named still arrive where the replaced motion was taking them.
            goal = start.copy() if old is None else old.trajectory.goal
            names = task.joints or self._robot.joint_names
            for joint, angle in (motion.joints or {}).items():
                goal[names.index(joint)] = angle
        elif motion.kind == "turn" and isinstance(task, FrameTask):
            rotation = task.target_rotation
            if rotation is None or self._rests_on_contact(task):
                rotation = self._dynamics.frame(self._robot.frame_id(task.frame)).rotation
            # From rest: rates of two rotation vectors about different axes do not add up.
            start, goal, old = np.zeros(3), motion.vector, None
        else:
            assert isinstance(task, ComTask | FrameTask)
            carried = None if self.walker is None else self.walker.carried.get(task.name)
            start = self._point_of(task) if carried is None else carried.target_position
            goal = self._goal(motion, task, start)
        velocity, acceleration = 0.0, 0.0
        if old is not None:
            _, velocity, acceleration = old.trajectory.sample(motion.at)
        trajectory = Quintic(
            start=motion.at,
            duration=motion.over,
            position=start,
            goal=goal,
            velocity=velocity,
            acceleration=acceleration,
        )
        return _Running(task, motion, trajectory, rotation, carried)

    def _posture_of(self, task: JointTask, state: RobotState) -> Float64[np.ndarray, " m"]:
        if task.target_position is not None:
            return task.target_position.copy()
        names = task.joints or self._robot.joint_names
        first = self._robot.nq - self._robot.nj
        return state.q[[first + self._robot.joint_index(n) for n in names]]

    def _point_of(self, task: ComTask | FrameTask) -> Float64[np.ndarray, "3"]:
        target = task.target_position
        if isinstance(task, ComTask):
            return (self._dynamics.com if target is None else target).copy()
        if target is None or self._rests_on_contact(task):
            target = self._dynamics.frame(self._robot.frame_id(task.frame)).position
        return target.copy()

    def _rests_on_contact(self, task: FrameTask) -> bool:
        # A frame in contact is where the contact holds it, whatever its old target.
        return any(c.frame == task.frame and c.active for c in self.stack.contacts)

    def _goal(
        self, motion: TargetMotion, task: ComTask | FrameTask, start: Float64[np.ndarray, "3"]
    ) -> Float64[np.ndarray, "3"]:
        if motion.kind == "to":
            return motion.vector
        if motion.kind == "by":
            return start + motion.vector
        if motion.reach is not None and isinstance(task, FrameTask):
            # The shoulder is the arm's first joint. Its length is the sum of its links' lengths,
            # which offsets between joint axes keep the hand from reaching exactly.
            chain, model = require_arm(self._robot, task.frame), self._robot.model
            hand = model.frames[self._robot.frame_id(task.frame)].placement.translation
            links = [model.jointPlacements[joint].translation for joint in chain[1:]]
            length = float(np.linalg.norm(hand)) + sum(float(np.linalg.norm(x)) for x in links)
            shoulder = self._dynamics.joint_position(chain[0])
            return shoulder + motion.reach.ratio * length * motion.vector
        ids = [self._robot.frame_id(sole) for sole in motion.above or ()]
        middle = np.mean([self._dynamics.frame(i).position for i in ids], axis=0)
        return np.array([middle[0], middle[1], start[2]])

    def _check_beside_walk(self) -> None:
        """Refuse motions and contact changes of what the walk itself moves."""
        walker = self.walker
        if walker is None:
            return
        for motion in self._motions:
            if walker.leads(self._tasks[motion.task]):
                raise ConfigurationError(
                    "a motion of a task that the walk leads",
                    got=motion.task,
                    choices=[name for name, t in self._tasks.items() if not walker.leads(t)],
                )
            if motion.task in walker.carried and motion.kind != "by":
                raise ConfigurationError(
                    f"a motion of task {motion.task!r}, which goes along with the walk",
                    got=motion.kind,
                    wanted='a shift "by", or a walk that does not carry the task',
                )
        for change in self._changes:
            if walker.holds(change.contact):
                what = "a contact change of a sole that walks"
                raise ConfigurationError(what, got=change.contact, wanted="no change")


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


def _require(name: str, known: Iterable[str], what: str) -> None:
    if name not in known:
        raise UnknownNameError(what, got=name, choices=known)


def _check_goal(motion: TargetMotion, task: Task, robot: Robot) -> None:
    """Reject, before the first tick, motions that cannot begin or have no effect."""
    allowed: tuple[str, ...] = ()
    if isinstance(task, JointTask):
        allowed = ("joints",)
    elif isinstance(task, ComTask):
        allowed = ("to", "by", "above")
    elif isinstance(task, FrameTask):
        allowed = {"m": _POINTS, "rad": ("turn",)}.get(task.unit, (*_POINTS, "turn"))
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
        for joint, angle in (motion.joints or {}).items():
            known = task.joints or robot.joint_names
            _require(joint, known, f"a motion of task {task.name!r}: unknown joint")
            i = robot.joint_index(joint)
            low, high = float(robot.q_min[i]), float(robot.q_max[i])
            if not low <= angle <= high:
                raise ConfigurationError(
                    f"a motion takes joint {joint!r} beyond its limits",
                    got=angle,
                    wanted=f"{low:g} to {high:g} rad",
                )
