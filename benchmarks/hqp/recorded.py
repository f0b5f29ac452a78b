"""Problems of controllers: windows of scenarios, robots that move on one or two feet, by hand."""

from collections.abc import Generator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from benchmarks.clocked import Subject
from benchmarks.hqp.problem_set import Make, Progress, Source, copy_problem, shape_of
from benchmarks.methods import REFERENCE, parse_method
from benchmarks.recording import STANCES, record_run
from benchmarks.teleop import Walk, WalkTick, record_walk
from poise.apps.scenarios import load_scenario, stage_scenario
from poise.control import (
    ControllerPlan,
    DifferentialIK,
    ReducedController,
    WholeBodyController,
)
from poise.dynamics import Dynamics
from poise.errors import PoiseError
from poise.hqp import HierarchicalProblem
from poise.robots import Robot, load_robot
from poise.sim import rollout
from poise.stack import ComTask, FrameTask, PostureTask, Stack, SurfaceContact

_PATIENCE = 2.0
"""A step is waited for so long after the time from which it counts [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """Which ticks of a scenario are recorded."""

    scenario: str  # name of a shipped scenario
    robot: str  # name of a robot
    at: float  # from when on [s]
    # With how many active contacts it begins, at the tick where their number changes to it; None
    # for the tick at `at`
    begins: int | None = None
    plan: ControllerPlan | None = None  # the controller; the scenario's own when None


def record_window(
    window: Window, count: int, progress: Progress | None = None
) -> Generator[HierarchicalProblem]:
    """Runs a scenario and copies the problems of up to `count` consecutive ticks.

    It ends early where the shape of the problem changes: a foot lands or lifts off.
    """
    scenario = replace(load_scenario(window.scenario), robot=window.robot)
    if window.plan is not None:
        scenario = replace(scenario, controller=window.plan)
    stage = stage_scenario(scenario)
    plant, controller = stage.plant, stage.controller
    begin = round(window.at / plant.control_dt)
    found, before = 0, -1
    shape: tuple[int, ...] = ()
    for tick in rollout(plant, controller, stage.leader, estimator=stage.estimator):
        feet = sum(contact.active for contact in controller.stack.contacts)
        if found == 0 and tick.index >= begin and _begins(window, feet, before):
            shape = shape_of(problem_of(controller))
        if shape:
            problem = problem_of(controller)
            if shape_of(problem) != shape:
                return
            found += 1
            yield copy_problem(problem)
            if found == count:
                return
        before = feet
        if progress is not None and tick.index % 50 == 49:
            progress(tick.index + 1, max(tick.index + 1, begin + count))
        if not shape and plant.time > window.at + _PATIENCE:
            break
    what = "a fall" if plant.fallen else "no change of contacts"
    raise PoiseError(
        f"{scenario.robot} was not recorded in {scenario.name!r}",
        got=f"{what} at {plant.time:.3f} s",
    )


def problem_of(controller: object) -> HierarchicalProblem:
    """The hierarchical problem of a controller's last tick, in the controller's own storage."""
    problem: HierarchicalProblem | None = None
    if isinstance(controller, WholeBodyController):
        program = controller.strategy.current
        problem = None if program.solution is None else program.full.problem
    elif isinstance(controller, ReducedController):
        reduced = controller.strategy.current
        # After a tick in which that was of no use, LQP 1 is not even written.
        if reduced.whole_solution is not None:
            problem = reduced.whole.full.problem
        elif reduced.first_solution is not None:
            problem = reduced.first.problem
    elif isinstance(controller, DifferentialIK):
        problem = controller.strategy.problem
    if problem is None:
        raise PoiseError(
            "the controller has solved no hierarchical problem",
            got=type(controller).__name__,
            wanted="WholeBodyController, ReducedController or DifferentialIK by hqp, after a tick",
        )
    return problem


def _begins(window: Window, feet: int, before: int) -> bool:
    return window.begins is None or (feet == window.begins and before not in (feet, -1))


LADDER = (20, 28, 37, 45, 60)
"""Joints of the humanoids that are recorded on two feet and on one."""

_LIFTED = 650
"""Ticks of the script over the obstacle after which its first foot is in the air: 3.25 s."""

_AHEAD = 20
"""How many ticks ahead the targets of the walk by hand lie."""


def record_stance(
    robot: str,  # name of a biped
    stance: str,  # one of `STANCES`
    stack: str,  # one of `STACKS`
    controller: str,  # "whole_body" or "reduced"
    count: int,  # how many ticks at most; fewer where the shape of the problem changes
    progress: Progress | None = None,  # told how many thousandths of the simulation are done
) -> Generator[HierarchicalProblem]:
    """Lets a robot's CoM and hands go round, see `record_run`, and copies a controller's problems.

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
    `DifferentialIK` by "hqp" on the recorded states while the right foot is in the air: CoM and
    right foot, then the pelvis' orientation, then posture, each sent to where the recording is
    0.1 s later.
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
    controller = DifferentialIK(robot, stack, dt=walk.plant.control_dt, strategy="hqp")
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


_STANDING = (
    ("stand", "stand", 0.2, "Standing on both feet"),
    ("squat", "squat", 1.4, "A squat, half way down, with both hands held where they are"),
    ("reach", "reach", 1.4, "Both hands on their way to the edge of their reach"),
    ("reach-beyond", "reach", 3.8, "Both hands are sent beyond their reach, which they miss"),
    ("push", "push", 4.145, "After a push from the side, which makes tasks give way"),
    ("one-leg", "balance_one_leg", 3.5, "Standing on the right foot, the left one going up"),
)
"""Name, scenario, time [s], and what happens."""

_WALKING = (
    ("walk-pushed-landing", "walk", 9.5, 2, "The touch-down after the push"),
    ("walk-sideways", "walk_sideways", 3.0, 1, "A step to the side"),
    ("walk-turn", "walk_turn", 3.0, 1, "A step of a walk in a circle"),
    ("walk-step", "walk_step", 5.0, 1, "A step onto a block"),
)
"""Name, scenario, time [s], on how many feet it begins, and what happens."""

_MOVING = (
    *(
        (joints, "moving", STANCES, "default", "whole_body", "the posture level gives way")
        for joints in LADDER
    ),
    (33, "table1", STANCES, "table1", "whole_body", "everything can be met"),
    *(
        (joints, "reduced", STANCES[:1], "table1", "reduced", "LQP 1 of the reduced controller")
        for joints in (33, 60)
    ),
)
"""Joints, name, stances, stack, controller, and what is special."""


def _window(
    name: str,
    about: str,
    scenario: str,
    at: float,
    *,
    robot: str = "humanoid33",
    begins: int | None = None,
    plan: ControllerPlan | None = None,
) -> Source:
    window = Window(scenario=scenario, robot=robot, at=at, begins=begins, plan=plan)
    words = f"{about}; {robot}, every tick."
    return _source(f"{name}-{robot}", words, partial(record_window, window))


def _source(name: str, description: str, make: Make) -> Source:
    return Source(
        name=name, family="recorded", description=description, consecutive=True, make=make
    )


SOURCES = (
    *(
        _window(name, about, scenario, at, robot=robot)
        for name, scenario, at, about in _STANDING
        for robot in ("humanoid33", "g1")
    ),
    *(
        _window(name, about, "walk", 3.0, robot=robot, begins=feet)
        for name, feet, about in (
            ("walk-lift-off", 1, "A walk from a lift-off on"),
            ("walk-touch-down", 2, "A walk from a touch-down to the lift-off"),
        )
        for robot in ("humanoid33", "g1")
    ),
    _window(
        "walk-pushed",
        "A walk on one foot while it is pushed, which makes tasks give way",
        "walk",
        9.354,
    ),
    *(
        _window(name, about, scenario, at, begins=feet)
        for name, scenario, at, feet, about in _WALKING
    ),
    _window(
        "reduced-squat",
        "A squat, LQP 1 of the reduced controller",
        "squat",
        1.4,
        plan=ControllerPlan(name="reduced"),
    ),
    *(
        _window(
            "velocity-reach",
            "Differential inverse kinematics, a hand sent beyond its reach",
            scenario,
            3.8,
            robot=robot,
            plan=ControllerPlan(name="differential_ik", strategy="hqp"),
        )
        for scenario, robot in (("reach", "humanoid33"), ("reach_arm", "arm6"))
    ),
    *(
        _source(
            f"{name}-{joints}-{stance}",
            f"humanoid{joints} on {'two feet' if stance == 'double' else 'one foot'}, CoM and "
            f"hands go round; {about}.",
            partial(record_stance, f"humanoid{joints}", stance, stack, controller),
        )
        for joints, name, stances, stack, controller, about in _MOVING
        for stance in stances
    ),
    _source(
        "by-hand-biped20",
        "A walk by hand over an obstacle, followed by differential inverse kinematics.",
        record_by_hand,
    ),
)
"""Sequences of the shipped scenarios, of robots that move, by joints, and of the walk by hand."""
