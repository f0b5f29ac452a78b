"""Campaigns beside the studies: each can be loaded, and an episode of it runs to a verdict."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("mujoco")

from poise.apps.campaigns import Design, run_episode
from poise.errors import UnknownNameError
from studies.staged import CAMPAIGNS, episode, random_velocities, run_staged

FILES = sorted(p for p in CAMPAIGNS.glob("*.yaml") if "scenario:" in p.read_text(encoding="utf-8"))


def design(name):
    return Design.load(CAMPAIGNS / f"{name}.yaml")


def jobs_of(plan, case):
    return [job for job in plan.jobs() if job.labels["case"] == case]


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


def test_conditions_of_bad_operators_change_what_they_say():
    plan = design("bad_operators")
    made = {case: jobs_of(plan, case)[0].make() for case in plan.campaign.cases}
    described = made.pop("as described").plant
    tilt = np.linalg.norm(described.sensors.base_orientation_error)
    assert np.rad2deg(tilt) == pytest.approx(0.5, abs=1e-3)
    sensors = made["sensors off by a constant"].plant.sensors
    assert np.rad2deg(np.linalg.norm(sensors.base_orientation_error)) == pytest.approx(
        1.0, abs=1e-3
    )
    assert np.rad2deg(sensors.joint_position_bias) == pytest.approx(0.3, abs=1e-3)
    for case in ("slope of 3 degrees", "all of them"):
        slope = np.linalg.norm(made[case].plant.floor_slope)
        assert np.rad2deg(slope) == pytest.approx(3.0, abs=1e-3)
    mixed = made["all of them"]
    assert (mixed.terrain, mixed.plant.friction, mixed.plant.self_contact) == ("bumps", 0.5, True)
    assert mixed.plant.sensors.delay == 0.01
    assert {j.make().plant.mass_scale for j in jobs_of(plan, "mass 10% off")} <= {0.9, 1.1}
    for case in ("pushes of 0.2 m/s", "all of them"):
        speeds = [np.linalg.norm(push.velocity_change) for push in made[case].pushes]
        assert speeds == pytest.approx([0.2] * 11, abs=1e-3)
        assert len({push.velocity_change for push in made[case].pushes}) > 3
    assert not made["friction 0.5"].pushes


def test_seeds_of_a_case_draw_other_directions_and_robots_take_turns():
    plan = design("bad_operators")
    drawn = [plan.job(30 * k).make() for k in range(12)]
    assert len({s.plant.sensors.base_orientation_error for s in drawn}) > 3
    assert len({s.seed for s in drawn}) == 12
    assert [plan.job(k).values["robot"] for k in range(3)] == ["biped20", "humanoid33", "g1"]


def test_every_other_plant_is_another_one_and_the_last_all_of_them():
    plan = design("other_plants")
    *single, every = (dict(draws) for draws in plan.campaign.cases.values())
    assert every == {path: draw for case in single for path, draw in case.items()}


def test_edges_of_the_ground_meet_feet_anywhere_and_tiles_are_of_any_height():
    plan = design("ground")
    paces = {job.values["drive.velocities[0].velocity[0]"] for job in jobs_of(plan, "flat ground")}
    assert len(paces) == 40
    tiles = jobs_of(plan, "tiles")[0].make().plant.blocks
    assert len({block.size[2] for block in tiles}) == len(tiles) > 100
    assert all(not block.told and 0.001 <= block.size[2] <= 0.02 for block in tiles)
    wandering = jobs_of(plan, "wandering")[0].make().drive.velocities
    assert len({command.velocity for command in wandering}) == len(wandering) == 23


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


def test_random_velocities_rest_now_and_then_within_their_bounds():
    found = random_velocities(5, 600.0)
    velocities = np.array([one["velocity"] for one in found])
    assert np.abs(velocities).max(axis=0) == pytest.approx([0.6, 0.25, 0.6], abs=0.02)
    assert 0.1 < np.mean(~velocities.any(axis=1)) < 0.3
    gaps = np.diff([one["at"] for one in found])
    assert 1.0 <= gaps.min() <= gaps.max() <= 4.0


def test_a_fault_stands_between_the_sensors_and_the_estimator():
    seen = []

    def fault(state):
        seen.append(state.time)
        return replace(state, contacts={})

    scenario = episode("ground", "flat ground", "humanoid33", 0, 1.2)
    outcome = run_staged(scenario, fault=fault)
    assert (len(seen), outcome.fell) == (600, False)
    assert outcome.seconds == pytest.approx(1.2, abs=0.01)
