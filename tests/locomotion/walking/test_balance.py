"""Feedback, and footholds that move, on the linear inverted pendulum by itself."""

import math
from dataclasses import replace

import numpy as np
import pytest

from poise.locomotion import Gait, Ground, Stride, plan_footsteps
from poise.locomotion._support import SupportPolygon
from poise.locomotion._walking._feedback import DcmFeedback, PlanShift, StepCatcher

OMEGA, DT = 3.5, 0.002
SOLE = SupportPolygon([(-0.1, -0.05), (0.1, -0.05), (0.1, 0.05), (-0.1, 0.05)], 0.01)
REST = np.zeros((3, 2))


def test_an_error_dies_out_with_the_gain_while_the_zmp_is_free():
    feedback = DcmFeedback(OMEGA, 4.0)
    c, v = np.array([0.01, -0.005]), np.zeros(2)
    first = c + v / OMEGA
    for _ in range(round(0.5 / DT)):
        a = feedback.acceleration(c, v, REST, SOLE)
        c, v = c + DT * v + 0.5 * DT**2 * a, v + DT * a
    np.testing.assert_allclose(c + v / OMEGA, first * math.exp(-4.0 * 0.5), rtol=0.02)


def test_the_zmp_stays_inside_the_soles():
    feedback = DcmFeedback(OMEGA, 4.0)
    a = feedback.acceleration(np.array([0.3, 0.2]), np.array([0.5, 0.0]), REST, SOLE)
    assert feedback.zmp == pytest.approx((0.09, 0.04))
    assert a == pytest.approx((OMEGA**2 * (0.3 - 0.09), OMEGA**2 * (0.2 - 0.04)))


def test_a_moved_foothold_moves_the_references_as_the_pendulum_does():
    # The pendulum itself is the oracle: cdd = omega^2 (c - r), with r what the shift means.
    shift, moved, switch = PlanShift(OMEGA), 0.1, 0.4
    ahead = moved * math.exp(-OMEGA * switch)
    shift.coming = np.array([moved, 0.0])
    # Start on the bounded solution: the divergent part is where it has to be.
    c, v = 0.0, OMEGA * ahead
    worst = 0.0
    for i in range(round(1.5 / DT)):
        left = switch - (i + 1) * DT
        if left < 0.0 and shift.coming.any():
            shift.land(np.array([moved, 0.0]), 0.0)
        shift.advance(DT, max(left, 0.0))
        r = moved if i * DT >= switch else 0.0
        cosh, sinh = math.cosh(OMEGA * DT), math.sinh(OMEGA * DT)
        c, v = r + (c - r) * cosh + v / OMEGA * sinh, OMEGA * (c - r) * sinh + v * cosh
        worst = max(worst, abs(shift.com[0, 0] - c))
    assert worst < 2e-3
    assert shift.com[0, 0] == pytest.approx(moved, abs=2e-3)


def test_a_foot_that_lands_early_does_not_move_the_references():
    on_time, early, moved = PlanShift(OMEGA), PlanShift(OMEGA), np.array([0.1, -0.05])
    on_time.coming = early.coming = moved
    for i in range(199):
        left = 0.4 - (i + 1) * DT
        if i == 100:
            early.land(moved, left + DT)
        on_time.advance(DT, left)
        early.advance(DT, left if i < 100 else 0.7)
        np.testing.assert_allclose(early.com, on_time.com, atol=1e-12)
    np.testing.assert_array_equal(early.settled, moved)


def test_a_shift_begins_with_nothing_beside_the_plan():
    shift = PlanShift(OMEGA)
    np.testing.assert_array_equal(shift.com, REST)
    np.testing.assert_array_equal([shift.settled, shift.coming], np.zeros((2, 2)))


@pytest.fixture(scope="module")
def plan(get_robot):
    return plan_footsteps(
        get_robot("humanoid33"), [Stride(steps=6, length=0.15)], Gait(step_time=0.8)
    )


def caught(plan, error, step=2, settled=(0.0, 0.0), seconds=1.0):
    """How far the foothold of a step moves under an error that stays as it is."""
    catcher = StepCatcher(plan, OMEGA, 0.2, 0.01, 0.45)
    shift = PlanShift(OMEGA)
    shift.settled = np.array(settled)
    stance = plan.placements(step)[1 - plan.steps[step].foot]
    left, growth = 0.3, math.exp(-OMEGA * 0.3)
    for _ in range(round(seconds / DT)):
        # The error against the reference that the shift has moved.
        seen = np.array(error) - shift.coming * growth
        zmp = np.array(stance.position[:2])
        catcher.advance(step, stance, seen, zmp, shift, left, DT)
    return shift.coming, stance


def test_what_the_sole_can_bring_back_moves_no_foothold(plan):
    moved, _ = caught(plan, (0.03, 0.01))
    np.testing.assert_allclose(moved, 0.0, atol=1e-12)


def test_a_foothold_moves_to_where_the_error_will_have_grown_to(plan):
    moved, _ = caught(plan, (0.12, 0.0))
    room = 0.6 * (0.5 * plan.sizes[0][0] - 0.01)
    assert moved[0] == pytest.approx(min((0.12 - room) * math.exp(OMEGA * 0.3), 0.2))
    assert moved[1] == 0.0


@pytest.mark.parametrize("left", [0.1, 0.3, 0.5])
def test_an_error_beyond_the_sole_grows_by_the_pendulum_until_the_next_foot(plan, left):
    """Exactly e^(omega tau) of what feedback leaves over, taken from the pendulum's own motion."""
    catcher, shift = StepCatcher(plan, OMEGA, 10.0, 0.01, 10.0), PlanShift(OMEGA)
    stance = plan.placements(2)[1 - plan.steps[2].foot]
    beyond = 0.01
    room = 0.6 * (0.5 * plan.sizes[0][0] - 0.01)
    # Without feedback xi runs away from the ZMP as cosh and sinh of omega t move c and v.
    xi, v = np.cosh(OMEGA * left), OMEGA * np.sinh(OMEGA * left)
    grown = beyond * (xi + v / OMEGA)
    error, zmp = np.array([room + beyond, 0.0]), np.array(stance.position[:2])
    catcher.advance(2, stance, error, zmp, shift, left, dt=10.0)
    np.testing.assert_allclose(shift.coming, [grown, 0.0], rtol=1e-9, atol=1e-12)
    # What the shift that is coming explains by then is no error any more.
    seen = error - shift.coming * math.exp(-OMEGA * left)
    catcher.advance(2, stance, seen, zmp, shift, left, dt=10.0)
    np.testing.assert_allclose(shift.coming, [grown, 0.0], rtol=1e-9, atol=1e-12)


def test_the_zmp_beside_the_middle_of_the_sole_leaves_less_room_to_its_side(plan):
    stance = plan.placements(2)[1 - plan.steps[2].foot]
    half, growth = 0.5 * plan.sizes[0][0], math.exp(OMEGA * 0.3)
    zmp = np.array(stance.position[:2]) + [0.05, 0.0]
    for error, room in ((0.1, half - 0.06), (-0.1, half + 0.04)):
        catcher, shift = StepCatcher(plan, OMEGA, 10.0, 0.01, 10.0), PlanShift(OMEGA)
        catcher.advance(2, stance, np.array([error, 0.0]), zmp, shift, 0.3, dt=10.0)
        left_over = max(abs(error) - 0.6 * room, 0.0)
        assert shift.coming[0] == pytest.approx(math.copysign(left_over, error) * growth)


@pytest.mark.parametrize("step", [2, 3])
@pytest.mark.parametrize("angle", np.linspace(0.0, 2.0 * math.pi, 9)[:-1])
def test_feet_never_come_together_and_never_go_farther_than_allowed(plan, step, angle):
    moved, stance = caught(plan, (0.5 * math.cos(angle), 0.5 * math.sin(angle)), step)
    assert np.abs(moved).max() <= 0.2 + 1e-9
    foot = plan.steps[step].foot
    side = 1.0 if foot == 0 else -1.0
    apart = side * (plan.steps[step].goal.position[1] + moved[1] - stance.position[1])
    assert apart >= 0.5 * (plan.sizes[0][1] + plan.sizes[1][1]) + plan.clearance - 1e-9


@pytest.mark.parametrize(("ahead", "carries"), [(0.2, False), (2.0, True)])
def test_a_foothold_moves_only_where_the_ground_is_level(plan, ahead, carries):
    """Beside its plan by 0.2 m at most, and a platform so far ahead of the planned place."""
    x, y, _ = plan.steps[2].goal.position
    block = Ground.Platform(center=(x + ahead, y), size=(0.1, 0.5, 0.05))
    moved, _ = caught(replace(plan, ground=Ground(platforms=(block,))), (0.12, 0.0))
    expected, _ = caught(plan, (0.12, 0.0))
    assert expected[0] > 0.1
    np.testing.assert_allclose(moved, expected if carries else 0.0, atol=1e-9)


def test_a_walk_beside_its_plan_comes_back_to_it(plan):
    moved, _ = caught(plan, (0.0, 0.0), settled=(0.0, 0.03))
    # The reference is moved at once, and the growth of that is small: the step itself comes back.
    assert moved[1] == pytest.approx(-0.03, abs=5e-3)
