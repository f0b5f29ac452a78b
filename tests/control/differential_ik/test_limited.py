"""The self-collision limit on joint velocities: what links do is measured by coal's own shapes."""

import coal
import numpy as np
import pinocchio as pin
import pytest
from velocity_levels import solve_within_bounds

from poise.control import DifferentialIK
from poise.control._differential_ik._kernels import PriorityRows
from poise.hqp import HierarchicalProblem, Level, solve
from poise.robots import capsules_of
from poise.stack import ComTask, FrameTask, SelfCollisionLimit, Stack, SurfaceContact

STEP = 1e-6
"""Of differences of distances [s]."""


class Shapes:
    """Distances of a robot's capsules by coal, on a kinematics of their own."""

    def __init__(self, robot):
        self._robot, self._capsules = robot, capsules_of(robot)
        self._data, self._shapes = robot.model.createData(), []
        capsules = self._capsules
        ends = zip(capsules.starts, capsules.ends, capsules.radii, strict=True)
        for start, end, radius in ends:
            along, length = end - start, np.linalg.norm(end - start)
            z = along / length if length > 1e-9 else np.array([0.0, 0.0, 1.0])
            turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), z).matrix()
            place = pin.SE3(turn, 0.5 * (start + end))
            self._shapes.append((coal.Capsule(float(radius), float(length)), place))

    def distance(self, q, pair):
        """Of a pair of capsules [m]."""
        pin.forwardKinematics(self._robot.model, self._data, q)
        placed = []
        for k in self._capsules.pairs[pair]:
            shape, place = self._shapes[k]
            there = self._data.oMi[int(self._capsules.joints[k])] * place
            placed += [shape, coal.Transform3s(there.rotation, there.translation)]
        return coal.distance(*placed, coal.DistanceRequest(), coal.DistanceResult())


def stepping(robot, **settings):
    """A stack that stands on the left foot and leads the right one, and the limit."""
    left, right = robot.soles
    contacts = [SurfaceContact(left), SurfaceContact(right)]
    stack = Stack(
        contacts,
        [[ComTask()], [FrameTask(right, name="foot"), FrameTask(robot.torso, "orientation")]],
        self_collision_limit=SelfCollisionLimit(**settings),
        softening=0.0,
    )
    stack.bind(robot)
    contacts[1].release(0.0)
    return stack


def legs_of(robot):
    return [robot.joint_names[j - 2] for sole in robot.soles for j in robot.leg_joints(sole)]


def hanging_pairs(robot):
    """Pairs of a capsule of the right leg and one of the left."""
    left, right = (set(robot.leg_joints(sole)) for sole in robot.soles)
    capsules = capsules_of(robot)
    joints = capsules.joints[capsules.pairs].tolist()
    return [k for k, (a, b) in enumerate(joints) if (a in right and b in left) or
            (a in left and b in right)]  # fmt: skip


@pytest.mark.parametrize("strategy", ["closed_form", "hqp"])
@pytest.mark.parametrize("name", ["biped20", "g1"])
def test_a_foot_led_across_the_other_stops_at_the_margin(get_robot, follow, name, strategy):
    """Every tick's rates obey the bound, and the closed loop never comes nearer than it may."""
    robot, margin, approach, dt = get_robot(name), 0.02, 0.1, 0.005
    stack = stepping(robot, legs_only=True, margin=margin, approach_time=approach)
    controller = DifferentialIK(robot, stack, dt=dt, strategy=strategy, joints=legs_of(robot))
    follower, shapes = follow(robot, "left_sole", dt), Shapes(robot)
    controller.step(follower.state())
    foot, start = stack.task("foot"), stack.task("foot").target_position
    across = start + 2.0 * (follower.placement("left_sole").translation - start)
    pairs = hanging_pairs(robot)
    least = np.minimum(margin, capsules_of(robot).at_home[pairs] - 0.01)
    nearest, tightest = np.inf, np.inf
    for k in range(160):
        part = min(k / 80, 1.0)
        foot.set_target(start + part * (across - start) + [0.0, 0.0, 0.05 * part])
        command = controller.step(follower.state())
        assert command.status.ok
        q = follower.q
        follower.move(command.velocity)
        if k % 10:
            continue
        # The same velocities for a moment: what the distances do at once.
        moment = follow(robot, "left_sole", STEP, q)
        moment.move(command.velocity)
        before, after = (
            np.array([shapes.distance(x, pair) for pair in pairs]) for x in (q, moment.q)
        )
        room, rate = before - least, (after - before) / STEP
        assert (rate >= -room / approach - 1e-3).all()
        nearest, tightest = min(nearest, room.min()), min(tightest, (rate + room / approach).min())
    # It was led into the limit, and leaned on it.
    assert tightest < 1e-3
    assert -2e-3 < nearest < 5e-3
    assert abs(follower.com[0] - controller.stack.task("com").target_position[0]) < 0.02


def test_without_the_limit_it_goes_through(get_robot, follow):
    robot = get_robot("biped20")
    stack = stepping(robot, enabled=False)
    controller = DifferentialIK(robot, stack, dt=0.005, joints=legs_of(robot))
    follower = follow(robot, "left_sole", 0.005)
    controller.step(follower.state())
    foot, start = stack.task("foot"), stack.task("foot").target_position
    across = start + 2.0 * (follower.placement("left_sole").translation - start)
    for k in range(100):
        foot.set_target(start + min(k / 80, 1.0) * (across - start))
        follower.move(controller.step(follower.state()).velocity)
    distance = capsules_of(robot).distances(robot, follower.q)[hanging_pairs(robot)]
    assert distance.min() < -0.02


def problem(rng, n=12):
    """Contacts, two levels and rows of a limit that ask for less than nothing, or for little."""
    levels = [
        PriorityRows(rng.normal(size=(m, n)), rng.normal(size=m), np.full(m, 1e4), np.ones(m))
        for m in (2, 3, 8)
    ]
    levels[0].velocity[:] = 0.0
    rows = rng.normal(size=(10, n))
    # Some pairs are far apart, and their rows empty.
    rows[rng.random(10) < 0.3] = 0.0
    least = rng.uniform(-2.0, 0.3, size=10)
    return levels, PriorityRows(rows, least, np.ones(10), np.ones(10))


def hold(levels, limits, bound):
    ones = np.ones(len(bound))
    return solve_within_bounds(levels, ones, -bound, bound, exact=2, limits=limits)


def broken(limits, u):
    moved = np.linalg.norm(limits.jacobian, axis=1) > 0.0
    return max(0.0, *(limits.velocity - limits.jacobian @ u)[moved])


@pytest.mark.parametrize("seed", range(100))
def test_rows_are_kept_where_joints_have_room(seed):
    rng = np.random.default_rng(seed)
    levels, limits = problem(rng)
    u, held = hold(levels, limits, np.full(12, 1e3))
    assert not held.any()
    assert broken(limits, u) < 2e-6
    assert np.abs(levels[0].jacobian @ u).max() < 1e-9
    free, _ = hold(levels, limits._replace(velocity=np.full(10, -1e3)), np.full(12, 1e3))
    if broken(limits, free) == 0.0:
        np.testing.assert_array_equal(u, free)


def test_what_joints_leave_no_room_for_is_missed_by_little_more_than_it_must():
    """Joints keep their bounds and contacts stand; of the rows the QP misses the least there is."""
    found, best = [], []
    for seed in range(100):
        rng = np.random.default_rng(seed)
        levels, limits = problem(rng)
        bound = np.full(12, 0.3)
        u, _ = hold(levels, limits, bound)
        assert (np.abs(u) <= bound).all()
        assert np.abs(levels[0].jacobian @ u).max() < 2e-6
        hard, zero = Level(np.eye(12), -bound, bound), np.zeros(2)
        apart = Level(limits.jacobian, limits.velocity, np.full(10, np.inf))
        x = solve(HierarchicalProblem([hard, Level(levels[0].jacobian, zero, zero), apart])).x
        found.append(broken(limits, u))
        best.append(broken(limits, x))
    found, best = np.array(found), np.array(best)
    kept = best < 1e-6
    assert kept.sum() > 80
    assert (found[kept] < 1e-5).mean() > 0.75
    assert np.mean(found) < 0.05


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("what", ["jacobian", "velocity"])
def test_numbers_that_are_none_raise_nothing(bad, what):
    levels, limits = problem(np.random.default_rng(1))
    getattr(limits, what)[0] = bad
    with np.errstate(all="ignore"):
        u, _ = hold(levels, limits, np.full(12, 1.0))
    assert not np.abs(u).max() > 1.0


def test_pairs_that_no_joint_that_may_move_moves_have_no_row(get_robot, follow):
    robot = get_robot("g1")
    stack = stepping(robot)
    controller = DifferentialIK(robot, stack, dt=0.005, joints=legs_of(robot))
    state = follow(robot, "left_sole", 0.005).state()
    assert controller.step(state).status.ok
    capsules = capsules_of(robot)
    right = {capsules.names[k] for k in range(len(capsules.names))
             if int(capsules.joints[k]) in robot.leg_joints("right_sole")}  # fmt: skip
    near = stack.self_collision_limit.near
    assert len(near) == 10
    assert all(right.intersection(pair.links) for pair in near)
