"""Tuning: better than it began, the same again with its seed, interrupted or not."""

import sys

import episodes
import pytest

pytest.importorskip("mujoco")
pytest.importorskip("pyarrow")
pytest.importorskip("optuna")

from poise.apps.campaigns import (
    CampaignFolder,
    Design,
    Runner,
    ThisProcess,
    _tune,
    best_trial,
)
from poise.apps.campaigns._tune import cost, tune
from poise.errors import MissingExtraError

CAMPAIGN = {
    "name": "valley",
    "scenario": "tiny",
    "seed": 5,
    "vary": {"plant.friction": {"uniform": [0.5, 1.0]}},
    "tune": {
        "figure": "com_error_max_m",
        "failure": 100.0,
        "trials": 24,
        "episodes": 2,
        "batch": 3,
        "start": {"plant.mass_scale": 9.0},
        "fields": {
            "plant.mass_scale": {"log_uniform": [0.1, 10.0]},
            "plant.floor_slope": {"choice": [[0.0, 0.0], [0.1, 0.0]]},
        },
    },
}


def valley(job):
    """A figure that is least at a mass scale of 2 on level ground."""
    scale, slope = job.values["plant.mass_scale"], job.values["plant.floor_slope"]
    value = (scale - 2.0) ** 2 + 10.0 * slope[0] + 0.01 * job.values["plant.friction"]
    outcome = "fell" if scale > 8.0 else "ok"
    return episodes.row(job) | {"com_error_max_m": value, "outcome": outcome, **job.labels}


class StoppedError(Exception):
    pass


def tuned(path, stop_after=sys.maxsize, **changes):
    """Rows of a tuning, which an exception ends after so many episodes."""
    content = CAMPAIGN | {"tune": CAMPAIGN["tune"] | changes}
    design, folder = Design(content, episodes.TINY, "valley.yaml"), CampaignFolder(path)
    left = iter(range(stop_after))

    def function(job):
        if next(left, None) is None:
            raise StoppedError
        return valley(job)

    with folder.claimed(design.to_json()):
        runner = Runner(ThisProcess(), folder, function=function, prepare=None)
        return design, tune(design, design.campaign.tune, runner.run, folder.path)


def values(rows):
    return [(row["number"], row["com_error_max_m"]) for row in rows]


@pytest.fixture
def unplotted(monkeypatch):
    """Plots take longer than all else here."""
    monkeypatch.setattr(_tune, "_draw", lambda study, folder: None)


def test_tuning_betters_a_bad_start_and_says_the_best(tmp_path):
    design, rows = tuned(tmp_path)
    plan = design.campaign.tune
    assert [row["number"] for row in rows] == list(range(48))
    assert [row["trial"] for row in rows] == [n // 2 for n in range(48)]
    assert cost(rows[:2], plan) == 100.0
    best = best_trial(design.campaign, plan, tmp_path)
    assert best["com_error_max_m"] < 0.1
    assert best["fields"]["plant.floor_slope"] == [0.0, 0.0]
    assert best["fields"]["plant.mass_scale"] == pytest.approx(2.0, abs=0.4)
    own = rows[2 * best["trial"] : 2 * best["trial"] + 2]
    assert cost(own, plan) == best["com_error_max_m"]
    for name in ("history", "slices", "importances"):
        assert (tmp_path / f"tuning-{name}.svg").read_text().count("<path") > 5


@pytest.mark.usefixtures("unplotted")
def test_the_seed_makes_it_the_same_and_another_seed_does_not(tmp_path, monkeypatch):
    _, one = tuned(tmp_path / "a", trials=9)
    _, same = tuned(tmp_path / "b", trials=9)
    monkeypatch.setitem(CAMPAIGN, "seed", 6)
    _, other = tuned(tmp_path / "c", trials=9)
    assert values(one) == values(same)
    assert values(one)[2:] != values(other)[2:]


@pytest.mark.usefixtures("unplotted")
def test_an_interrupted_tuning_goes_on_as_if_it_had_not_been(tmp_path):
    _, whole = tuned(tmp_path / "a", trials=9)
    for stop in (0, 1, 6, 7):
        with pytest.raises(StoppedError):
            tuned(tmp_path / "b", stop_after=stop, trials=9)
    _, again = tuned(tmp_path / "b", trials=9)
    assert values(again) == values(whole)


def test_without_optuna_the_command_that_installs_it_is_said(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "optuna", None)
    with pytest.raises(MissingExtraError, match=r'pip install "poise\[campaign\]"'):
        tuned(tmp_path)
