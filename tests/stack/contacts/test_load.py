"""Loading and unloading a contact over time."""

import numpy as np
import pytest

from poise.stack import SurfaceContact
from poise.stack._contact import MAX_LOAD_FACTOR, LoadRamp


def loads(ramp, times):
    return [ramp.advance(float(t)) for t in times]


def test_a_new_contact_is_fully_loaded():
    ramp = LoadRamp()
    assert ramp.active
    assert ramp.advance(5.0) == 1.0


def test_release_falls_linearly_from_the_first_tick_after_it():
    ramp = LoadRamp()
    ramp.advance(3.0)
    ramp.start(0.0, 0.4)
    assert loads(ramp, [10.0, 10.1, 10.2, 10.3]) == pytest.approx([1.0, 0.75, 0.5, 0.25])
    assert ramp.active
    assert ramp.advance(10.4) == 0.0
    assert not ramp.active
    assert ramp.advance(11.0) == 0.0


def test_engage_is_active_at_once_and_rises_from_zero():
    ramp = LoadRamp()
    ramp.start(0.0, 0.0)
    ramp.advance(0.0)
    assert not ramp.active
    ramp.start(1.0, 0.2)
    assert ramp.active
    assert loads(ramp, [1.0, 1.05, 1.1, 1.2]) == pytest.approx([0.0, 0.25, 0.5, 1.0])


def test_a_ramp_turned_round_midway_goes_on_from_where_it_is():
    ramp = LoadRamp()
    ramp.start(0.0, 1.0)
    assert loads(ramp, [0.0, 0.4]) == pytest.approx([1.0, 0.6])
    ramp.start(1.0, 1.0)
    assert loads(ramp, [0.5, 1.0, 1.5]) == pytest.approx([0.6, 0.8, 1.0])


def test_no_duration_means_at_the_next_tick():
    ramp = LoadRamp()
    ramp.start(0.0, 0.0)
    assert ramp.active
    assert ramp.advance(0.0) == 0.0
    assert not ramp.active


def test_a_clock_that_jumps_back_never_leaves_the_range():
    ramp = LoadRamp()
    ramp.start(0.0, 0.5)
    values = loads(ramp, [10.0, 10.2, 0.0, 0.1, 0.3, 0.6])
    assert all(0.0 <= value <= 1.0 for value in values)
    assert values[-1] == 0.0  # a simulation that starts again does not freeze the ramp


@pytest.fixture
def contact(get_robot):
    contact = SurfaceContact("left_sole")
    contact.bind(get_robot("humanoid33"))
    return contact


def test_the_normal_force_bound_follows_the_load(contact, get_robot):
    weight = get_robot("humanoid33").mass * 9.81
    contact.advance(0.0)
    assert contact.wrench_upper[2] == pytest.approx(MAX_LOAD_FACTOR * weight)
    contact.release(0.2)
    contact.advance(1.0)
    contact.advance(1.15)
    assert contact.wrench_upper[2] == pytest.approx(0.25 * weight)
    assert contact.active
    contact.advance(1.2)
    assert contact.wrench_upper[2] == 0.0
    assert not contact.active
    contact.engage(0.1)
    assert contact.active
    contact.advance(2.0)
    # What may bear nothing has no wrench at all.
    assert np.array_equal(contact.wrench_upper, np.zeros(6))
    assert np.array_equal(contact.wrench_lower, np.zeros(6))
    contact.advance(2.1)
    assert contact.wrench_upper[2] == pytest.approx(MAX_LOAD_FACTOR * weight)
    assert np.array_equal(contact.wrench_lower[[0, 1, 3, 4, 5]], np.full(5, -np.inf))


def test_bounds_never_cross_on_the_way(contact):
    rng = np.random.default_rng(0)
    time = 0.0
    for _ in range(500):
        if rng.random() < 0.05:
            rng.choice([contact.release, contact.engage])(float(rng.uniform(0.0, 0.3)))
        time += float(rng.uniform(0.0, 0.02))
        contact.advance(time)
        assert (contact.wrench_lower <= contact.wrench_upper).all()
