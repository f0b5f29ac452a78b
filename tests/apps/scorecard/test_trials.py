"""The table of trials: that its fields exist, and that amounts mean what they say."""

import math
from pathlib import Path

import numpy as np
import pytest

from poise.apps.campaigns import Job
from poise.apps.scenarios import read_scenario
from poise.apps.scorecard import TRIALS, Plan
from poise.apps.scorecard._plan import _SCENES
from poise.apps.scorecard._trials import Place

BY_NAME = {trial.name: trial for trial in TRIALS}


@pytest.fixture(scope="module")
def place():
    plan = Plan(robot="humanoid33", controller="whole_body")
    return Place(robot=plan.loaded, links=plan._links, control_dt=0.002, angle=math.pi / 2, seed=3)


@pytest.mark.parametrize("name", BY_NAME)
def test_a_trials_fields_exist_in_its_scene_at_both_ends_and_between(name, place):
    trial = BY_NAME[name]
    scene, where = read_scenario(_SCENES / f"{trial.scene}.yaml")
    for level in (0.0, 0.37, 1.0):
        values = trial.values(level, place)
        Job(number=0, scenario=scene, where=where, values=values).make()


def test_amounts_are_halved_by_their_difference_or_their_ratio():
    assert BY_NAME["push"].amount(0.5) == pytest.approx(0.8)
    assert BY_NAME["bandwidth"].amount(0.5) == pytest.approx(math.sqrt(200.0))
    for trial in TRIALS:
        assert trial.amount(0.0) == trial.easy
        assert trial.amount(1.0) == pytest.approx(trial.hard)


def test_a_slope_goes_down_in_its_direction(place):
    """The floor's normal leans to the left when it goes down there."""
    import pinocchio as pin

    slope = BY_NAME["slope"].values(0.5, place)["plant.floor_slope"]
    normal = pin.exp3(np.array([*slope, 0.0])) @ [0.0, 0.0, 1.0]
    assert normal[1] == pytest.approx(math.sin(0.16))
    assert abs(normal[0]) < 1e-12


def test_errors_of_the_model_differ_by_the_seed_and_keep_to_their_amount(place):
    from dataclasses import replace

    trial = BY_NAME["mass_error"]
    one, again, other = (
        trial.values(0.5, replace(place, seed=seed))["plant.link_errors"] for seed in (1, 1, 2)
    )
    assert one == again != other
    scales = [error["mass_scale"] for error in one]
    assert len(scales) > 20
    assert all(abs(scale - 1.0) <= trial.amount(0.5) for scale in scales)


def test_the_documentation_has_a_row_for_every_trial():
    page = (Path(__file__).parents[3] / "docs" / "scorecard.md").read_text(encoding="utf-8")
    rows = {line.split("`")[1]: line for line in page.splitlines() if line.startswith("| `")}
    for trial in TRIALS:
        if not trial.share:
            scale = 1000.0 if trial.unit == "m" and trial.hard <= 0.05 else 1.0
            ends = f"{trial.easy * scale:g} to {trial.hard * scale:g}"
            assert f"| {trial.scene} |" in rows[trial.name]
            assert ends in rows[trial.name], trial.name
