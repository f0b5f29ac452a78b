"""Where feet can go and how low the body must be, against legs that are at their very limits."""

import numpy as np
import pytest
from legs import bent, leg_joints, measured_leg, soles_of
from standing import foot_range

from poise.dynamics import Dynamics, RobotState
from poise.locomotion import StepTeleoperator, TeleopParameters
from poise.locomotion._walking._legs import FootRange
from poise.robots import standing_posture

GAP, MARGIN, LEAN_SHARE = 0.01, 0.02, 0.9
FORWARD = np.array([1.0, 0.0])
STAY = (0.0, 0.0)


def range_of(robot, **changes):
    return foot_range(robot, TeleopParameters(**changes))


def leg_of(robot):
    return measured_leg(robot, next(iter(robot.soles)))


def knee_for(leg, distance):
    """Angle of a knee that has hip and ankle so far apart."""
    square = distance**2 - leg.thigh**2 - leg.shank**2
    return float(np.arccos(square / (2.0 * leg.thigh * leg.shank)))


def too_high_with_knee(robot, knee):
    dynamics, reach = bent(robot, -0.5 * knee, knee, -0.5 * knee), range_of(robot)
    return [
        reach.too_high(foot, place, reach.hip(foot, dynamics), STAY)
        for foot, place in enumerate(soles_of(dynamics))
    ]


def test_the_hip_is_too_high_as_soon_as_the_leg_is_longer_than_its_reach(get_robot):
    robot = get_robot("biped20")
    leg = leg_of(robot)
    knee = knee_for(leg, (1.0 - MARGIN) * leg.length)
    assert too_high_with_knee(robot, knee) == pytest.approx([0.0, 0.0], abs=1e-9)
    assert min(too_high_with_knee(robot, knee - 0.05)) > 1e-3
    assert max(too_high_with_knee(robot, knee + 0.05)) < -1e-3


@pytest.mark.parametrize("name", ["biped20", "talos", "g1"])
def test_a_hip_that_comes_down_by_what_it_is_too_high_has_the_foot_in_reach(get_robot, name):
    robot = get_robot(name)
    reach, leg = range_of(robot), leg_of(robot)
    dynamics = bent(robot, -0.3, 0.6, -0.3)
    hip, place = reach.hip(0, dynamics), soles_of(dynamics)[0] + [0.2, 0.05, 0.0]
    shift = (-0.1, 0.03)
    down = reach.too_high(0, place, hip, shift)
    moved = hip + [*shift, -down]
    assert np.linalg.norm(place + leg.ankle - moved) == pytest.approx(0.98 * leg.length)


def too_low_with_ankle(robot, lean, thigh=0.6, *, alone=False):
    """With level soles and shanks that lean so."""
    dynamics, reach = bent(robot, -thigh, thigh + lean, -lean), range_of(robot)
    return [
        reach.too_low(foot, place, reach.hip(foot, dynamics), FORWARD, alone=alone)
        for foot, place in enumerate(soles_of(dynamics))
    ]


@pytest.mark.parametrize(("name", "off"), [("biped20", 1e-9), ("talos", 1e-9), ("g1", 0.02)])
def test_the_hip_is_too_low_as_soon_as_the_ankle_bends_too_far(get_robot, name, off):
    robot = get_robot(name)
    lean = LEAN_SHARE * leg_of(robot).lean_max
    assert too_low_with_ankle(robot, lean) == pytest.approx([0.0, 0.0], abs=off)
    assert min(too_low_with_ankle(robot, lean + 0.15)) > 0.0
    assert max(too_low_with_ankle(robot, lean - 0.15)) < 0.0


def knee_torque(dynamics, foot):
    """Of a robot at rest whose weight is on the middle of one sole, over what the knee has."""
    robot = dynamics.robot
    sole = list(robot.soles)[foot]
    knee = leg_joints(robot, sole)[3]
    row = robot.base_dofs + knee
    pressed = dynamics.frame(robot.frame_id(sole)).jacobian[2, row] * robot.weight
    return abs(float(dynamics.h[row] - pressed)) / float(robot.tau_max[knee])


@pytest.mark.parametrize("name", ["biped20", "talos"])
@pytest.mark.parametrize("foot", [0, 1])
def test_the_hip_is_too_low_as_soon_as_the_knee_holds_no_more(get_robot, name, foot):
    robot = get_robot(name)
    leans = np.linspace(0.3, LEAN_SHARE * leg_of(robot).lean_max - 0.01, 60)
    held = [knee_torque(bent(robot, -0.6, 0.6 + lean, -lean), foot) <= 0.7 for lean in leans]
    low = [too_low_with_ankle(robot, lean, alone=True)[foot] > 0.0 for lean in leans]
    assert held[0]
    assert not held[-1]
    # Shank and foot hang on the knee, too, and are not counted.
    assert abs(low.index(True) - held.index(False)) <= 2
    # Beside another one the leg holds half of it.
    assert max(too_low_with_ankle(robot, leans[low.index(True) + 1])) < 0.0


@pytest.mark.parametrize("name", ["romeo", "human", "biped20"])
def test_a_robot_that_squats_is_too_low_for_one_leg_when_its_knee_holds_no_more(get_robot, name):
    robot, reach = get_robot(name), range_of(get_robot(name))
    dynamics, found = Dynamics(robot), []
    dynamics.update(RobotState(robot.q_home, np.zeros(robot.nv)))
    home, least = float(dynamics.com[2]), {"romeo": 0.97, "human": 0.92, "biped20": 0.74}[name]
    for share in np.linspace(1.0, least, 8):
        q = standing_posture(robot, com_height=float(share) * home)
        dynamics.update(RobotState(q, np.zeros(robot.nv)))
        place = soles_of(dynamics)[0]
        room = -reach.too_weak(0, place, reach.hip(0, dynamics), FORWARD)
        found.append((knee_torque(dynamics, 0), room))
    # From 0.7 of its torque on; shank and foot are not counted.
    assert all((torque < 0.7) == (room > 0.0) for torque, room in found if abs(torque - 0.7) > 0.02)
    assert found[0][1] > 0.0 > found[-1][1]


@pytest.mark.parametrize(("name", "off"), [("biped20", 1e-9), ("talos", 1e-9), ("g1", 0.02)])
def test_the_hip_is_too_low_for_a_leg_that_folds_no_deeper(get_robot, monkeypatch, name, off):
    robot = get_robot(name)
    dynamics = bent(robot, -0.4, 0.8, -0.4)
    place = soles_of(dynamics)[0]
    hip = range_of(robot).hip(0, dynamics)
    leg = leg_of(robot)
    long = np.linalg.norm(hip - place - leg.ankle) / leg.length
    missing = []
    for fold in (long - 0.05, long, long + 0.05):
        monkeypatch.setattr(f"{FootRange.__module__}._SERVO_FOLD", fold)
        missing.append(range_of(robot).too_low(0, place, hip, FORWARD, alone=False))
    assert missing[1] == pytest.approx(0.0, abs=off)
    assert missing[0] < missing[1] < missing[2]
    assert missing[2] == pytest.approx(0.05 * leg.length, abs=off + 0.01)


def test_a_place_in_reach_is_left_alone(get_robot):
    robot = get_robot("biped20")
    reach, dynamics = range_of(robot), bent(robot, -0.3, 0.6, -0.3)
    left, right = soles_of(dynamics)
    target = left + [0.1, 0.02, 0.05]
    answer = reach.bring_back(0, tuple(target), right, reach.hip(0, dynamics), FORWARD)
    assert answer == pytest.approx(target, abs=1e-12)


def far_ahead(robot, **changes):
    """A left foot sent a leg's length forward: what it is brought back to, its hip and ankle."""
    reach, dynamics = range_of(robot, step_max=2.0), bent(robot, -0.3, 0.6, -0.3)
    left, right = soles_of(dynamics)
    hip, target = reach.hip(0, dynamics), left + [0.7, 0.0, 0.0]
    answer = reach.bring_back(0, tuple(target), right, hip, FORWARD, **changes)
    return target, answer, hip, answer + leg_of(robot).ankle


def test_a_command_out_of_reach_is_shortened_along_the_ground_to_the_reach(get_robot):
    robot = get_robot("biped20")
    target, answer, hip, ankle = far_ahead(robot)
    assert answer[2] == target[2]
    assert 0.1 < answer[0] < target[0]
    assert np.linalg.norm(ankle - hip) == pytest.approx(0.98 * leg_of(robot).length)


def test_a_body_that_may_come_down_reaches_farther(get_robot):
    robot = get_robot("biped20")
    _, answer, hip, ankle = far_ahead(robot, lower=0.1)
    assert answer[0] > far_ahead(robot)[1][0] + 0.05
    assert np.linalg.norm(ankle - (hip - [0.0, 0.0, 0.1])) == pytest.approx(
        0.98 * leg_of(robot).length
    )


@pytest.mark.parametrize("foot", [0, 1])
def test_a_foot_stays_on_its_side_and_within_a_step(get_robot, foot):
    robot = get_robot("biped20")
    reach, dynamics = range_of(robot, step_max=0.3), bent(robot, -0.5, 1.0, -0.5)
    support = soles_of(dynamics)[1 - foot]
    hip, side = reach.hip(foot, dynamics), 1.0 - 2.0 * foot
    width = next(iter(robot.soles.values())).width

    def sent(ahead, aside):
        target = support + [ahead, side * aside, 0.0]
        x, y, _ = reach.bring_back(foot, tuple(target), support, hip, FORWARD) - support
        return float(x), side * float(y)

    assert sent(0.0, -0.2) == pytest.approx((0.0, width + GAP))
    assert sent(0.0, 0.8)[1] <= 0.3 + 1e-12
    assert sent(0.8, 0.27)[0] <= 0.3 + 1e-12
    assert sent(-0.8, 0.27)[0] >= -0.3 - 1e-12


GRID = np.stack(np.meshgrid(np.linspace(-0.5, 0.5, 61), np.linspace(-0.5, 0.5, 61)), axis=-1)


def overlap(sole, place, turns):
    """Whether any of many points of a sole at a place lies inside the other one, at the origin."""
    (c, s), (c_other, s_other) = ((np.cos(turn), np.sin(turn)) for turn in turns)
    points = GRID * [sole.length, sole.width] @ np.array([[c, s], [-s, c]]) + place
    points = points @ np.array([[c_other, -s_other], [s_other, c_other]])
    half = 0.5 * np.array([sole.length, sole.width])
    return bool((np.abs(points) < half).all(axis=-1).any())


@pytest.mark.parametrize("foot", [0, 1])
def test_soles_that_are_turned_come_no_nearer_than_their_edges_are_clear(get_robot, foot):
    robot = get_robot("biped20")
    reach, dynamics = range_of(robot), bent(robot, -0.5, 1.0, -0.5)
    support, hip = soles_of(dynamics)[1 - foot], reach.hip(foot, dynamics)
    sole, side = next(iter(robot.soles.values())), 1.0 - 2.0 * foot
    least = sole.width + GAP
    rng, wider = np.random.default_rng(4), 0
    for _ in range(60):
        turns, ahead = tuple(rng.uniform(-0.6, 0.6, 2)), rng.uniform(-0.2, 0.2)
        both = (turns[foot], turns[1 - foot])
        target = support + [ahead, -0.1 * side, 0.0]
        answer = (
            reach.bring_back(foot, tuple(target), support, hip, FORWARD, turns=turns) - support
        )[:2]
        assert not overlap(sole, answer, both)
        if abs(answer[1]) > least + 1e-3:
            wider += 1
            assert overlap(sole, answer - [0.0, side * 0.02], both)
    assert wider > 20


@pytest.mark.parametrize(("asked", "given"), [(0.1, 0.1), (0.4, 0.25), (-0.05, -0.05)])
def test_a_foot_goes_no_higher_than_it_may_above_the_other_one(get_robot, asked, given):
    robot = get_robot("biped20")
    reach, dynamics = range_of(robot, lift_max=0.25), bent(robot, -0.3, 0.6, -0.3)
    left, right = soles_of(dynamics)
    target = left + [0.05, 0.0, asked]
    answer = reach.bring_back(0, tuple(target), right, reach.hip(0, dynamics), FORWARD)
    np.testing.assert_allclose(answer, left + [0.05, 0.0, given], atol=1e-12)


def test_beside_is_across_where_the_pelvis_faces(get_robot):
    robot = get_robot("biped20")
    reach, dynamics = range_of(robot), bent(robot, -0.5, 1.0, -0.5)
    left, right = soles_of(dynamics)
    turned = np.array([np.cos(0.4), np.sin(0.4)])
    answer = reach.bring_back(0, tuple(right), right, reach.hip(0, dynamics), turned)
    gap = next(iter(robot.soles.values())).width + GAP
    assert float((answer - right)[:2] @ turned) == pytest.approx(0.0, abs=1e-12)
    assert float((answer - right)[:2] @ [-turned[1], turned[0]]) == pytest.approx(gap)
    assert left[2] == pytest.approx(answer[2])


def test_a_robot_that_stands_is_neither_too_high_nor_too_low(get_robot):
    robot = get_robot("biped20")
    controller = StepTeleoperator(
        robot, q_start=standing_posture(robot, com_height=0.72), actuation="velocity"
    )
    dynamics, reach = controller.estimator.dynamics, range_of(robot)
    for foot, place in enumerate(controller.estimator.anchors):
        hip = reach.hip(foot, dynamics)
        assert reach.too_high(foot, place, hip, STAY) < 0.0
        assert reach.too_low(foot, place, hip, FORWARD, alone=True) < 0.0


def test_feet_span_what_they_may_be_led_to_and_little_more(get_robot):
    reach = range_of(get_robot("biped20"), step_max=0.3)
    right, turned = np.zeros(3), np.array([np.cos(0.5), np.sin(0.5)])
    for ahead, aside, spans in ((0.0, 0.27, True), (0.37, 0.27, True), (-0.39, 0.27, False),
                                (0.0, 0.37, True), (0.0, 0.39, False)):  # fmt: skip
        left = np.array([ahead, aside, 0.05])
        assert reach.spans(left, right, FORWARD) == spans
        along = turned * ahead + np.array([-turned[1], turned[0]]) * aside
        assert reach.spans(np.array([*along, 0.0]), right, turned) == spans
