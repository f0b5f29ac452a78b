"""The self-collision limit's rows: distances, their derivatives, and what is chosen."""

import numpy as np
import pinocchio as pin
import pytest
from oracles import near_home

from poise.dynamics import Dynamics, RobotState
from poise.robots import capsules_of
from poise.stack import ComTask, SelfCollisionLimit, Stack, StackRows, SurfaceContact
from poise.stack._joint_limit import largest_acceleration

SEEDS = range(4)
STEP = 1e-5
"""Of central differences [s]."""


def rows_of(robot, state, limit=None, *, velocities=False):
    stack = Stack([], [[ComTask()]], self_collision_limit=limit or SelfCollisionLimit())
    stack.bind(robot)
    rows = StackRows(robot, stack, (), collisions="before")
    dynamics = Dynamics(robot)
    dynamics.update(state)
    rows.update_velocities(dynamics) if velocities else rows.update(dynamics)
    return rows


def axis_distances(robot, q):
    """Of all pairs' axes, by the plain formula [m]."""
    capsules = capsules_of(robot)
    i, j = capsules.pairs.T
    return capsules.distances(robot, q) + capsules.radii[i] + capsules.radii[j]


def chosen(rows):
    """Slots that have a pair, and the pairs."""
    owner = rows.collisions
    own = rows.collision_rows
    distance = rows.evaluation.rows.error[own]
    slots = np.flatnonzero(np.isfinite(distance))
    return slots, rows.evaluation.rows.error_rate[own][slots].astype(int), owner


def moving(robot, seed, spread=0.5, speed=1.0):
    return near_home(robot, seed, spread=spread, speed=speed)


@pytest.mark.parametrize("name", ["humanoid33", "g1"])
@pytest.mark.parametrize("seed", SEEDS)
def test_rows_are_the_distances_derivatives(get_robot, name, seed):
    robot = get_robot(name)
    state = moving(robot, seed, speed=0.3)
    rows = rows_of(robot, state)
    slots, pairs, _ = chosen(rows)
    assert len(slots) == 10
    own = rows.collision_rows
    along = [
        capsules_of(robot).distances(robot, pin.integrate(robot.model, state.q, k * STEP * state.v))
        for k in (-1, 0, 1)
    ]
    distance = rows.evaluation.rows.error[own][slots]
    np.testing.assert_allclose(distance, along[1][pairs], rtol=0, atol=1e-12)
    rate = (along[2] - along[0])[pairs] / (2.0 * STEP)
    np.testing.assert_allclose(rows.J[own][slots] @ state.v, rate, rtol=0, atol=1e-7)


@pytest.mark.parametrize("name", ["humanoid33", "g1"])
@pytest.mark.parametrize("seed", SEEDS)
def test_the_drift_is_what_distances_do_at_zero_acceleration(get_robot, name, seed):
    robot = get_robot(name)
    state = moving(robot, seed, speed=0.3)
    rows = rows_of(robot, state)
    slots, pairs, _ = chosen(rows)
    own, step = rows.collision_rows, 1e-4
    rates = []
    for k in (-1, 1):
        q = pin.integrate(robot.model, state.q, k * step * state.v)
        there = rows_of(robot, RobotState(q, state.v), SelfCollisionLimit())
        values = np.full(len(capsules_of(robot).pairs), np.nan)
        others, those, _ = chosen(there)
        values[those] = there.J[there.collision_rows][others] @ state.v
        rates.append(values[pairs])
    found = (rates[1] - rates[0]) / (2.0 * step)
    # A pair that is chosen at one side alone, or whose nearest point comes to an end, says nothing.
    drift = rows.evaluation.rows.drift[own][slots]
    known = np.isfinite(found)
    assert known.sum() >= 7
    close = np.isclose(drift, found, rtol=1e-3, atol=2e-3)[known]
    assert close.sum() >= known.sum() - 1


@pytest.mark.parametrize("seed", SEEDS)
def test_the_bound_is_the_one_of_joints(get_robot, seed):
    robot, limit = get_robot("g1"), SelfCollisionLimit(margin=0.03, braking=4.0, horizon=0.02)
    state = moving(robot, seed)
    rows = rows_of(robot, state, limit)
    slots, pairs, _ = chosen(rows)
    own = rows.collision_rows
    inner, capsules = rows.evaluation.rows, capsules_of(robot)
    for slot, pair in zip(slots, pairs, strict=True):
        room = inner.error[own][slot] - min(0.03, capsules.at_home[pair] - 0.01)
        rate = float(rows.J[own][slot] @ state.v)
        bound = -largest_acceleration(room, -rate, 1e9, (30.0, 0.02, 4.0))
        expected = bound - inner.drift[own][slot]
        assert rows.target[own][slot] == pytest.approx(expected, rel=1e-6, abs=1e-6)
        assert rows.upper[own][slot] == np.inf


def test_at_velocity_level_links_may_come_as_near_as_they_may_in_a_while(get_robot):
    robot, limit = get_robot("g1"), SelfCollisionLimit(margin=0.03, approach_time=0.2)
    rows = rows_of(robot, moving(robot, 3), limit, velocities=True)
    slots, pairs, _ = chosen(rows)
    own, capsules = rows.collision_rows, capsules_of(robot)
    least = np.minimum(0.03, capsules.at_home[pairs] - 0.01)
    room = rows.evaluation.rows.error[own][slots] - least
    np.testing.assert_allclose(rows.target[own][slots], -room / 0.2, rtol=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_pairs_that_will_be_nearest_have_rows(get_robot, seed):
    robot = get_robot("humanoid33")
    state = moving(robot, seed)
    rows = rows_of(robot, state)
    _, pairs, owner = chosen(rows)
    capsules = capsules_of(robot)
    now = capsules.distances(robot, state.q)
    ahead = capsules.distances(robot, pin.integrate(robot.model, state.q, 1e-6 * state.v))
    left = (
        now
        - np.minimum(0.02, capsules.at_home - 0.01)
        + 0.16 * np.minimum((ahead - now) / 1e-6, 0.0)
    )
    left[(now > 0.5) | (axis_distances(robot, state.q) < 1e-6)] = np.inf
    assert set(pairs) == set(np.argsort(left)[:10])
    near = owner.near()
    np.testing.assert_allclose([pair.distance for pair in near], np.sort(now[pairs]), atol=1e-12)
    names = {frozenset(pair.links) for pair in near}
    expected = {frozenset(capsules.names[k] for k in capsules.pairs[p]) for p in pairs}
    assert names == expected


def test_what_carries_both_links_moves_neither_against_the_other(get_robot):
    robot = get_robot("humanoid33")
    rows = rows_of(robot, moving(robot, 1))
    np.testing.assert_array_equal(rows.J[rows.collision_rows][:, :6], 0.0)


def test_legs_that_stand_are_left_out(get_robot):
    robot, limit = get_robot("humanoid33"), SelfCollisionLimit()
    contacts = [SurfaceContact(sole) for sole in robot.soles]
    stack = Stack(contacts, [[ComTask()]], self_collision_limit=limit)
    stack.bind(robot)
    dynamics = Dynamics(robot)
    found = []
    for active in (contacts, contacts[:1]):
        StackRows(robot, stack, active, collisions="before").update(dynamics)
        for contact in contacts:
            (contact.engage if contact in active else contact.release)(0.0)
            contact.advance(0.0)
            contact.advance(1.0)
        found.append({frozenset(pair.links) for pair in limit.near})
    thighs = frozenset(("left_thigh_link", "right_thigh_link"))
    assert thighs not in found[0]
    # The right one hangs from the hip: it is kept off.
    assert thighs in found[1]
    assert found[0] & found[1]


def test_legs_may_pass_for_a_while_and_arms_may_not(get_robot):
    robot = get_robot("g1")
    model, limit, q = robot.model, SelfCollisionLimit(), robot.q_home.copy()
    for name, inwards in (("left_hip_roll_joint", -0.15), ("right_hip_roll_joint", 0.15)):
        q[model.joints[model.getJointId(name)].idx_q] = inwards
    state = RobotState(q, np.zeros(robot.nv))
    legs = {model.names[joint] for sole in robot.soles for joint in robot.leg_joints(sole)}

    def of_legs():
        joints = [rows_joints(robot, pair) for pair in chosen(rows_of(robot, state, limit))[1]]
        return [legs.issuperset(pair) for pair in joints]

    before = of_legs()
    limit.let_legs_pass(True)
    assert any(before)
    assert len(of_legs()) == len(before)
    assert not any(of_legs())
    limit.let_legs_pass(False)
    assert of_legs() == before


def test_at_rest_no_pair_has_a_bound(get_robot):
    robot, limit = get_robot("g1"), SelfCollisionLimit()
    state = moving(robot, 0, speed=0.3)
    before = rows_of(robot, state, limit, velocities=True)
    own = before.collision_rows
    bounds = before.target[own].copy()
    assert bounds.max() > -1.0
    limit.rest(True)
    # Rows that were made before and rows that are made after.
    for rows in (before, rows_of(robot, state, limit, velocities=True)):
        dynamics = Dynamics(robot)
        dynamics.update(state)
        rows.update_velocities(dynamics)
        assert rows.target[own].max() < -50.0
    limit.rest(False)
    again = rows_of(robot, state, limit, velocities=True)
    np.testing.assert_array_equal(again.target[own], bounds)


def test_legs_only_is_legs_and_nothing_else(get_robot):
    robot, limit = get_robot("g1"), SelfCollisionLimit(legs_only=True)
    limit.bind(robot)
    model = robot.model
    legs = {model.names[joint] for sole in robot.soles for joint in robot.leg_joints(sole)}
    for seed in range(3):
        _, pairs, owner = chosen(rows_of(robot, moving(robot, seed), limit))
        links = capsules_of(robot)
        of_legs = {links.names[k] for k in range(len(links.names))
                   if model.names[int(links.joints[k])] in legs}  # fmt: skip
        assert len(pairs) > 2
        assert all(of_legs.issuperset(pair.links) for pair in owner.near())


def test_joints_that_do_not_move_make_no_rows(get_robot):
    robot, limit = get_robot("humanoid33"), SelfCollisionLimit()
    limit.bind(robot)
    left, right = (
        [robot.model.names[joint] for joint in robot.leg_joints(sole)] for sole in robot.soles
    )
    stance = SurfaceContact("left_sole")
    stance.bind(robot)
    assert limit.rows_for([stance], left) is None
    rows = limit.rows_for([stance], right)
    assert rows is limit.rows_for([stance], right)
    assert rows is not limit.rows_for([stance])
    moved = {robot.model.getJointId(name) for name in right}
    capsules = capsules_of(robot)
    hanging = {name for name, joint in zip(capsules.names, capsules.joints, strict=True)
               if int(joint) in moved}  # fmt: skip
    dynamics = Dynamics(robot)
    dynamics.update(near_home(robot, 0))
    rows.evaluate(dynamics)
    assert all(hanging.intersection(pair.links) for pair in rows.near())


def rows_joints(robot, pair):
    """Names of the joints that carry the capsules of a pair."""
    capsules = capsules_of(robot)
    return [robot.model.names[int(capsules.joints[k])] for k in capsules.pairs[pair]]


def test_without_a_limit_there_are_no_rows(get_robot):
    robot = get_robot("biped20")
    for limit in (None, SelfCollisionLimit(enabled=False)):
        stack = Stack(levels=[[ComTask()]], self_collision_limit=limit)
        stack.bind(robot)
        rows = StackRows(robot, stack, (), collisions="before")
        assert rows.collisions is None
        assert rows.limits == ()
        assert stack.self_collision_limit.near == ()
