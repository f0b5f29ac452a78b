"""Where the robot balances on one foot: inside, outside and beyond its sole."""

import math
from unittest.mock import Mock

import numpy as np
import pytest
from standing import PARAMETERS, biped, estimator, footing, sensor
from walker import hands, sample

from poise.apps.teleoperation import TORQUE_TELEOP_PLANT, run_teleop
from poise.locomotion import DeviceStatus, Mode, StepTeleoperator, WayPoint
from poise.locomotion._pendulum import ComShifter
from poise.locomotion._stepping._by_torque._com_feedback import ComFeedback
from poise.locomotion._stepping._mode_events import ModeEvents
from poise.locomotion._stepping._stance._footing import Footing
from poise.locomotion._stepping._stance._one_foot import WIDE, OneFoot, inner_side, one_foot
from poise.robots import Robot


def of(width, omega, margin):
    soles = {name: Mock(width=width) for name in ("left", "right")}
    return one_foot(Mock(spec=Robot, soles=soles), omega, margin)


OMEGA = 3.8
NARROW = of(0.06, OMEGA, 0.0075)


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
    assert (ours is WIDE) == (0.5 * width - margin >= 0.2 / omega)


def test_what_is_held_reaches_beyond_both_edges_of_a_narrow_sole():
    for foot, side in ((0, -1.0), (1, 1.0)):
        held = NARROW.holds(foot, (0.2, 0.06))
        inner, outer = (side * held.y + sign * 0.5 * held.width for sign in (1.0, -1.0))
        assert inner == pytest.approx(0.03 + NARROW.inner)
        assert outer == pytest.approx(-0.03 - NARROW.outer)
        caught = NARROW.caught(foot, (0.2, 0.06))
        assert caught is not None
        assert side * caught.y == pytest.approx(0.7 * NARROW.inwards)
    assert WIDE.caught(0, (0.3, 0.24)) is None


def test_no_momentum_is_asked_for_to_the_side_of_the_foot_in_the_air():
    """There the pressure comes to 5 mm from the edge, and what is missing would lean the trunk."""
    for foot, side in ((0, -1.0), (1, 1.0)):
        asked = NARROW.asks(foot, (0.2, 0.06))
        inner, outer = (side * asked.y + sign * 0.5 * asked.width for sign in (1.0, -1.0))
        assert NARROW.inwards < inner < 0.03 - 0.005
        assert outer == pytest.approx(-0.03 - NARROW.momentum)
        assert asked.length == pytest.approx(0.22)


@pytest.mark.parametrize(("inwards", "lifted"), [(0.003, True), (0.006, False), (-0.012, True)])
@pytest.mark.parametrize("foot", [0, 1])
def test_a_foot_is_lifted_where_the_zmp_brings_the_robot_back(get_robot, foot, inwards, lifted):
    """Farther inwards than the ZMP gets the divergent component would only go on."""
    robot = get_robot("biped20")
    ours = estimator(robot)
    place = NARROW.zmp(foot, ours.anchors[foot], ours.rotation(foot))
    xi = place + inner_side(foot) * inwards * ours.rotation(foot)[:2, 1]
    velocity = OMEGA * (xi - ours.dynamics.com[:2])
    com = ComFeedback(ComShifter(9.81 / OMEGA**2), 0.005)
    com.velocity = com.observed = velocity
    com.acceleration = com.omega**2 * (ours.dynamics.com[:2] - place)
    loads = sensor(robot, 300.0, 300.0)
    loads.zmp = place
    events = ModeEvents(ours, loads, com, PARAMETERS, robot.weight, NARROW)
    for tick in range(20):
        places = [anchor.copy() for anchor in ours.anchors]
        places[1 - foot][2] += 0.0 if tick == 0 else 0.05
        device = sample(0.005 * tick, *places)
        events.advance(device, (True, True), 0.005 * tick, rescuing=False)
    assert events.mode.support == foot
    assert events.mode.single == lifted


@pytest.mark.parametrize("foot", [0, 1])
def test_trunk_and_limbs_that_were_thrown_get_room_to_come_back(foot):
    place, side = np.array([0.4, 0.1, 0.0]), 1.0 if foot == 1 else -1.0
    rests = [
        side * float((NARROW.zmp(foot, place, np.eye(3), leaning) - place[:2])[1])
        for leaning in (-0.1, 0.0, 0.1, 0.5)
    ]
    assert rests == pytest.approx([0.0195, 0.0195, 0.0095, 0.0])
    thrown = NARROW.zmp(foot, place, np.eye(3), 0.0, 0.5) - place[:2]
    assert side * float(thrown[1]) == pytest.approx(0.5 * 0.0195)
    plain = OneFoot(inwards=0.01)
    assert plain.zmp(foot, place, np.eye(3), 0.5)[1] - 0.1 == pytest.approx(side * 0.01)


def test_the_divergent_component_may_be_beyond_the_outer_edge_before_the_robot_steps(get_robot):
    robot = get_robot("biped20")
    before = footing(robot)
    # The left foot stands: to its left is outside.
    to_outside = 0.5 * biped(robot).sizes[0][1] + 0.02
    shift = float(before.sole(0)[1] - before.dynamics.com[1]) + to_outside
    moved = footing(robot, com_velocity=(0.0, shift * before.omega))
    fields = ("biped", "dynamics", "mode", "stance", "anchors", "omega", "sensor")
    held = Footing(
        **{name: getattr(moved, name) for name in fields}, margin=0.0075, one_foot=NARROW
    )
    assert moved.capture_depth == pytest.approx(-0.02 - moved.margin, abs=1e-9)
    assert held.capture_depth == pytest.approx(-0.02 - 0.0075 + NARROW.outer, abs=1e-9)
    assert held.support.depth((0.0, 0.0)) == pytest.approx(
        footing(robot).support.depth((0.0, 0.0)) + moved.margin - 0.0075
    )


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
