"""The walker in MuJoCo: led, pushed, and told nonsense."""

import math

import numpy as np
import pytest

import poise
from poise.locomotion import Walker, walking_stack
from poise.locomotion._walking._settings import WalkStatus

sim = pytest.importorskip("poise.sim")


class Led:
    """A robot that is led in simulation."""

    def __init__(self, robot):
        self.robot, stack = robot, walking_stack(robot)
        self.walker = Walker(robot, stack)
        self.plant = sim.Plant(robot, sim.PlantConfig(control_dt=0.002))
        self.ticks = poise.rollout(self.plant, poise.WholeBodyController(robot, stack), self.walker)

    def until(self, time):
        """Goes on; the largest error of the divergent component on the way."""
        error = 0.0
        while self.plant.time < time:
            tick = next(self.ticks)
            assert tick.command.status.ok
            assert not self.plant.fallen
            error = max(error, math.hypot(*self.walker.dcm_error))
            self.look()
        return error

    def look(self):
        """Feet never cross, and no swing is shorter or longer than it may be."""
        left, right = self.walker._engine.parts.stance.feet
        yaw = 0.5 * (left.yaw + right.yaw)
        dx, dy = (left.position[k] - right.position[k] for k in (0, 1))
        assert -math.sin(yaw) * dx + math.cos(yaw) * dy > 0.06
        if self.walker._engine.steps.flight is not None:
            assert self.walker._engine.steps.flight.elapsed < 2.0 * self.walker.gait.swing_time


@pytest.fixture
def led(get_robot):
    made = []

    def lead(name):
        made.append(Led(get_robot(name)))
        return made[-1]

    yield lead
    for one in made:
        one.ticks.close()


def test_it_walks_as_fast_as_it_is_told_and_stops_side_by_side(led):
    run = led("humanoid33")
    run.walker.set_velocity(0.4)
    run.until(1.5)
    start = run.plant.com[0]
    error = run.until(3.5)
    assert (run.plant.com[0] - start) / 2.0 == pytest.approx(0.4, rel=0.1)
    assert error < 0.02
    run.walker.set_velocity(0.0)
    run.until(6.0)
    assert run.walker.status is WalkStatus.STANDING
    assert run.walker._engine.steps.is_closed


def test_standing_it_steps_when_it_is_pushed_and_comes_back_to_rest(led):
    run = led("g1")
    run.until(0.4)
    force = run.robot.mass * 0.4 / 0.08
    run.plant.push(run.robot.torso, (-force, 0.0, 0.0), 0.08)
    run.until(3.6)
    assert run.walker.steps_made >= 1
    assert run.walker.status is WalkStatus.STANDING
    assert np.linalg.norm(run.plant.true_state().v[:3]) < 0.05


def test_a_foot_that_catches_the_robot_comes_down_where_it_is_led(led):
    """Joints that planned to stop softly would hold it back: it came down 38 mm short."""
    run = led("g1")
    run.until(0.4)
    force = run.robot.mass * 0.6 / 0.08
    run.plant.push(run.robot.torso, (0.0, force, 0.0), 0.08)
    short = [0.0, 0.0]
    while run.walker.steps_made < 2:
        run.until(run.plant.time + 0.002)
        flight = run.walker._engine.steps.flight
        if flight is not None:
            there = run.walker._engine.parts.sense.sole(flight.foot)[0]
            short[flight.foot] = math.dist(there[:2], flight.position[:2])
    assert max(short) < 0.02


def test_a_robot_that_stands_at_the_very_edge_of_its_feet_steps(get_robot):
    """There the divergent component never comes back; and an estimate drifts, with all feet."""
    robot = get_robot("humanoid33")
    walker = Walker(robot, walking_stack(robot))
    q = robot.q_home.copy()
    walker.lead(poise.RobotState(q.copy(), np.zeros(robot.nv), {}, 0.0))
    stance, edge = (
        walker._engine.parts.stance,
        walker._engine.parts.stance.support.depth(tuple(walker._engine.parts.sense.com[:2])),
    )
    q[:2] += 0.01, -0.03
    walker.lead(poise.RobotState(q.copy(), np.zeros(robot.nv), {}, 0.002))
    assert stance.feet[0].position[:2] == pytest.approx(walker._engine.parts.sense.sole(0)[0][:2])
    assert stance.support.depth(tuple(walker._engine.parts.sense.com[:2])) == pytest.approx(
        edge, abs=1e-3
    )
    assert walker.lifting is None
    v, depth = np.zeros(robot.nv), edge
    while walker.lifting is None:
        depth = walker._engine.parts.pendulum.depth(None, stance.support)
        v[0] += 0.002
        walker.lead(poise.RobotState(q.copy(), v, {}, 0.002))
    assert walker.lifting is not None
    # Not far inside the edge, but inside.
    assert 0.005 < depth < 0.015


@pytest.mark.parametrize(("side", "foot"), [(1.0, 1), (-1.0, 0)])
def test_where_no_step_catches_it_at_once_the_one_that_makes_room_goes_first(get_robot, side, foot):
    """Falling over one foot the other comes beside it: lifting the one that carries costs more."""
    robot = get_robot("humanoid33")
    walker = Walker(robot, walking_stack(robot))
    stand = walker._engine.parts.stand
    where = walker._engine.parts.planner.better_foot(
        stand.start, stand.bearings, (-0.02, 0.15 * side)
    )
    assert where == foot


def test_who_has_caught_itself_stands_still(led):
    """Arms that were thrown about come to rest; at their limits their torques would chatter."""
    run = led("g1")
    run.until(0.4)
    force = run.robot.mass * 0.35 / 0.08
    run.plant.push(run.robot.torso, (force, 0.0, 0.0), 0.08)
    run.until(5.0)
    assert run.walker.steps_made >= 1
    assert np.abs(run.plant.true_state().v).max() < 0.05


def test_footholds_one_by_one_are_met_and_kept(led):
    run = led("humanoid33")
    y = run.walker._engine.parts.stance.feet[0].position[1]
    run.walker.step_to("left_sole", 0.15, y, 0.0)
    run.walker.step_to("right_sole", 0.3, -y, 0.1)
    run.until(4.0)
    (left, right) = run.walker._engine.parts.stance.feet
    assert run.walker.steps_made == 2
    assert left.position[:2] == pytest.approx((0.15, y), abs=0.01)
    assert right.position[:2] == pytest.approx((0.3, -y), abs=0.01)
    assert right.yaw == pytest.approx(0.1, abs=0.02)
    assert run.walker.status is WalkStatus.STANDING


def test_nonsense_moves_nothing_and_is_said(led):
    run = led("humanoid33")
    run.walker.set_velocity(math.nan, 0.0, 0.0)
    assert "not finite" in run.walker.notice
    run.walker.step_to("nose", 0.1, 0.1, 0.0)
    assert "nose" in run.walker.notice
    run.walker.step_to("left_sole", math.inf, 0.1, 0.0)
    assert "not finite" in run.walker.notice
    state = run.plant.state()
    broken = poise.RobotState(np.full_like(state.q, math.nan), state.v, {}, state.time)
    run.walker.lead(broken)
    run.until(0.3)
    assert run.walker.steps_made == 0
    assert run.walker.status is WalkStatus.STANDING
    signals = run.walker.signals()
    assert signals["mode"] == "walk standing"


def test_who_was_in_a_hurry_and_is_held_again_goes_on_walking(get_robot):
    """At rest over one foot, where the step that was to be made costs more than to wait."""
    robot = get_robot("humanoid33")
    plant, stack = sim.Plant(robot, sim.PlantConfig(control_dt=0.002)), walking_stack(robot)
    controller, dynamics = poise.WholeBodyController(robot, stack), poise.Dynamics(robot)
    dynamics.update(plant.true_state())
    home, left = dynamics.com.copy(), dynamics.placement(robot.frame_id("left_sole"))[0]

    def lean(state):
        aside = 0.95 * (left[1] - home[1]) * min(state.time, 1.0)
        stack.task("com").set_target([home[0], home[1] + aside, home[2]])

    for _ in poise.rollout(plant, controller, lean, duration=1.6):
        pass
    walker = Walker(robot, stack, q=plant.true_state().q)
    walker.set_velocity(0.25)
    walker.lead(plant.state())
    walker._engine.steps._hurry()
    planner = walker._engine.parts.planner
    honest = planner.cost
    planner.cost = lambda lifted: 1.0 if walker._engine.steps._hurried else honest(lifted)
    for _ in poise.rollout(plant, controller, walker, duration=2.0):
        assert not plant.fallen
    assert walker.steps_made >= 2
