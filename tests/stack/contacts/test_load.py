"""Loading and unloading a contact over time."""

import numpy as np
import pytest

from poise.stack import SurfaceContact


@pytest.fixture
def contact(get_robot):
    contact = SurfaceContact("left_sole", min_load=0.0)
    contact.bind(get_robot("humanoid33"))
    return contact


def loads(contact, times):
    """The normal force that may be carried at some times, over the weight."""
    found = []
    for time in times:
        contact.advance(time)
        found.append(contact.wrench_upper[2] / contact.robot.weight)
    return found


def test_a_load_falls_and_rises_linearly_from_the_first_tick_on(contact):
    assert loads(contact, [5.0]) == [5.0]
    contact.release(0.4)
    times = [10.0, 10.1, 10.2, 10.3]
    assert loads(contact, times) == pytest.approx([5.0, 0.75, 0.5, 0.25])
    assert contact.active
    assert loads(contact, [10.4, 11.0]) == [0.0, 0.0]
    assert not contact.active
    # What may bear nothing has no wrench at all.
    np.testing.assert_array_equal([contact.wrench_lower, contact.wrench_upper], np.zeros((2, 6)))
    contact.engage(0.2)
    assert contact.active
    assert loads(contact, [1.0, 1.05, 1.1, 1.2]) == pytest.approx([0.0, 0.25, 0.5, 5.0])
    np.testing.assert_array_equal(contact.wrench_lower[[0, 1, 3, 4, 5]], np.full(5, -np.inf))


def test_a_ramp_turned_round_midway_goes_on_from_where_it_is(contact):
    contact.release(1.0)
    assert loads(contact, [0.0, 0.4]) == pytest.approx([5.0, 0.6])
    contact.engage(1.0)
    assert loads(contact, [0.5, 1.0, 1.5]) == pytest.approx([0.6, 0.8, 5.0])


def test_no_duration_means_at_the_next_tick(contact):
    contact.release(0.0)
    assert contact.active
    assert loads(contact, [0.0]) == [0.0]
    assert not contact.active


def test_a_clock_that_jumps_back_never_leaves_the_range(contact):
    contact.release(0.5)
    values = loads(contact, [10.0, 10.2, 0.0, 0.1, 0.3, 0.6])
    assert all(0.0 <= value <= 1.0 for value in values[1:])
    assert values[-1] == 0.0  # a simulation that starts again does not freeze the ramp


def test_bounds_never_cross_on_the_way(get_robot):
    contact = SurfaceContact("left_sole")
    contact.bind(get_robot("humanoid33"))
    rng = np.random.default_rng(0)
    time = 0.0
    for _ in range(500):
        if rng.random() < 0.05:
            rng.choice([contact.release, contact.engage])(float(rng.uniform(0.0, 0.3)))
        time += float(rng.uniform(0.0, 0.02))
        contact.advance(time)
        assert (contact.wrench_lower <= contact.wrench_upper).all()
