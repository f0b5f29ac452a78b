"""Velocities and footholds that somebody asks for, as the next few footholds."""

import math

import numpy as np
import pytest

from poise.locomotion import Ground, VelocityLimits
from poise.locomotion._support import side
from poise.locomotion._walking._commands import Foothold, StepCommands
from poise.locomotion._walking._ground import Placement
from poise.locomotion._walking._legs import LegRoom

ROOM = LegRoom(
    sizes=((0.2, 0.08), (0.2, 0.08)),
    width=0.2, clearance=0.01, ahead=0.5, far=0.6, wide=0.45, turn=0.6, turn_in=0.12,
    quickness=60.0,
)  # fmt: skip
TIME = 0.5
RIGHT = Placement(position=(0.0, -0.1, 0.0), yaw=0.0)


def commands(ground=None, **limits):
    return StepCommands(VelocityLimits(**limits), ROOM, TIME, ground or Ground())


def led(ahead, sideways, turn):
    leader = commands()
    leader.set_velocity(ahead, sideways, turn)
    leader.advance(10.0)
    return leader


def walked(leader, count=40):
    """From the first foothold to one an even number of steps later: way and turn a second."""
    steps = leader.steps(0, RIGHT, count + 1)
    first, last = steps[0], steps[count]
    way = np.subtract(last.position[:2], first.position[:2])
    return way / (count * TIME), (last.yaw - first.yaw) / (count * TIME)


@pytest.mark.parametrize("velocity", [(0.4, 0.0), (-0.3, 0.0), (0.0, 0.2), (0.0, -0.2), (0.3, 0.1)])
def test_steps_go_with_the_velocity(velocity):
    way, turn = walked(led(*velocity, 0.0))
    assert way == pytest.approx(velocity, abs=1e-9)
    assert turn == pytest.approx(0.0)


@pytest.mark.parametrize("rate", [0.6, -0.3])
def test_steps_turn_with_the_rate_on_the_spot(rate):
    way, turn = walked(led(0.0, 0.0, rate))
    assert turn == pytest.approx(rate)
    assert np.linalg.norm(way) < 0.02


def test_feet_never_cross_or_touch():
    rng = np.random.default_rng(1)
    for _ in range(200):
        steps = led(*rng.normal(0.0, 0.7, 3)).steps(0, RIGHT, 12)
        stance, foot = RIGHT, 0
        for place in steps:
            dx, dy = (place.position[k] - stance.position[k] for k in (0, 1))
            yaw = 0.5 * (place.yaw + stance.yaw)
            apart = side(foot) * (-math.sin(yaw) * dx + math.cos(yaw) * dy)
            assert apart >= ROOM.near(place.yaw - stance.yaw) - 1e-9
            stance, foot = place, 1 - foot


def test_what_is_beyond_limits_is_cut_and_said():
    leader = led(5.0, 0.0, 0.0)
    assert leader.velocity == pytest.approx((VelocityLimits().ahead, 0.0, 0.0))
    assert "taken to" in leader.notice
    leader.set_velocity(0.2, 0.0, 0.0)
    assert leader.notice == ""


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_velocity_that_is_no_number_is_ignored_and_said(bad):
    leader = led(0.3, 0.0, 0.0)
    leader.set_velocity(bad, 0.0, 0.0)
    leader.advance(10.0)
    assert leader.velocity == pytest.approx((0.3, 0.0, 0.0))
    assert "not finite" in leader.notice


@pytest.mark.parametrize("place", [(2.0, 0.1), (0.1, -0.3), (0.0, 3.0)])
def test_one_beyond_it_or_across_the_other_foot_is_moved_and_said(place):
    leader = commands()
    leader.add_foothold(Foothold(0, Placement(position=(*place, 0.0), yaw=0.0)))
    x, y, _ = leader.steps(0, RIGHT, 1)[0].position
    assert abs(x) <= 0.5
    assert y - RIGHT.position[1] >= ROOM.near(0.0) - 1e-9
    assert "out of reach" in leader.notice


@pytest.mark.parametrize(("known", "kept"), [(1.0, 1.0), (-0.3, -0.3)])
def test_a_plan_turns_a_foot_as_far_as_its_legs_were_looked_at_and_no_farther(known, kept):
    """Elsewhere than planned, as who was caught is, it would be turned by any angle."""
    for asked in (known, 2.0 * known):
        leader = commands()
        place = Placement(position=(0.1, 0.2, 0.0), yaw=asked)
        leader.add_foothold(Foothold(0, place, checked=True, turned=known))
        assert leader.steps(0, RIGHT, 1)[0].yaw == pytest.approx(kept)
        assert bool(leader.notice) == (asked != known)


def test_a_foothold_on_an_edge_moves_to_where_it_is_level():
    step = Ground.Platform(center=(0.5, 0.0), size=(0.5, 2.0, 0.05))
    leader = commands(Ground(platforms=(step,)))
    leader.set_velocity(0.5, 0.0, 0.0)
    leader.advance(10.0)
    for place in leader.steps(0, RIGHT, 4):
        assert leader.carries(0, place)
