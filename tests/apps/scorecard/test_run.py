"""Plans, and cards made of episodes whose thresholds are known."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from poise import robots
from poise.apps.campaigns import CampaignFolder
from poise.apps.scorecard import FULL, QUICK, TRIALS, Plan, make_card, replay_job
from poise.errors import ConfigurationError, PoiseError, UnknownNameError
from poise.robots import load_robot

LEGS = {"robot": "biped20", "extent": QUICK}


def threshold(job):
    """What a stand-in survives: it depends on the seed alone."""
    return 0.3 + 0.1 * job.seed


def row(job, survived):
    return {
        "number": job.number,
        "seed": job.seed,
        "version": job.version,
        "ended": "2026-11-22T12:00:00.000+00:00",
        "values": "{}",
        "outcome": "ok" if survived else "fell",
        "survived": survived,
        "mechanism": "" if survived else f"fell at level {job.labels['level']:g}",
        **job.labels,
    }


def known(job):
    return row(job, job.labels["level"] <= threshold(job))


def always(job):
    return row(job, True)


def never(job):
    return row(job, False)


def even(job):
    return row(job, job.seed % 2 == 0)


def refused(job):
    plain = row(job, False)
    return {**plain, "survived": None, "mechanism": None, "reason": "no place for a foot"}


@pytest.fixture
def hands():
    """A plan of one trial without directions."""
    return Plan(controller="whole_body", trials=("payload_torso",), **LEGS)


def test_known_thresholds_are_found_seed_by_seed(hands, here, tmp_path):
    told = []
    card = make_card(hands, tmp_path, here, lambda *at: told.append(at), function=known)
    (trial,) = card.trials
    (case,) = trial.cases
    assert [s.amount for s in case.seeds] == pytest.approx([0.3, 0.4, 0.5], abs=1 / 16)
    assert case.median == case.seeds[1].amount
    assert (case.low, case.high) == (case.seeds[0].amount, case.seeds[2].amount)
    assert case.confidence == 0.75
    assert case.limit == ""
    # The first seed's five looks, and at least two of each other's.
    assert told[0] == (0.0, 9.0)
    assert told[-1] == (here.calls, here.calls)
    assert [done for done, _ in told] == sorted(done for done, _ in told)
    # The failed episode that is told of is the nearest to what was survived.
    assert case.mechanism == "fell at level 0.3125"
    assert CampaignFolder(tmp_path).rows[case.episode]["level"] == 0.3125


def test_seeds_that_are_alike_only_confirm_the_first_ones_edge(hands, here, tmp_path):
    def alike(job):
        return row(job, job.labels["level"] <= 0.3)

    (trial,) = make_card(hands, tmp_path, here, function=alike).trials
    assert here.calls == 5 + 2 + 2
    assert {s.amount for s in trial.cases[0].seeds} == {0.28125}


def test_what_is_compiled_for_is_the_easy_end(here, tmp_path):
    make_card(Plan(controller="osf", trials=("speed",), **LEGS), tmp_path, here, function=known)
    assert here.warmed == [{"walk.strides[0].length": pytest.approx(0.04)}]


def test_ends_that_are_survived_or_not_are_said(hands, here, tmp_path):
    (best,) = make_card(hands, tmp_path / "a", here, function=always).trials
    assert (best.cases[0].median, best.cases[0].limit) == (best.hard, "at least")
    assert best.cases[0].episode is None
    (none,) = make_card(hands, tmp_path / "b", here, function=never).trials
    assert (none.cases[0].median, none.cases[0].limit) == (none.easy, "none")


def test_an_episode_that_is_refused_is_not_survived_and_says_why(hands, here, tmp_path):
    (trial,) = make_card(hands, tmp_path, here, function=refused).trials
    assert trial.cases[0].limit == "none"
    assert trial.cases[0].mechanism == "no place for a foot"


def test_a_trial_that_counts_seeds_runs_each_once(here, tmp_path):
    plan = Plan(controller="step_teleoperation", trials=("bad_operator",), **LEGS)
    (trial,) = make_card(plan, tmp_path, here, function=even).trials
    assert here.calls == QUICK.operators
    assert trial.cases[0].median == 0.5
    assert trial.cases[0].low < 0.25 < 0.75 < trial.cases[0].high


def test_an_interrupted_card_goes_on_and_is_the_same(here, tmp_path):
    plan = Plan(controller="whole_body", trials=("slope",), **LEGS)
    whole = make_card(plan, tmp_path / "whole", here, function=known)
    looks = here.calls
    assert looks % 4 == 0
    assert looks > 4 * (5 + 2 + 2)

    def interrupted(job):
        if here.calls == 25:
            raise KeyboardInterrupt
        return known(job)

    here.calls = 0
    with pytest.raises(KeyboardInterrupt):
        make_card(plan, tmp_path / "half", here, function=interrupted)
    here.calls = 0
    assert make_card(plan, tmp_path / "half", here, function=known) == whole
    assert here.calls == looks - 24
    here.calls = 0
    make_card(plan, tmp_path / "half", here, function=known)
    assert here.calls == 0


def test_another_run_may_add_trials(hands, here, tmp_path):
    make_card(hands, tmp_path, here, function=known)
    more = replace(hands, trials=("payload_torso", "delay"))
    looks, here.calls = here.calls, 0
    card = make_card(more, tmp_path, here, function=known)
    assert [trial.name for trial in card.trials] == ["payload_torso", "delay"]
    assert here.calls == looks
    told = []
    other = replace(hands, trials=("speed",))
    make_card(other, tmp_path, here, lambda *at: told.append(at), function=known)
    assert (told[0], told[-1]) == ((0.0, 9.0), (looks, looks))
    assert here.warmed == [{"walk.strides[0].length": pytest.approx(0.04)}]


@pytest.mark.parametrize(
    "change", [{"controller": "osf"}, {"extent": FULL}, {"robot": "humanoid33"}]
)
def test_the_folder_of_another_card_is_refused(hands, here, tmp_path, change):
    make_card(hands, tmp_path, here, function=known)
    with pytest.raises(ConfigurationError, match="another --out"):
        make_card(replace(hands, **change), tmp_path, here, function=known)


def test_the_folder_of_a_robot_whose_files_have_changed_is_refused(hands, here, tmp_path):
    model, facts = tmp_path / "legs.urdf", tmp_path / "legs.poise.yaml"
    model.write_text(load_robot("biped20").source.text)
    shipped = Path(robots.__file__).parent / "descriptions" / "biped20.yaml"
    told = yaml.safe_load(shipped.read_text())
    del told["catalog"]
    facts.write_text(yaml.safe_dump(told))
    plan = replace(hands, robot=str(model))
    make_card(plan, tmp_path / "card", here, function=known)
    model.write_text(model.read_text().replace('<mass value="', '<mass value="1'))
    with pytest.raises(ConfigurationError, match=r"another robot: '.*/legs.urdf' differs"):
        make_card(replace(plan), tmp_path / "card", here, function=known)


@pytest.mark.slow
def test_trials_that_cannot_be_made_are_left_out_and_say_why(here, tmp_path):
    names = ("push", "bandwidth", "speed", "latency")
    plan = Plan(controller="step_teleoperation", trials=names, **LEGS)
    cases, left_out = plan.cases()
    assert {case.trial.name for case in cases} == {"push", "latency"}
    assert "velocity actuation" in left_out["bandwidth"]
    assert "cannot follow the walk" in left_out["speed"]
    cases, left_out = replace(plan, controller="whole_body").cases()
    assert {case.trial.name for case in cases} == {"push", "bandwidth", "speed"}
    assert "does not heed the devices" in left_out["latency"]


def test_every_episode_has_a_number_of_its_own_whatever_else_is_tried():
    plan = Plan(controller="whole_body", robot="biped20", extent=FULL)
    numbers = {
        (case.trial.name, case.index, seed, look): plan.job(case, seed, look, 0.0).number
        for trial in TRIALS
        if not trial.share and "hand" not in trial.name
        for case in (plan.spread(trial)[0], plan.spread(trial)[-1])
        for seed in (0, 9)
        for look in (0, 7)
    }
    assert len(set(numbers.values())) == len(numbers)
    alone = replace(plan, trials=("delay",))
    delay = next(trial for trial in TRIALS if trial.name == "delay")
    assert alone.job(alone.spread(delay)[0], 9, 7, 0.0).number == numbers["delay", 0, 9, 7]


def test_directions_and_phases_are_those_of_the_extent():
    plan = Plan(controller="whole_body", robot="biped20", extent=FULL)
    walk = plan.spread(next(trial for trial in TRIALS if trial.name == "push_walk"))
    assert len(walk) == 12 * 5
    assert len({(case.angle, case.phase) for case in walk}) == 60
    assert np.isclose(walk[1].angle, np.pi / 6)


@pytest.mark.parametrize(
    ("changes", "kind", "words"),
    [
        ({"robot": "nobody"}, PoiseError, "nobody"),
        ({"controller": "pid"}, UnknownNameError, "choices: .*whole_body"),
        ({"trials": ("psuh",)}, UnknownNameError, "no such trial; got 'psuh'; choices: push"),
        ({"robot": "arm6"}, ConfigurationError, "two feet"),
    ],
)
def test_names_that_are_none_are_refused_at_once(changes, kind, words):
    with pytest.raises(kind, match=words):
        Plan(**({"controller": "whole_body"} | LEGS | changes))


def test_a_strategy_that_the_controller_has_not_leaves_everything_out(here, tmp_path):
    plan = Plan(controller="osf", strategy="magic", trials=("push",), **LEGS)
    cases, left_out = plan.cases()
    assert cases == []
    assert "no such strategy" in left_out["push"]


def test_an_episode_can_be_made_again_from_the_folder(here, tmp_path):
    plan, jobs = Plan(controller="osf", trials=("slope",), **LEGS), {}

    def noted(job):
        jobs[job.number] = job
        return known(job)

    make_card(plan, tmp_path, here, function=noted)
    number = sorted(jobs)[7]
    assert replay_job(CampaignFolder(tmp_path), number) == jobs[number]
    with pytest.raises(ConfigurationError, match="this episode has no result; got 5"):
        replay_job(CampaignFolder(tmp_path), 5)


def test_the_folder_of_a_campaign_has_no_card(tmp_path):
    folder = CampaignFolder(tmp_path)
    with folder.claimed({"campaign": {"name": "gains"}, "scenario": {}}):
        pass
    with pytest.raises(ConfigurationError, match="no scorecard in this folder"):
        replay_job(folder, 0)
