"""Which foot is taken to be at rest, and what becomes of one that carries nothing."""

import pytest
from standing import PARAMETERS, estimator

from poise.locomotion import Mode

TICKS = 400
"""Long enough for a foot to be as far down as it is pressed."""


def loaded(robot, left, right):
    """An estimator of a robot whose soles carry so much [N]."""
    ours = estimator(robot)
    ours.sense.loads[:] = left, right
    return ours


@pytest.mark.parametrize("mode", [Mode.D, Mode.TL, Mode.TR])
def test_with_both_feet_on_the_ground_the_one_that_carries_more_is_the_stance(get_robot, mode):
    robot = get_robot("biped20")
    ours = loaded(robot, 300.0, 320.0)
    before = ours.stance
    ours.follow(mode)
    assert ours.stance == before
    for left, right, stance in ((500.0, 100.0, 0), (100.0, 500.0, 1)):
        ours.sense.loads[:] = left, right
        ours.begin(Mode.D, mode)
        ours.follow(mode)
        assert ours.stance == stance


def test_on_one_foot_that_foot_is_the_stance_whatever_the_loads_say(get_robot):
    robot = get_robot("biped20")
    ours = loaded(robot, 0.0, 640.0)
    ours.begin(Mode.TL, Mode.SL)
    ours.follow(Mode.SL)
    assert ours.stance == 0


def test_a_foot_that_carries_nothing_is_pressed_down_no_faster_than_it_may(get_robot):
    robot = get_robot("biped20")
    ours = loaded(robot, 0.0, 640.0)
    height = float(ours.sole(0)[2])
    ours.follow(Mode.D)
    assert ours.pressed == pytest.approx(PARAMETERS.dt * 0.1)
    for _ in range(TICKS):
        ours.follow(Mode.D)
    # How far below itself it is sent, times the gain (17c), is the speed of the foot.
    assert 10.0 * ours.pressed == pytest.approx(0.1)
    # The ground is where the foot is: the body does not come down with what is pressed.
    assert ours.anchors[0][2] == pytest.approx(height, abs=1e-9)
    assert ours.anchors[1][2] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("mode", "pressed"), [(Mode.D, True), (Mode.TL, True), (Mode.TR, False)])
def test_a_foot_that_is_about_to_be_lifted_is_not_pressed(get_robot, mode, pressed):
    robot = get_robot("biped20")
    ours = loaded(robot, 0.0, 640.0)
    ours.begin(Mode.D, mode)
    for _ in range(TICKS):
        ours.follow(mode)
    assert (ours.pressed > 0.0) == pressed


def test_a_pressed_foot_stands_where_it_is_as_soon_as_it_carries(get_robot):
    robot = get_robot("biped20")
    ours = loaded(robot, 0.0, 640.0)
    height = float(ours.sole(0)[2])
    for _ in range(TICKS):
        ours.follow(Mode.D)
    ours.sense.loads[:] = 40.0, 600.0
    ours.follow(Mode.D)
    assert (ours.anchors[0][2], ours.pressed) == (height, 0.0)
    ours.follow(Mode.D)
    assert (ours.anchors[0][2], ours.pressed) == (height, 0.0)


def test_a_foot_that_carries_from_the_start_keeps_its_place(get_robot):
    robot = get_robot("biped20")
    ours = loaded(robot, 100.0, 540.0)
    ours.anchors[0][2] = place = 0.003
    ours.follow(Mode.D)
    assert ours.anchors[0][2] == place


def test_nothing_is_pressed_on_one_foot(get_robot):
    robot = get_robot("biped20")
    ours = loaded(robot, 0.0, 640.0)
    before = ours.anchors[0].copy()
    ours.follow(Mode.SR)
    assert ours.anchors[0].tolist() == before.tolist()


def test_a_foot_that_has_landed_stands_where_it_landed(get_robot):
    robot = get_robot("biped20")
    ours = loaded(robot, 100.0, 540.0)
    ours.anchors[0][:] = 9.0
    ours.begin(Mode.SR, Mode.D)
    assert ours.anchors[0] == pytest.approx(ours.sole(0))
