"""The table of trials: that its fields exist, and that amounts mean what they say."""

import math
from pathlib import Path

import numpy as np
import pytest
import yaml

from poise.apps.campaigns import Job
from poise.apps.scenarios import read_scenario
from poise.apps.scorecard import TRIALS, Plan
from poise.apps.scorecard._plan import _SCENES
from poise.apps.scorecard._trials import STEP_BEGIN, STEP_TIME, Place
from poise.locomotion import walking_stack

BY_NAME = {trial.name: trial for trial in TRIALS}


@pytest.fixture(scope="module")
def place():
    plan = Plan(robot="humanoid33", controller="whole_body")
    return Place(robot=plan.loaded, links=plan._links, control_dt=0.002, angle=math.pi / 2, seed=3)


def test_names_are_names_of_their_own():
    assert len(BY_NAME) == len(TRIALS)
    assert len({trial.title for trial in TRIALS}) == len(TRIALS)


@pytest.mark.parametrize("name", BY_NAME)
def test_a_trials_fields_exist_in_its_scene_at_both_ends_and_between(name, place):
    trial = BY_NAME[name]
    scene, where = read_scenario(_SCENES / f"{trial.scene}.yaml")
    for level in (0.0, 0.37, 1.0):
        values = trial.values(level, place)
        Job(number=0, scenario=scene, where=where, values=values).make()


def test_every_scene_is_of_some_trial():
    used = {trial.scene for trial in TRIALS} | {"stand_by_hand"}
    assert {path.stem for path in _SCENES.glob("*.yaml")} == used
    for name in used:
        assert yaml.safe_load((_SCENES / f"{name}.yaml").read_text())["name"] == name


def test_amounts_are_halved_by_their_difference_or_their_ratio():
    assert BY_NAME["push"].amount(0.5) == pytest.approx(0.8)
    assert BY_NAME["bandwidth"].amount(0.5) == pytest.approx(math.sqrt(200.0))
    for trial in TRIALS:
        assert trial.amount(0.0) == trial.easy
        assert trial.amount(1.0) == pytest.approx(trial.hard)


def test_pushes_go_where_their_direction_says(place):
    left = BY_NAME["push"].values(0.25, place)["pushes[0].velocity_change"]
    assert left == [0.0, pytest.approx(0.4), 0.0]


def test_a_slope_goes_down_in_its_direction(place):
    """The floor's normal leans to the left when it goes down there."""
    import pinocchio as pin

    slope = BY_NAME["slope"].values(0.5, place)["plant.floor_slope"]
    normal = pin.exp3(np.array([*slope, 0.0])) @ [0.0, 0.0, 1.0]
    assert normal[1] == pytest.approx(math.sin(0.16))
    assert abs(normal[0]) < 1e-12


def test_phases_are_those_of_the_walks_second_step(place):
    scene, where = read_scenario(_SCENES / "walk.yaml")
    walk = Job(number=0, scenario=scene, where=where).make()
    plan = walk.walker(place.robot, walking_stack(place.robot)).plan
    assert pytest.approx(plan.lift_off(1)) == STEP_BEGIN
    assert plan.lift_off(2) - plan.lift_off(1) == pytest.approx(STEP_TIME)
    assert [*place.robot.soles][plan.steps[1].foot] == "right_sole"


def test_bumps_are_as_high_as_said_and_the_walk_does_not_know_of_them(place):
    bumps = BY_NAME["bumps_walk"].values(1.0, place)["plant.blocks"]
    assert max(bump["size"][2] for bump in bumps) == pytest.approx(0.05)
    assert not any(bump["told"] for bump in bumps)


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


def test_a_delay_is_a_whole_number_of_control_periods(place):
    delay = BY_NAME["delay"].values(0.3, place)["plant.sensors.delay"]
    assert delay / 0.002 == pytest.approx(round(delay / 0.002))
    assert delay == pytest.approx(0.0384, abs=0.001)


def test_the_documentation_has_a_row_for_every_trial():
    page = (Path(__file__).parents[3] / "docs" / "scorecard.md").read_text(encoding="utf-8")
    rows = {line.split("`")[1]: line for line in page.splitlines() if line.startswith("| `")}
    for trial in TRIALS:
        if not trial.share:
            scale = 1000.0 if trial.unit == "m" and trial.hard <= 0.05 else 1.0
            ends = f"{trial.easy * scale:g} to {trial.hard * scale:g}"
            assert f"| {trial.scene} |" in rows[trial.name]
            assert ends in rows[trial.name], trial.name
