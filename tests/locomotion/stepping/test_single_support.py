"""Rest of the ZMP and hold of the DCM on one foot: inside, outside and beyond its sole."""

import math
from unittest.mock import Mock

import numpy as np
import pytest
from made_up import MadeUp, leaning
from walker import hands

from poise.apps.teleoperation import TORQUE_TELEOP_PLANT, run_teleop
from poise.locomotion import DeviceStatus, Mode, StepTeleoperator, WayPoint
from poise.locomotion._support import single_support_region
from poise.robots import Robot, Sole

PLACE, UPRIGHT, FAR = np.array([0.4, 0.1, 0.0]), np.eye(3), 9.0


def of(width, omega, margin, length=0.2):
    soles = {name: Sole(name=name, length=length, width=width) for name in ("left", "right")}
    return single_support_region(Mock(spec=Robot, soles=soles), omega, margin)


def edges(polygon, foot):
    """Distance of the inner and of the outer edge from the middle of a sole at `PLACE` [m]."""
    x, y, _ = PLACE
    side = 1.0 if foot == 1 else -1.0
    inner, outer = (polygon.nearest((x, y + way * side * FAR))[1] for way in (1.0, -1.0))
    return side * (inner - y), -side * (outer - y)


OMEGA, HALF, MARGIN = 3.8, 0.03, 0.0075
NARROW = of(2.0 * HALF, OMEGA, MARGIN)
WIDE = of(0.24, 3.6, 0.02)


@pytest.mark.parametrize(
    ("width", "omega", "margin"), [(0.06, 3.8, 0.0075), (0.14, 3.3, 0.0175), (0.24, 3.6, 0.02)]
)
def test_a_push_outwards_is_held_by_the_sole_and_what_momentum_gives(width, omega, margin):
    ours = of(width, omega, margin)
    room = ours.inwards + 0.5 * width - margin + ours.outer
    assert room >= 0.2 / omega - 1e-12
    # Nothing more is asked of a robot than that takes.
    assert ours.narrow == (ours.outer > 0.0)
    assert 0.0 <= ours.inwards <= 0.35 * width
    assert (ours.inwards == 0.0) == (0.5 * width - margin >= 0.2 / omega)


@pytest.mark.parametrize("foot", [0, 1])
def test_what_is_held_reaches_beyond_both_edges_of_a_narrow_sole(foot):
    held = NARROW.held(foot, PLACE, UPRIGHT)
    assert edges(held, foot) == pytest.approx(
        (HALF + NARROW.inner - MARGIN, HALF + NARROW.outer - MARGIN)
    )
    # Farther than the sole itself.
    assert edges(NARROW.support(foot, PLACE, UPRIGHT), foot) == pytest.approx([HALF - MARGIN] * 2)
    assert NARROW.outer > MARGIN
    wide = edges(WIDE.held(foot, PLACE, UPRIGHT), foot)
    assert wide == pytest.approx([0.12 - 0.02] * 2)


@pytest.mark.parametrize(("foot", "side"), [(0, -1.0), (1, 1.0)])
def test_the_swing_foot_catches_the_robot_beside_a_narrow_sole(foot, side):
    caught = NARROW.caught(foot, PLACE, UPRIGHT)
    assert caught is not None
    middle = np.mean(caught, axis=0) - PLACE[:2]
    assert middle == pytest.approx((0.0, side * 0.7 * NARROW.inwards))
    assert WIDE.caught(foot, PLACE, UPRIGHT) is None


@pytest.mark.parametrize("foot", [0, 1])
def test_no_momentum_is_asked_for_to_the_side_of_the_swing_foot(foot):
    """There the pressure comes to 5 mm from the edge, and what is missing would lean the trunk."""
    asked = NARROW.asked(foot, PLACE, UPRIGHT)
    inner, outer = edges(asked, foot)
    assert NARROW.inwards < inner < HALF - 0.005
    assert outer == pytest.approx(HALF + NARROW.momentum)
    front, back = (asked.nearest((PLACE[0] + way, PLACE[1]))[0] for way in (FAR, -FAR))
    assert front - back == pytest.approx(0.22)
    # Of a wide sole a little all around.
    assert edges(WIDE.asked(foot, PLACE, UPRIGHT), foot) == pytest.approx([0.13] * 2)


@pytest.mark.parametrize(("foot", "side"), [(0, -1.0), (1, 1.0)])
def test_the_zmp_rests_on_the_inner_side_and_a_shift_aims_farther_out(foot, side):
    rest, arriving = (
        side * (goal(foot, PLACE, UPRIGHT)[1] - PLACE[1]) for goal in (NARROW.rest, NARROW.arriving)
    )
    assert rest == pytest.approx(0.0195)
    assert 0.0 < arriving < rest
    assert WIDE.rest(foot, PLACE, UPRIGHT) == pytest.approx((0.4, 0.1))


@pytest.mark.parametrize(("inwards", "lifted"), [(0.021, True), (0.0255, False), (0.0075, True)])
@pytest.mark.parametrize("foot", [0, 1])
def test_a_foot_is_lifted_where_the_zmp_brings_the_robot_back(get_robot, foot, inwards, lifted):
    """Farther inwards than the ZMP gets the DCM would only go on. States are made up."""
    made = MadeUp(get_robot("g1"))
    made.q = leaning(made.robot, foot, inwards)
    made.until(0.1)
    made.up = (0.0, 0.06) if foot == 0 else (0.06, 0.0)
    while not made.mode.single and made.time < 1.5:
        made.tick()
    assert made.mode.support == foot
    assert made.mode.single == lifted


@pytest.mark.parametrize(("name", "ahead", "up"), [("g1", 0.75, 0.5), ("biped20", 1.0, 1.0)])
def test_a_foot_beside_a_narrow_one_is_not_led_as_far_nor_as_high(get_robot, name, ahead, up):
    robot = get_robot(name)
    velocity = StepTeleoperator(robot, actuation="velocity").parameters
    torque = StepTeleoperator(robot, actuation="torque").parameters
    assert torque.step_max == pytest.approx(ahead * velocity.step_max)
    assert torque.lift_max == pytest.approx(up * velocity.lift_max)


@pytest.mark.slow
@pytest.mark.parametrize(("forward", "degrees"), [(0.0, 270), (0.2, 250), (-0.2, 300)])
def test_g1_on_one_foot_leans_against_a_push_outwards_and_steps_nowhere(
    get_robot, forward, degrees
):
    """Its leg helps, not by more than 40 cm, and is back where it is held: its foot stays up."""
    robot, seed, at = get_robot("g1"), 3, 2.6
    angle, force = math.radians(degrees), robot.mass * 0.2 / 0.1
    push = (force * math.cos(angle), force * math.sin(angle), 0.0)
    plant = TORQUE_TELEOP_PLANT.with_noise()
    points = [
        WayPoint(at=0.2, left=(0.0, 0.0, 0.0)),
        WayPoint(at=0.8, left=(0.0, 0.0, 0.1)),
        WayPoint(at=1.8, left=(forward, 0.0, 0.12)),
    ]
    pushes = [(round(at / plant.control_dt), push, 0.1)]
    run = run_teleop(robot, hands(*points), plant, duration=6.0, seed=seed, pushes=pushes)
    log = run.log
    assert not run.fell
    assert not (log.device == list(DeviceStatus).index(DeviceStatus.OVERRULED)).any()
    after = log.time > at
    assert (log.mode[after] == list(Mode).index(Mode.SR)).all()
    # Beyond what the sole alone holds.
    half = 0.5 * next(iter(robot.soles.values())).width
    xi = log.com[:, 1] + np.gradient(log.com[:, 1], log.time) / 3.8
    assert (log.soles[after, 1, 1] - xi[after]).max() > half
    place = log.soles[~after, 0][-1]
    assert np.abs(log.soles[after, 0] - place).max() < 0.4
    assert log.tilt.max() < 0.6
    assert np.linalg.norm(log.soles[-1, 0] - place) < 0.03
    assert log.tilt[-1] < 0.1
