"""Campaigns beside the studies: each can be loaded, and an episode of it runs to a verdict."""

from dataclasses import replace

import pytest

pytest.importorskip("mujoco")

from poise.apps.campaigns import Design, run_episode
from poise.errors import UnknownNameError
from studies.staged import CAMPAIGNS, episode, run_staged

FILES = sorted(p for p in CAMPAIGNS.glob("*.yaml") if "scenario:" in p.read_text(encoding="utf-8"))


def design(name):
    return Design.load(CAMPAIGNS / f"{name}.yaml")


def short(job, seconds):
    """The episode without what happens later, and without checks of its end."""
    changes = {"duration": seconds, "checks": []}
    changes["pushes"] = [push for push in job.scenario.get("pushes", []) if push["at"] < seconds]
    if "drive" in job.scenario:
        changes["drive.velocities"] = job.scenario["drive"]["velocities"][:1]
    values = {
        p: v for p, v in job.values.items() if not p.startswith(("pushes", "drive", "checks"))
    }
    return replace(job, values={**values, **changes})


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_campaign_can_be_loaded_and_every_scenario_of_it_made(path):
    plan = Design.load(path)
    cases = len(plan.campaign.cases)
    assert plan.count % max(cases, 1) == 0
    jobs = [plan.job(number) for number in range(min(plan.count, 60))]
    assert all(job.make().duration >= 4.0 for job in jobs)
    assert {job.labels["case"] for job in jobs if cases} == {*plan.campaign.cases}


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_an_episode_runs_and_the_robot_stands_its_first_second(path):
    row = run_episode(short(Design.load(path).job(0), 1.1))
    assert row["outcome"] == "ok", row["reason"]
    assert row["simulated_s"] == pytest.approx(1.1, abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(("speed", "fell"), [(0.33, False), (0.7, True)])
def test_a_push_that_the_feet_hold_is_survived_and_twice_as_much_is_not(speed, fell):
    job = design("standing_pushes").job(0)
    push = {"pushes[0].velocity_change": [-speed, 0.0, 0.0]}
    assert (run_episode(replace(job, values=push))["outcome"] == "fell") is fell


@pytest.mark.slow
@pytest.mark.parametrize("cut", [0.55, 1.6])
def test_a_connection_that_is_cut_leaves_the_robot_at_rest_on_both_feet(cut):
    row = run_episode(
        replace(design("cuts").job(0), values={"robot": "biped20", "devices.cut": cut})
    )
    assert row["outcome"] == "ok", row["reason"]
    assert row["feet_lifted"] == (cut > 1.0)


def test_an_episode_of_a_study_is_that_of_the_campaign_with_its_own_seed_and_length():
    made = episode("bad_operators", "all of them", "talos", 3, 10.0, {"plant.friction": 0.4})
    assert (made.robot, made.seed, made.duration) == ("talos", 3, 10.0)
    assert (made.terrain, made.plant.friction) == ("bumps", 0.4)
    assert [push.at < 10.0 for push in made.pushes] == [True, True]
    with pytest.raises(UnknownNameError, match="as described"):
        episode("bad_operators", "as drawn", "g1", 0, 1.0)


def test_a_fault_stands_between_the_sensors_and_the_estimator():
    seen = []

    def fault(state):
        seen.append(state.time)
        return replace(state, contacts={})

    scenario = episode("ground", "flat ground", "humanoid33", 0, 1.2)
    outcome = run_staged(scenario, fault=fault)
    assert (len(seen), outcome.fell) == (600, False)
    assert outcome.seconds == pytest.approx(1.2, abs=0.01)
