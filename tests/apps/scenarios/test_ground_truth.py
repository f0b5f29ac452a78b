"""Which scenarios run on an estimate of the base, and what is then measured against what."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from poise.apps.scenarios import load_scenario, run_scenario
from poise.apps.scenarios._metrics import METRICS
from poise.apps.scenarios._signals import BaseKnowledge, collect_signals
from poise.apps.scenarios._stage import stage_scenario
from poise.estimation import StateEstimator
from poise.sim import RunRecord, SensorConfig


def test_the_base_is_estimated_unless_a_scenario_wants_the_truth():
    scenario = load_scenario("stand")
    assert isinstance(stage_scenario(scenario).estimator, StateEstimator)
    assert stage_scenario(replace(scenario, ground_truth=True)).estimator is None


def pose(position, turn):
    return np.concatenate([position, pin.Quaternion(pin.exp3(np.array(turn))).coeffs()])


@pytest.fixture
def record():
    """A base that is estimated exactly, 3 cm off, and a right angle of yaw off."""
    record = RunRecord()
    true = [pose([1.0, 2.0, 0.9], [0.0, 0.0, 0.3])] * 3
    known = [
        true[0],
        pose([1.03, 2.0, 0.9], [0.0, 0.0, 0.3]),
        pose([1.0, 2.0, 0.9], [0.0, 0.0, 0.3 + np.pi / 2]),
    ]
    for k in range(3):
        record.add(
            0.1 * k,
            {
                "base_truth": true[k],
                "base_estimate": known[k],
                "velocity_truth": np.array([0.2, 0.0, 0.0, 0.0, 0.0, 1.0]),
                "velocity_estimate": np.array([0.2, 0.01 * k, 0.0, 0.0, 0.0, 5.0]),
            },
        )
    return record


def test_errors_of_the_base_are_those_of_its_level_place_its_vertical_and_its_velocity(record):
    errors = BaseKnowledge(record).errors
    assert errors is not None
    np.testing.assert_allclose(errors.drift, [0.0, 0.03, 0.0], atol=1e-12)
    np.testing.assert_allclose(errors.speed, [0.0, 0.01, 0.02], atol=1e-12)
    # Yaw is no tilt.
    np.testing.assert_allclose(errors.tilt, 0.0, atol=1e-9)


def test_points_that_the_robot_knows_stay_where_they_are_about_its_base(record):
    asked = np.tile([1.5, 2.0, 0.0], (3, 1))
    seen = BaseKnowledge(record).in_world(asked)
    np.testing.assert_allclose(seen[0], asked[0], atol=1e-12)
    np.testing.assert_allclose(seen[1], [1.47, 2.0, 0.0], atol=1e-12)
    # Half a metre ahead of the base it knows; the true one is turned back by a right angle.
    np.testing.assert_allclose(seen[2], [1.0, 1.5, 0.0], atol=1e-12)
    level = BaseKnowledge(record).in_world(asked[:, :2])
    np.testing.assert_allclose(level, seen[:, :2], atol=1e-12)


def test_a_run_records_both_and_measures_by_both():
    sensors = SensorConfig.typical()
    scenario = load_scenario("stand")
    plant = replace(scenario.plant, sensors=sensors)
    run = run_scenario(replace(scenario, plant=plant, duration=0.5, checks=(), motions=()))
    record, errors = run.record, run.signals.base_errors
    assert errors is not None
    # Of the same instant, so that the truth is that of the row before.
    np.testing.assert_array_equal(record["base_truth"][1:], record["q"][:-1, :7])
    np.testing.assert_array_equal(record["velocity_truth"][1:], record["v"][:-1, :6])
    assert record.unit("base_estimate") == "m, -"
    assert 0.0 < errors.tilt.max() < np.radians(1.0)
    assert 0.0 < errors.drift.max() < 0.01
    rows = np.ones(len(run.signals.time), dtype=bool)
    drift = METRICS["drift_max"].measure(run.signals, "", None, rows)
    assert drift.value == errors.drift.max()
    tilt = METRICS["tilt_error_rms"].measure(run.signals, "", None, rows)
    assert tilt.value == pytest.approx(np.sqrt(np.mean(errors.tilt**2)))
    view = collect_signals(record, run.robot)
    assert view.base_errors is not None
    assert not view.payload.any()
