"""Problems of controllers while scenarios run: a window of ticks where something happens."""

from collections.abc import Generator
from dataclasses import dataclass, replace
from functools import partial

from benchmarks.hqp.source import Progress, Source, copy_problem, shape_of
from poise.apps.scenarios import load_scenario, stage_scenario
from poise.control import (
    ControllerPlan,
    DifferentialIK,
    ReducedController,
    WholeBodyController,
)
from poise.errors import PoiseError
from poise.hqp import HierarchicalProblem
from poise.sim import rollout

_PATIENCE = 2.0
"""A step is waited for so long after the time from which it counts [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """Which ticks of a scenario are recorded.

    Attributes:
        scenario: name of a shipped scenario.
        robot: name of a robot.
        at: from when on [s].
        begins: with how many active contacts it begins, at the tick where their number changes to
            it; None for the tick at `at`.
        plan: the controller; the scenario's own when None.
    """

    scenario: str
    robot: str
    at: float
    begins: int | None = None
    plan: ControllerPlan | None = None


def record_window(
    window: Window, count: int, progress: Progress | None = None
) -> Generator[HierarchicalProblem]:
    """Runs a scenario and copies the problems of up to `count` consecutive ticks.

    It ends early where the shape of the problem changes: a foot lands or lifts off.

    Args:
        window: which ticks.
        count: how many at most.
        progress: told how many ticks of the run are done; what is not needed is not run.

    Raises:
        PoiseError: the robot is not installed, it fell, or what should begin did not.
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
    """The hierarchical problem of a controller's last tick, in the controller's own storage.

    Args:
        controller: one that solves one: whole-body; reduced, whose LQP 1 it is, or the whole
            problem where it took that; or differential inverse kinematics by "hqp".

    Raises:
        PoiseError: it solves none, or has not solved one yet.
    """
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


_VELOCITY = ControllerPlan(name="differential_ik", strategy="hqp")

_STANDING = (
    ("stand", "stand", 0.2, "Standing on both feet"),
    ("squat", "squat", 1.4, "A squat, half way down, with both hands held where they are"),
    ("reach", "reach", 1.4, "Both hands on their way to the edge of their reach"),
    ("reach-beyond", "reach", 3.8, "Both hands are sent beyond their reach, which they miss"),
    ("push", "push", 4.145, "After a push from the side, which makes tasks give way"),
    ("one-leg", "balance_one_leg", 3.5, "Standing on the right foot, the left one going up"),
)

_ROBOTS = ("humanoid33", "g1")


def _source(name: str, about: str, window: Window) -> Source:
    return Source(
        name=name,
        family="recorded",
        description=f"{about}; {window.robot}, every tick.",
        consecutive=True,
        make=partial(record_window, window),
    )


def _walk(name: str, robot: str, scenario: str, at: float, feet: int, about: str) -> Source:
    window = Window(scenario=scenario, robot=robot, at=at, begins=feet)
    return _source(f"{name}-{robot}", about, window)


SOURCES = (
    *(
        _source(f"{name}-{robot}", about, Window(scenario=scenario, robot=robot, at=at))
        for name, scenario, at, about in _STANDING
        for robot in _ROBOTS
    ),
    *(
        _walk(name, robot, "walk", 3.0, feet, about)
        for name, feet, about in (
            ("walk-lift-off", 1, "A walk from a lift-off on"),
            ("walk-touch-down", 2, "A walk from a touch-down to the lift-off"),
        )
        for robot in _ROBOTS
    ),
    _source(
        "walk-pushed-humanoid33",
        "A walk on one foot while it is pushed, which makes tasks give way",
        Window(scenario="walk", robot="humanoid33", at=9.354),
    ),
    _walk("walk-pushed-landing", "humanoid33", "walk", 9.5, 2, "The touch-down after the push"),
    _walk("walk-sideways", "humanoid33", "walk_sideways", 3.0, 1, "A step to the side"),
    _walk("walk-turn", "humanoid33", "walk_turn", 3.0, 1, "A step of a walk in a circle"),
    _walk("walk-step", "humanoid33", "walk_step", 5.0, 1, "A step onto a block"),
    _source(
        "reduced-squat-humanoid33",
        "A squat, LQP 1 of the reduced controller",
        Window(scenario="squat", robot="humanoid33", at=1.4, plan=ControllerPlan(name="reduced")),
    ),
    *(
        _source(
            f"velocity-reach-{robot}",
            "Differential inverse kinematics, a hand sent beyond its reach",
            Window(scenario=scenario, robot=robot, at=3.8, plan=_VELOCITY),
        )
        for scenario, robot in (("reach", "humanoid33"), ("reach_arm", "arm6"))
    ),
)
"""Sequences of the shipped scenarios."""
