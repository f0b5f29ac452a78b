"""The study of campaigns, as short as it can be: what it counts, and that it counts right."""

from importlib import import_module

import pytest

pytest.importorskip("mujoco")
pytest.importorskip("matplotlib")
pytest.importorskip("distributed")
pytest.importorskip("optuna")

from studies.campaigns.campaign_files import recorded, without_times
from studies.plan import StudyOptions

# The package has functions by the names of these modules.
interruption = import_module("studies.campaigns.interruption_section")
tuning = import_module("studies.campaigns.tuning_section")

QUICK = StudyOptions(quick=True)


@pytest.mark.slow
def test_an_interrupted_campaign_has_the_results_of_one_in_peace(monkeypatch):
    monkeypatch.setattr(interruption, "_QUICK_EPISODES", 6)
    seen = []
    section = interruption.interruption_section(QUICK, lambda done, of: seen.append((done, of)))
    assert [finding.ours for finding in section.findings] == [6, 0, 0]
    assert all(finding.ok for finding in section.findings)
    assert seen[0] == (0.0, 12.0)
    assert max(seen)[0] <= 12.0


def test_a_trial_is_worth_the_mean_of_its_episodes_and_falls_count():
    rows = [
        {"trial": 0, "outcome": "ok", "sway": 0.1},
        {"trial": 0, "outcome": "failed", "sway": 0.3},
        {"trial": 1, "outcome": "fell", "sway": 0.0},
        {"trial": 1, "outcome": "crashed"},
    ]
    assert tuning._worth(rows) == pytest.approx([0.2, tuning._FAILURE])


def test_rows_are_compared_without_times():
    rows = [{"number": 0, "sway": 1.0, "seconds": 2.0, "ended": "now"}]
    assert without_times(rows) == [{"number": 0, "sway": 1.0}]


def test_a_folder_without_results_has_none(tmp_path):
    assert recorded(tmp_path) == []
