"""Where a foot in the air is sent, and how fast it may go there."""

from dataclasses import replace

import numpy as np
import pytest
from standing import PARAMETERS, aimed, devices, footing, steady, towards
from walker import sample

from poise.dynamics import RobotState
from poise.locomotion import Mode

_FOOT = "poise.locomotion._stepping._feet"


@pytest.fixture
def at_once(monkeypatch):
    """Velocities that are not smoothed."""
    monkeypatch.setattr(f"{_FOOT}._SWING_TIME", 1e-12)


def device_at(footing, up, ahead=0.0):
    x, y, z = footing.anchors[1].tolist()
    return sample(0.0, right=(x + ahead, y, z + up))


def downwards(robot, height, *, hurry=False):
    """Speed of a foot that is sent far down from a height above the ground [m/s]."""
    now = footing(robot, lifted=height)
    below = now.sole(1) - [0.0, 0.0, 0.5]
    return -float(towards(devices(robot), now, below, hurry=hurry)[2])


@pytest.mark.parametrize(("share", "wanted"), [(-0.2, 0.0), (0.0, 0.0), (0.5, 0.5), (1.0, 1.0),
                                               (3.0, 1.0)])  # fmt: skip
def test_a_foot_comes_down_slower_the_nearer_the_ground_is(get_robot, at_once, share, wanted):
    speed = downwards(get_robot("biped20"), share * 0.04)
    assert speed == pytest.approx(0.15 + wanted * (PARAMETERS.lower_speed - 0.15), rel=1e-6)


def test_a_foot_that_has_to_be_down_comes_down_as_fast_as_it_can(get_robot, at_once):
    robot = get_robot("biped20")
    assert downwards(robot, 0.1, hurry=True) == pytest.approx(1.0)


def test_a_foot_goes_up_as_fast_as_it_is_asked(get_robot, at_once):
    robot = get_robot("biped20")
    now = footing(robot)
    up = towards(devices(robot), now, now.sole(1) + [0.0, 0.0, 0.5])
    assert up.tolist() == pytest.approx([0.0, 0.0, 1.0])


def swing(robot, com_velocity):
    """Velocity of a foot sent forward and up, once it is smooth."""
    now = footing(robot, com_velocity=com_velocity)
    ours, answer = devices(robot), np.zeros(3)
    for _ in range(400):
        answer = towards(ours, now, now.sole(1) + [0.03, 0.0, 0.04])
    return answer


def test_a_foot_swings_slower_the_nearer_the_robot_is_to_tipping(get_robot):
    robot = get_robot("biped20")
    now = footing(robot)
    way = now.anchors[0][:2] - now.dynamics.com[:2]
    # The divergent component at the centre of the sole that carries, near its edge, and beyond.
    centre, near, beyond = (
        swing(robot, tuple((share * way * now.omega).tolist())) for share in (1.0, 0.4, 0.0)
    )
    assert centre == pytest.approx([0.3, 0.0, 0.4], rel=1e-6)
    assert 0.0 < near[0] < 0.5 * centre[0]
    assert beyond[0] == pytest.approx(0.0, abs=1e-12)
    assert near[2] == pytest.approx(0.4)
    assert beyond[2] == pytest.approx(0.4)


def test_a_swing_starts_smoothly(get_robot):
    robot = get_robot("biped20")
    now = footing(robot)
    first = towards(devices(robot), now, now.sole(1) + [0.0, 0.0, 0.05])
    assert first[2] == pytest.approx(0.5 * PARAMETERS.dt / (0.05 + PARAMETERS.dt))


def test_a_foot_that_has_not_left_the_ground_cannot_be_pushed_down(get_robot):
    robot = get_robot("biped20")
    now, ours = steady(robot, lifted=0.02), devices(robot)
    device = device_at(now, 0.005)
    down = {left: aimed(ours, replace(now, has_left=left), device) for left in (True, False)}
    assert down[True][2] == pytest.approx(now.anchors[1][2] + 0.005)
    assert down[False][2] == pytest.approx(now.sole(1)[2])


def test_a_command_goes_no_deeper_than_it_may(get_robot):
    robot = get_robot("biped20")
    now = steady(robot, lifted=0.1)
    place = aimed(devices(robot), now, device_at(now, -0.4))
    assert place[2] == pytest.approx(now.anchors[1][2] - PARAMETERS.press_depth)


def test_a_foot_goes_forward_only_as_far_as_it_is_clear(get_robot):
    robot = get_robot("biped20")
    for lifted, share in ((0.0, 0.0), (0.25, 0.25), (2.0, 1.0)):
        now = steady(robot, lifted=lifted * 0.04)
        place = aimed(devices(robot), now, device_at(now, 0.1, 0.1), room_below=0.1)
        assert place[0] - now.sole(1)[0] == pytest.approx(0.1 * share, abs=1e-12)


@pytest.mark.parametrize("has_left", [False, True])
def test_a_foot_on_a_block_is_not_dragged_over_it(get_robot, has_left):
    """The other one stands 10 cm lower: from there this one looks clear as it stands."""
    now = steady(get_robot("biped20"))
    now.anchors[0][2] -= 0.1
    now = replace(now, has_left=has_left)
    device = device_at(now, 0.03, 0.1)
    place = aimed(devices(now.biped.robot), now, device, room_below=0.1)
    moved = 0.1 if has_left else 0.0
    assert place[0] - now.sole(1)[0] == pytest.approx(moved, abs=1e-12)
    assert place[2] > now.sole(1)[2] + 0.02


def test_without_a_device_the_foot_goes_straight_down(get_robot):
    robot = get_robot("biped20")
    now = footing(robot, lifted=0.1)
    place = aimed(devices(robot), now, None)
    assert place[:2] == pytest.approx(now.sole(1)[:2])
    assert place[2] < now.anchors[1][2]


def ahead_of_the_hip(robot):
    """In single support, the right foot swung forward, over ground that it does not touch."""
    now = steady(robot)
    q, v = now.dynamics.state.q.copy(), now.dynamics.state.v
    q[7 + robot.joint_index("right_hip_pitch")] -= 0.4
    now.dynamics.update(RobotState(q, v))
    now = replace(now)
    now.anchors[1][:] = now.sole(1) - [0.0, 0.0, 0.03]
    now.anchors[0][2] = now.anchors[1][2]
    return now


def sent(now, device, seconds, ours):
    """Where a foot that does not move is sent after so long, from where it is [m]."""
    for _ in range(round(seconds / PARAMETERS.dt)):
        place = aimed(ours, now, device, room_below=0.1)
    return place - now.sole(1)


@pytest.mark.parametrize("lost", [False, True])
def test_a_foot_that_hangs_over_the_ground_is_led_nearer(get_robot, lost):
    """Its leg is at its end, and straight down it would hang for ever."""
    now = ahead_of_the_hip(get_robot("biped20"))
    assert now.capture_depth > 0.0
    device, ours = None if lost else device_at(now, -0.03), devices(now.biped.robot)
    assert sent(now, device, 0.35, ours)[:2].tolist() == pytest.approx([0.0, 0.0])
    x, y, z = sent(now, device, 0.1, ours).tolist()
    # With (17c) that is five centimetres in a second.
    assert np.hypot(x, y) == pytest.approx(0.005)
    assert x < -abs(y)
    assert z < -0.03


def test_a_foot_that_still_comes_down_or_is_held_up_is_not_led_nearer(get_robot):
    now = ahead_of_the_hip(get_robot("biped20"))
    ours, up, down = devices(now.biped.robot), device_at(now, 0.03), device_at(now, -0.03)
    assert sent(now, up, 1.0, ours)[:2].tolist() == pytest.approx([0.0, 0.0])
    for _ in range(5):
        assert sent(now, down, 0.3, ours)[:2].tolist() == pytest.approx([0.0, 0.0])
        now.dynamics.state.q[2] -= 0.004
        now.dynamics.update(RobotState(now.dynamics.state.q, now.dynamics.state.v))
        now = replace(now)
    assert sent(now, down, 0.5, ours)[0] < 0.0
    # Held up, and sent down again, it has its time anew.
    sent(now, up, PARAMETERS.dt, ours)
    assert sent(now, down, 0.3, ours)[:2].tolist() == pytest.approx([0.0, 0.0])


def test_a_robot_that_falls_puts_its_foot_down_and_goes_on_doing_so(get_robot):
    robot = get_robot("biped20")
    ours = devices(robot)
    safe = steady(robot, lifted=0.1)
    device = device_at(safe, 0.2)
    assert aimed(ours, safe, device)[2] > safe.anchors[1][2]
    for falling in (True, False):
        place = aimed(ours, safe, device, falling=falling)
        assert place[:2] == pytest.approx(safe.sole(1)[:2])
        assert place[2] < safe.anchors[1][2]
        assert ours.rescuing
    ours.take_off(1)
    assert aimed(ours, safe, device)[2] > safe.anchors[1][2]


def test_with_both_feet_on_the_ground_the_other_is_held_where_it_was_put_down(get_robot):
    robot = get_robot("biped20")
    now = footing(robot, Mode.D, lifted=0.01)
    place = aimed(devices(robot), now, None)
    assert place.tolist() == now.anchors[1].tolist()


def test_a_sole_with_no_ground_left_under_it_stops_the_swing_and_raises_nothing(get_robot):
    robot = get_robot("biped20")
    half = 0.5 * min(robot.soles["left_sole"].length, robot.soles["left_sole"].width)
    # At exactly half a sole the deepest place in it is on its edge.
    for margin in (half, 2.0 * half):
        now = footing(robot)
        now = replace(now, region=replace(now.region, margin=margin))
        answer = towards(devices(robot), now, now.sole(1) + [0.3, 0.0, 0.04])
        assert np.isfinite(answer).all()
        assert answer[:2].tolist() == [0.0, 0.0]
