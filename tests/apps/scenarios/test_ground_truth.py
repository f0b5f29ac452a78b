"""Which scenarios run on an estimate of the base."""

from dataclasses import replace

import pytest

from poise.apps.scenarios import load_scenario
from poise.apps.scenarios._stage import stage_scenario
from poise.errors import ConfigurationError
from poise.estimation import StateEstimator


def test_the_truth_is_told_unless_a_scenario_wants_the_estimate():
    scenario = load_scenario("stand")
    assert stage_scenario(scenario).estimator is None
    estimated = stage_scenario(replace(scenario, ground_truth=False))
    assert isinstance(estimated.estimator, StateEstimator)


def test_the_estimate_of_a_base_that_is_fixed_is_refused():
    with pytest.raises(ConfigurationError, match="fixed base"):
        stage_scenario(replace(load_scenario("reach_arm"), ground_truth=False))
