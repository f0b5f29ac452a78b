"""Operators with habits: what their hands do, and what the finding allows."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("mujoco")

from poise.locomotion import StepTeleoperator
from poise.robots import load_robot
from studies.bad_operator.conditions import MIXED
from studies.bad_operator.habits import HABITS, HabitualOperator
from studies.bad_operator.led_trial import Outcome, Trial, run_trial
from studies.torque_teleoperation.habits_section import _finding, _row

SECONDS, DT = 12.0, 0.002


@pytest.fixture(scope="module")
def teleoperator():
    return StepTeleoperator(load_robot("biped20"), actuation="torque")


def hands(teleoperator, habit, seed):
    """Where both devices are, tick by tick, NaN where nothing is sent; and the samples."""
    operator = HabitualOperator(teleoperator, habit, seed)
    samples = [operator.sample(k * DT) for k in range(round(SECONDS / DT))]
    nowhere = np.full(6, np.nan)
    places = [nowhere if s is None else np.concatenate([s.place(0), s.place(1)]) for s in samples]
    return np.array(places), samples


@pytest.mark.parametrize("habit", HABITS)
def test_hands_go_on_and_on_and_never_leave_the_robot(teleoperator, habit):
    places, samples = hands(teleoperator, habit, 5)
    sent = ~np.isnan(places[:, 0])
    assert sent.mean() > 0.5
    start = np.concatenate(teleoperator.estimator.anchors)
    assert np.nanmax(np.abs(places - start)) < 1.5
    later = places[len(places) // 2 :]
    moved = np.nanmax(later, axis=0) - np.nanmin(later, axis=0)
    assert moved.max() > 0.03
    assert [s.time for s in samples if s is not None] == pytest.approx(DT * np.flatnonzero(sent))


def test_a_seed_says_all_that_is_drawn_by_chance(teleoperator):
    once, again = (hands(teleoperator, "teleports", 1)[0] for _ in range(2))
    other, _ = hands(teleoperator, "teleports", 2)
    np.testing.assert_array_equal(once, again)
    assert not np.array_equal(once, other)


def test_only_who_rides_uses_the_stick_and_only_who_bows_commands_the_body(teleoperator):
    for habit in HABITS:
        _, samples = hands(teleoperator, habit, 3)
        sent = [s for s in samples if s is not None]
        assert any(any(s.velocity) for s in sent) == (habit == "rides")
        assert any(any(s.body.numbers) for s in sent) == (habit == "bows")


def test_a_step_is_led_and_made():
    outcome = run_trial(
        Trial(
            robot="biped20",
            level="velocity",
            condition="as described",
            seed=0,
            seconds=4.0,
            habit="steps with care",
        )
    )
    assert (outcome.fell, outcome.seconds, outcome.steps) == (False, pytest.approx(4.0), 1)


def test_one_fall_in_ten_minutes_is_allowed_under_all_conditions_and_none_as_described():
    stood = Outcome(
        trial=Trial(
            robot="g1", level="torque", condition=MIXED, seed=0, seconds=60.0, habit="stork"
        ),
        fell=False,
        seconds=60.0,
        steps=3,
        tilt=0.1,
        apart=0.1,
    )
    fell = replace(stood, fell=True)
    assert _finding("g1", MIXED, [stood] * 9 + [fell]).ok
    assert not _finding("g1", MIXED, [stood] * 8 + [fell]).ok
    assert not _finding("g1", "as described", [stood] * 99 + [fell]).ok
    assert _row("stork", [[stood, fell], [stood]]) == ("stork", "1 (6)", "0 (3)")
