"""Plans, and cards made of episodes whose thresholds are known."""

from dataclasses import replace

import numpy as np
import pytest

from poise.apps.campaigns import CampaignFolder
from poise.apps.scorecard import FULL, QUICK, TRIALS, Plan, make_card, replay_job
from poise.apps.scorecard._run import median_of, share_of
from poise.errors import ConfigurationError, PoiseError, UnknownNameError

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


def test_ends_that_are_survived_or_not_are_said(hands, here, tmp_path):
    (best,) = make_card(hands, tmp_path / "a", here, function=always).trials
    assert (best.cases[0].median, best.cases[0].limit) == (best.hard, "at least")
    assert best.cases[0].episode is None
    (none,) = make_card(hands, tmp_path / "b", here, function=never).trials
    assert (none.cases[0].median, none.cases[0].limit) == (none.easy, "none")


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


@pytest.mark.parametrize(
    "change", [{"controller": "osf"}, {"extent": FULL}, {"robot": "humanoid33"}]
)
def test_the_folder_of_another_card_is_refused(hands, here, tmp_path, change):
    make_card(hands, tmp_path, here, function=known)
    with pytest.raises(ConfigurationError, match="another --out"):
        make_card(replace(hands, **change), tmp_path, here, function=known)


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


def test_the_median_of_ten_has_the_second_and_the_ninth():
    found = median_of([float(i) for i in range(1, 11)])
    assert (found.value, found.low, found.high) == (5.5, 2.0, 9.0)
    assert found.confidence == pytest.approx(1 - 2 * 11 / 1024)


def test_as_many_intervals_as_they_say_hold_the_median():
    rng = np.random.default_rng(1)
    found = [median_of(rng.lognormal(size=12).tolist()) for _ in range(2000)]
    held = np.mean([one.low <= 1.0 <= one.high for one in found])
    assert found[0].confidence >= 0.95
    assert held == pytest.approx(found[0].confidence, abs=0.015)


def test_a_share_has_wilsons_interval():
    found = share_of(8, 10)
    assert found.value == 0.8
    assert (found.low, found.high) == pytest.approx((0.4902, 0.9433), abs=1e-4)
    assert share_of(0, 8).low == 0.0
    assert share_of(8, 8).high == 1.0
    assert 0.5 < share_of(8, 8).low < 1.0
