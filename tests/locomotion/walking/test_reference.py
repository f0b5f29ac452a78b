"""References of a walk: ZMP, centre of mass and body."""

import numpy as np
import pytest

from poise.locomotion import Gait, Ground, Stride, plan_footsteps
from poise.locomotion._walking._reference import WalkReference, _preview

GAIT = Gait(step_time=0.8, crouch=0.02)


@pytest.fixture(scope="module")
def walk(get_robot):
    plan = plan_footsteps(get_robot("g1"), [Stride(steps=6, length=0.15, turn=0.05)], GAIT)
    return plan, WalkReference(plan)


def test_the_com_moves_its_zmp_along_the_reference(walk):
    _, reference = walk
    zmp = reference.com[:, 0, :2] - reference.com[:, 2, :2] / reference.omega**2
    error = np.linalg.norm(zmp - reference.zmp, axis=1)
    assert error.max() < 0.03  # at the corners, where the reference bends at once
    assert np.sqrt(np.mean(error**2)) < 0.005


def test_the_zmp_reference_stands_in_the_foot_that_carries(walk):
    plan, reference = walk
    for i, step in enumerate(plan.steps):
        middle = 0.5 * (plan.lift_off(i) + plan.touchdown(i))
        stance = plan.placements(i)[1 - step.foot]
        at = np.searchsorted(reference.time, middle)
        np.testing.assert_allclose(reference.zmp[at], stance.position[:2], atol=1e-9)


def test_rates_are_derivatives(walk):
    _, reference = walk
    step = reference.time[1] - reference.time[0]
    for values, tolerance in ((reference.com, 0.1), (reference.displacement, 0.1)):
        for order in (0, 1):
            slope = np.gradient(values[:, order], step, axis=0)[2:-2]
            scale = np.abs(values[:, order + 1]).max(axis=0) + 1e-6
            miss = np.abs(slope - values[2:-2, order + 1]).max(axis=0)
            assert (miss < tolerance * scale).all()


def test_the_walk_ends_at_rest_above_the_middle_of_the_feet(walk):
    plan, reference = walk
    com, displacement = reference.at(plan.duration + 5.0)
    left, right = plan.placements(plan.count)
    middle = 0.5 * np.add(left.position, right.position)
    np.testing.assert_allclose(com[0, :2], middle[:2], atol=2e-3)
    np.testing.assert_allclose(com[1:], 0.0, atol=5e-3)
    assert displacement[0, 3] == pytest.approx(6 * 0.05)


def test_over_a_zmp_that_stays_the_com_does_not_move():
    """However short the preview's window is: what is beyond it is made up for."""
    at = np.array([2.0, -1.0])
    states = _preview(0.8, at, np.tile(at, (400, 1)))
    np.testing.assert_allclose(states[:, 0], np.tile(at, (400, 1)), atol=1e-9)
    np.testing.assert_allclose(states[:, 1:], 0.0, atol=1e-8)


def test_references_between_the_grid_lie_between_its_points(walk):
    _, reference = walk
    k = 300
    com, _ = reference.at(0.5 * (reference.time[k] + reference.time[k + 1]))
    np.testing.assert_allclose(com, 0.5 * (reference.com[k] + reference.com[k + 1]), atol=1e-12)


def test_the_com_is_never_higher_than_the_lower_foot_allows(get_robot):
    ground = Ground(platforms=(Ground.Platform(center=(0.65, 0.0), size=(0.5, 1.2, 0.05)),))
    plan = plan_footsteps(
        get_robot("humanoid33"),
        [Stride(steps=12, length=0.1)],
        Gait(step_time=1.1),
        ground=ground,
    )
    reference = WalkReference(plan)
    over = reference.com[:, 0, 2] - plan.com[2]
    for i in range(plan.count):
        both = (reference.time >= plan.touchdown(i)) & (
            reference.time <= plan.touchdown(i) + plan.gait.double_support
        )
        low = min(p.position[2] for p in plan.placements(i + 1))
        np.testing.assert_allclose(over[both], low, atol=1e-9)
    assert over.max() == pytest.approx(0.05)
