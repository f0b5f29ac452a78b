"""A plan that is walked, in MuJoCo and by a robot that does not move; plans that are refused."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import poise
from poise.errors import ConfigurationError, UnknownNameError
from poise.locomotion import (
    FootstepPlan,
    Gait,
    Ground,
    Stride,
    Walker,
    WalkSettings,
    plan_footsteps,
    walking_stack,
)
from poise.locomotion._walking._settings import WalkStatus

DT = 0.002
GAIT = Gait(step_time=0.8, double_support=0.2, crouch=0.02, shift_time=0.6, settle_time=1.0)
AHEAD = (Stride(steps=3, length=0.12, turn=0.05),)


def walked(robot, look=lambda walker: None, change=lambda state: state):
    """A plan walked in MuJoCo, with `look` in every tick and states as `change` makes them."""
    sim = pytest.importorskip("poise.sim")
    plan, stack = plan_footsteps(robot, AHEAD, GAIT), walking_stack(robot)
    walker = Walker(robot, stack, plan=plan)
    controller = poise.WholeBodyController(robot, stack)
    plant = sim.Plant(robot, sim.PlantConfig(control_dt=DT))
    while plant.time < plan.duration:
        state = plant.state()
        walker.lead(change(state))
        look(walker)
        plant.step(controller.step(state))
        assert not plant.fallen
    return SimpleNamespace(walker=walker, plan=plan, plant=plant, stack=stack)


class Watch:
    """What a walk did, tick by tick."""

    def __init__(self):
        self.loads, self.lifted, self.hands = [], [], []

    def __call__(self, walker):
        left = walker.stack.contacts[0]
        self.loads.append(left.wrench_upper[2] if left.active else 0.0)
        self.lifted.append(walker.lifting == (0, True))
        self.hands.append(walker.stack.task("left_hand").target_position.copy())


@pytest.fixture(scope="module")
def walk(get_robot):
    watch = Watch()
    run = walked(get_robot("humanoid33"), watch)
    run.watch = watch
    return run


def test_every_step_is_made_in_its_time_and_lands_where_it_should(walk):
    assert walk.walker.status is WalkStatus.STANDING
    assert walk.walker.steps_made == walk.plan.count == 4
    for foot, place in zip(
        walk.walker._engine.parts.stance.feet, walk.plan.placements(walk.plan.count), strict=True
    ):
        assert foot.position[:2] == pytest.approx(place.position[:2], abs=0.005)
        assert foot.yaw == pytest.approx(place.yaw, abs=0.01)
    lift = walk.watch.lifted.index(True) * DT
    assert lift == pytest.approx(walk.plan.lift_off(0), abs=0.02)
    landed = walk.watch.lifted.index(False, round(lift / DT)) * DT
    assert landed == pytest.approx(walk.plan.touchdown(0), abs=0.05)


def test_a_foot_is_unloaded_gradually_before_it_is_lifted_and_loaded_after_it_landed(walk):
    loads, lift = np.array(walk.watch.loads), walk.watch.lifted.index(True)
    landed = walk.watch.lifted.index(False, lift)
    weight = walk.plant.robot.weight
    assert 0.0 < loads[lift - 3] < 0.5 * weight
    assert loads[lift] == 0.0
    assert np.abs(np.diff(loads[lift - 15 : lift])).max() < 0.4 * loads[lift - 15]
    assert 0.0 <= loads[landed] < 0.5 * weight < loads[landed + 100]


def test_what_goes_along_begins_where_it_is_and_turns_with_the_body(walk):
    hands, start = np.array(walk.watch.hands), walk.plan
    home = walk.plant.robot.q_home
    dynamics = poise.Dynamics(walk.plant.robot)
    dynamics.update(poise.RobotState(home, np.zeros(walk.plant.robot.nv)))
    first = dynamics.frame(walk.plant.robot.frame_id("left_hand")).position
    np.testing.assert_allclose(hands[0], first, atol=1e-4)
    assert np.abs(np.diff(hands, axis=0)).max() < 0.002
    turn = 4 * 0.05
    arm = first - np.array(start.com)
    com = walk.stack.task("com").target_position
    c, s = math.cos(turn), math.sin(turn)
    wanted = com[:2] + np.array([[c, -s], [s, c]]) @ arm[:2]
    np.testing.assert_allclose(hands[-1][:2], wanted, atol=1e-3)
    # The body is lowered, what goes along is not.
    assert hands[-1][2] == pytest.approx(first[2], abs=1e-3)


@pytest.mark.slow
def test_without_force_sensors_a_foot_is_down_when_it_should_be(get_robot):
    run = walked(get_robot("humanoid33"), change=lambda state: replace(state, contacts={}))
    assert run.walker.steps_made == run.plan.count
    assert run.walker.status is WalkStatus.STANDING


class Frozen:
    """A robot that stands as at the start whatever it is told."""

    def __init__(self, robot):
        self.robot = robot
        self.plan = plan_footsteps(robot, AHEAD, GAIT)
        self.walker = Walker(robot, walking_stack(robot), plan=self.plan)

    def tick(self, time, **changes):
        state = poise.RobotState(self.robot.q_home, np.zeros(self.robot.nv), {}, float(time))
        self.walker.lead(replace(state, **changes))
        return self.walker.status


@pytest.fixture
def frozen(get_robot):
    return Frozen(get_robot("humanoid33"))


def test_a_robot_that_does_not_stand_where_the_plan_begins_is_not_moved(frozen):
    q = frozen.robot.q_home.copy()
    q[0] += 0.2
    assert frozen.tick(0.0, q=q) is WalkStatus.MISPLACED
    assert frozen.walker.stack.task("com").target_position is None
    assert frozen.tick(3.0) is WalkStatus.MISPLACED
    assert all(contact.active for contact in frozen.walker.stack.contacts)


@pytest.mark.parametrize("ticks", [0, 50])
def test_a_state_that_is_not_finite_is_passed_over(frozen, ticks):
    for k in range(ticks):
        frozen.tick(k * DT)
    before = frozen.walker.status
    v = np.zeros(frozen.robot.nv)
    v[3] = np.nan
    assert frozen.tick(ticks * DT, v=v) is before
    assert frozen.tick(math.nan) is before
    assert frozen.tick((ticks + 1) * DT).ok


def test_what_is_asked_for_before_the_first_tick_comes_after_the_plan(frozen):
    walker, planned = frozen.walker, [step.goal for step in frozen.plan.steps]
    walker.step_to("right_sole", 0.5, -0.1, 0.2)
    walker.set_velocity(0.2)
    frozen.tick(0.0)
    *before, last = walker.commands.footholds
    assert [hold.place for hold in before] == planned
    assert (last.foot, last.place.position[:2], last.place.yaw) == (1, (0.5, -0.1), 0.2)
    frozen.tick(DT)
    frozen.tick(2.0)
    assert walker.commands.velocity[0] > 0.0
    assert walker.notice == ""


TOES_IN = [
    ("left_sole", (0.12, 0.12, 0.0)),
    ("right_sole", (0.2, -0.12, 0.3)),
    ("left_sole", (0.2, 0.15, 0.0)),
]


def turned_by(robot, way):
    if way == "in":
        return FootstepPlan.from_footholds(robot, TOES_IN, GAIT)
    turn = 0.5 if way == "left" else -0.5
    return plan_footsteps(robot, [Stride(steps=7, turn=turn)], replace(GAIT, crouch=0.04))


@pytest.mark.parametrize(("robot", "way"), [("humanoid33", "in"), ("g1", "left"), ("g1", "right")])
def test_feet_are_turned_as_far_as_the_plan_says(get_robot, robot, way):
    """Farther than commands may turn them, and more than half a turn in all."""
    robot = get_robot(robot)
    plan = turned_by(robot, way)
    walker = Walker(robot, walking_stack(robot), plan=plan)
    walker.lead(poise.RobotState(robot.q_home, np.zeros(robot.nv), {}, 0.0))
    for done, step in enumerate(plan.steps):
        stance = plan.placements(done)[1 - step.foot]
        place = walker.commands.steps(step.foot, stance, 1)[0]
        assert math.remainder(place.yaw - step.goal.yaw, math.tau) == pytest.approx(0.0, abs=1e-9)
        assert place.position[:2] == pytest.approx(step.goal.position[:2], abs=1e-9)
        walker.commands.footholds.popleft()
    assert walker.notice == ""


def without(stack, name):
    levels = [[t for t in level if t.name != name] for level in stack.levels]
    contacts = [c for c in stack.contacts if c.name != name]
    return poise.Stack(contacts, [level for level in levels if level])


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("com", "a ComTask of all three axes"),
        ("left_foot", "a FrameTask of the pose of 'left_sole'"),
        ("right_sole", "a contact on 'right_sole'"),
    ],
)
def test_a_stack_that_cannot_walk_is_refused(get_robot, name, message):
    robot = get_robot("humanoid33")
    with pytest.raises(ConfigurationError, match=message):
        Walker(robot, without(walking_stack(robot), name))


def test_a_task_to_carry_that_does_not_exist_is_refused(get_robot):
    robot = get_robot("humanoid33")
    with pytest.raises(UnknownNameError, match=r"third_hand.*left_hand"):
        Walker(robot, walking_stack(robot), carry=["third_hand"])


@pytest.mark.parametrize("given", ["gait", "q", "ground"])
def test_what_a_plan_has_of_its_own_is_not_given_beside_it(get_robot, given):
    robot = get_robot("humanoid33")
    plan = plan_footsteps(robot, AHEAD, GAIT)
    value = {"gait": GAIT, "q": robot.q_home, "ground": Ground()}[given]
    with pytest.raises(ConfigurationError, match=f"{given} of a walker that has a plan"):
        Walker(robot, walking_stack(robot), plan=plan, **{given: value})


@pytest.mark.parametrize(("width", "fine"), [(0.1, 0.15), (0.9, 0.65)], ids=["narrow", "wide"])
def test_feet_that_would_touch_or_never_be_side_by_side_are_refused(get_robot, width, fine):
    """Led, they came down on each other, or stepped for ever."""
    robot = get_robot("humanoid33")
    message = f"width {width:.3f} m'; wanted 0.150 to 0.658 m, or None"
    with pytest.raises(ConfigurationError, match=message):
        Walker(robot, walking_stack(robot), Gait(width=width))
    assert Walker(robot, walking_stack(robot), Gait(width=fine))._engine.parts.room.width == fine


@pytest.mark.parametrize("robot", ["humanoid33", "g1"])
@pytest.mark.parametrize(
    "stride",
    [Stride(steps=4, length=0.6), Stride(steps=4, sideways=0.35)],
    ids=["too long", "too wide"],
)
def test_steps_beyond_the_legs_are_refused_before_anything_moves(get_robot, robot, stride):
    robot = get_robot(robot)
    plan = plan_footsteps(robot, [stride], GAIT)
    with pytest.raises(ConfigurationError, match="is out of reach.*wanted shorter steps"):
        Walker(robot, walking_stack(robot), plan=plan)


@pytest.mark.parametrize(
    "values",
    [{"dcm_gain": 0.0}, {"touchdown_force": 1.5}, {"patience": -1.0}, {"clearance": float("nan")}],
)
def test_settings_that_cannot_be_right_are_refused(values):
    with pytest.raises(ConfigurationError):
        WalkSettings(**values)
