"""The ablation study: its switches, its design, its file of rows, and its fit."""

from dataclasses import replace
from pkgutil import resolve_name

import numpy as np
import pytest

pytest.importorskip("mujoco")

from studies.ablation.effects_section import effects_section
from studies.ablation.logistic import RIDGE, fit_logistic
from studies.ablation.mechanisms import BY_NAME, MECHANISMS, without
from studies.ablation.runs import (
    OFF,
    TELEOPERATION,
    WALKING,
    AblationOutcome,
    Rows,
    draw,
    pushed,
    run,
)
from studies.plan import StudyOptions


@pytest.mark.parametrize("name", BY_NAME)
def test_a_switch_changes_what_it_names_and_puts_it_back(name):
    before = {path: resolve_name(path) for path in BY_NAME[name].off}
    with without([name]):
        for path, value in BY_NAME[name].off.items():
            assert resolve_name(path) is value
            assert resolve_name(path) != before[path]
    assert {path: resolve_name(path) for path in before} == before


def test_a_seed_decides_a_run_and_switches_are_independent():
    trials = [draw(seed) for seed in range(4000)]
    assert draw(7) == trials[7]
    switched = np.array([[m.name in t.off for m in MECHANISMS] for t in trials], float)
    feet = np.array([t.leader == TELEOPERATION for t in trials])
    assert switched[feet].mean(axis=0) == pytest.approx(OFF, abs=0.03)
    correlation = np.corrcoef(switched[feet].T) - np.eye(len(MECHANISMS))
    assert np.abs(correlation).max() < 0.08
    walked = switched[~feet].any(axis=0)
    assert walked.tolist() == [m.walks for m in MECHANISMS]


def test_pushes_are_as_large_as_it_takes_to_make_a_fifth_of_the_runs_fall():
    rng, made = np.random.default_rng(1), list[AblationOutcome]()
    for _ in range(400):
        trial = pushed(draw(3), made)
        fell = bool(rng.random() < 1.0 / (1.0 + np.exp(-6.0 * np.log(trial.push / 0.6))))
        made.append(replace(outcome(3, fell=fell), trial=trial))
    assert np.mean([o.fell for o in made[100:]]) == pytest.approx(0.2, abs=0.04)
    other = next(s for s in range(100) if draw(s).condition != draw(3).condition)
    assert pushed(draw(other), made) == draw(other)


def outcome(seed, *, fell=False, off=(), leader=TELEOPERATION):
    trial = replace(draw(seed), off=off, leader=leader)
    return AblationOutcome(
        trial=trial, fell=fell, time=12.5, torque_steps=seed % 3, trace=0.1 + seed
    )


def test_the_fit_meets_its_optimality_condition_and_finds_known_effects():
    rng = np.random.default_rng(3)
    design = np.column_stack([rng.random((20000, 2)) < 0.25, np.ones(20000)]).astype(float)
    truth = np.array([0.8, 0.0, -1.5])
    fell = (rng.random(20000) < 1.0 / (1.0 + np.exp(-design @ truth))).astype(float)
    fit = fit_logistic(design, fell)
    p = 1.0 / (1.0 + np.exp(-design @ fit.coefficients))
    assert design.T @ (fell - p) - RIDGE * fit.coefficients == pytest.approx(0.0, abs=1e-6)
    for column, value in enumerate(truth):
        found = fit.log_odds(column)
        assert found.low < value < found.high
        assert found.high - found.low < 0.2
    change = fit.change(0)
    assert change.value == pytest.approx(
        fell[design[:, 0] > 0].mean() - fell[design[:, 0] == 0].mean(), abs=0.01
    )
    assert change.low < change.value < change.high


def test_the_section_tells_a_mechanism_that_prevents_falls_from_one_that_does_nothing(tmp_path):
    rng, rows = np.random.default_rng(0), Rows(tmp_path / "rows.jsonl")
    for seed in range(300):
        off = tuple(n for n in ("knees", "narrow sole") if rng.random() < 0.25)
        fell = bool(rng.random() < (0.6 if "knees" in off else 0.15))
        rows.append(outcome(seed, fell=fell, off=off))
        rows.append(outcome(seed, fell=seed % 5 == 0, leader=WALKING))
    rows.append(replace(outcome(300), error="ValueError: no"))
    section = effects_section(StudyOptions(rows=rows.path), lambda *_: None)
    table = {row[0]: row for row in section.tables[0].rows}
    assert set(table) == {"knees", "narrow sole"}
    assert table["knees"][-1] == "prevents falls"
    assert table["knees"][8] > 25.0
    assert table["narrow sole"][6] < 0.0 < table["narrow sole"][7]
    rates = {f.name: f.ours for f in section.findings}
    assert rates["walking: runs that end with a fall"] == pytest.approx(20.0)


@pytest.mark.parametrize(
    ("leader", "seconds", "name"),
    [
        (TELEOPERATION, 0.2, "TrunkFeedback"),
        pytest.param(WALKING, 4.0, "LoadCellTare", marks=pytest.mark.slow),
    ],
)
def test_a_run_without_a_mechanism_is_another_one_and_the_same_again(leader, seconds, name):
    seed = next(s for s in range(100) if draw(s).leader == leader)
    trial = replace(draw(seed, seconds), robot="g1", off=())
    whole, again = run(trial), run(trial)
    assert whole == again
    assert not whole.error
    assert whole.acts[name] > 0
    other = run(replace(trial, off=(name,)))
    assert other.trace != whole.trace
    assert set(whole.acts) - set(other.acts) == {name}
