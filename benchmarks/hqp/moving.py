"""Problems of robots that move on one or two feet, and of one that is walked by hand."""

from collections.abc import Generator
from functools import partial

import numpy as np

from benchmarks.clocked import Subject
from benchmarks.hqp.recorded import problem_of
from benchmarks.hqp.source import Progress, Source, copy_problem, shape_of
from benchmarks.methods import REFERENCE, parse_method
from benchmarks.recording import record_run
from benchmarks.teleop_recording import Walk, WalkTick, record_walk
from poise.control import DifferentialIK
from poise.dynamics import Dynamics
from poise.errors import PoiseError
from poise.hqp import HierarchicalProblem
from poise.robots import Robot, load_robot
from poise.stack import ComTask, FrameTask, PostureTask, Stack, SurfaceContact

LADDER = (20, 28, 37, 45, 60)
"""Joints of the humanoids that are recorded on two feet and on one."""

_LIFTED = 650
"""Ticks of the script over the obstacle after which its first foot is in the air: 3.25 s."""

_AHEAD = 20
"""How many ticks ahead the targets of the walk by hand lie."""


def record_stance(
    robot: str,
    stance: str,
    stack: str,
    controller: str,
    count: int,
    progress: Progress | None = None,
) -> Generator[HierarchicalProblem]:
    """Lets a robot's COM and hands go round, see `record_run`, and copies a controller's problems.

    Args:
        robot: name of a biped.
        stance: one of `STANCES`.
        stack: one of `STACKS`.
        controller: "whole_body" or "reduced".
        count: how many ticks at most; fewer where the shape of the problem changes.
        progress: told how many thousandths of the simulation are done.

    Raises:
        PoiseError: the robot fell.
    """

    def tell(done: float, total: float) -> None:
        if progress is not None:
            progress(round(1000 * done / total), 1000)

    recording = record_run(load_robot(robot), stance, count, tell)
    subject = Subject(recording, stack, parse_method(controller, REFERENCE.name))
    shape: tuple[int, ...] = ()
    for tick in range(count):
        subject.tick(tick)
        problem = problem_of(subject.controller)
        shape = shape or shape_of(problem)
        if shape_of(problem) != shape:
            return
        yield copy_problem(problem)


def record_by_hand(count: int, progress: Progress | None = None) -> Generator[HierarchicalProblem]:
    """Follows the walk by hand over the obstacle with strict levels and hard joint limits.

    The step teleoperator solves its own levels in closed form. These problems are those of
    `DifferentialIK` by "hqp" on the recorded states while the right foot is in the air: COM and
    right foot, then the pelvis' orientation, then posture, each sent to where the recording is
    0.1 s later.

    Args:
        count: how many ticks.
        progress: told how many ticks of the walk are done.

    Raises:
        PoiseError: the robot fell, or the right foot was not in the air.
    """
    robot = load_robot("biped20")
    walk = Walk.over_an_obstacle(robot)

    def tell(done: float, total: float) -> None:
        if progress is not None:
            progress(int(done), int(total))

    ticks = record_walk(walk, _LIFTED + count + _AHEAD, tell)[_LIFTED:]
    left, right = list(robot.soles)[:2]
    if ticks[0].state.contacts[right][2] > 0.0:
        raise PoiseError("the right foot is not in the air", got=ticks[0].state.time)
    levels = [
        [ComTask("xy"), FrameTask(right)],
        [FrameTask(robot.pelvis, "orientation")],
        [PostureTask()],
    ]
    stack = Stack([SurfaceContact(left)], levels)
    controller = DifferentialIK(robot, stack, dt=walk.plant.control_dt, method="hqp")
    later = Dynamics(robot)
    for now, then in zip(ticks[:count], ticks[_AHEAD:], strict=True):
        _aim(stack, robot, later, then)
        controller.step(now.state)
        yield copy_problem(problem_of(controller))


def _aim(stack: Stack, robot: Robot, dynamics: Dynamics, tick: WalkTick) -> None:
    """Targets of tasks: where their frames are at a tick."""
    dynamics.update(tick.state)
    for _, task in stack.tasks():
        if isinstance(task, ComTask):
            task.set_target(dynamics.com.copy())
        elif isinstance(task, FrameTask):
            frame = dynamics.frame(robot.frame_id(task.frame))
            if task.unit != "rad":
                task.set_target(position=frame.position.copy())
            if task.turns:
                task.set_target(rotation=frame.rotation.copy())
        elif isinstance(task, PostureTask):
            task.set_target(np.array(tick.state.q[-robot.nj :]))


def _stance_source(
    name: str, robot: str, stance: str, stack: str, controller: str, about: str
) -> Source:
    feet = "two feet" if stance == "double" else "one foot"
    return Source(
        name=f"{name}-{stance}",
        family="recorded",
        description=f"{robot} on {feet}, COM and hands go round; {about}.",
        consecutive=True,
        make=partial(record_stance, robot, stance, stack, controller),
    )


SOURCES = (
    *(
        _stance_source(
            f"moving-{joints}",
            f"humanoid{joints}",
            stance,
            "default",
            "whole_body",
            "the posture level gives way",
        )
        for joints in LADDER
        for stance in ("double", "single")
    ),
    *(
        _stance_source(
            "table1-33", "humanoid33", stance, "table1", "whole_body", "everything can be met"
        )
        for stance in ("double", "single")
    ),
    *(
        _stance_source(
            f"reduced-{joints}",
            f"humanoid{joints}",
            "double",
            "table1",
            "reduced",
            "LQP 1 of the reduced controller",
        )
        for joints in (33, 60)
    ),
    Source(
        name="by-hand-biped20",
        family="recorded",
        description="A walk by hand over an obstacle, followed by differential inverse kinematics.",
        consecutive=True,
        make=record_by_hand,
    ),
)
"""Sequences of robots that move, by joints, and of the walk by hand."""
