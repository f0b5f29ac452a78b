"""Every sequence can be made by its name, and a few problems of each are shipped."""

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from benchmarks.hqp.problem_set import FAMILIES, FLOATS, load_sequence, save_sequence
from benchmarks.hqp.problem_sources import SOURCES, make_sequence, save_all, sequence_names
from benchmarks.hqp.recorded import Window, record_window
from poise.errors import ConfigurationError, UnknownNameError
from poise.hqp import LexicographicSolver

SHIPPED = Path(__file__).parents[3] / "problems"
LARGEST = 3_000_000
COUNT = 3
FOOT_UP = """
name: foot_up
duration: 1.0
robot: biped20
stack:
  contacts:
    - surface: {frame: left_sole}
    - surface: {frame: right_sole}
  levels:
    - - com: {kp: 40}
    - - posture
contacts:
  - {unload: left_sole, at: 0.01, over: 0.01}
  - {load: left_sole, at: 0.03, over: 0.01}
"""


@pytest.fixture(scope="module")
def shipped():
    return {path.stem: load_sequence(path) for path in sorted(SHIPPED.glob("*.npz"))}


def assert_same(one, other):
    assert len(one) == len(other)
    for a, b in zip(one.problems, other.problems, strict=True):
        for key in FLOATS:
            assert getattr(a, key).tobytes() == getattr(b, key).tobytes(), key


def test_names_differ_and_every_family_has_some():
    assert len(set(sequence_names())) == len(sequence_names()) == len(SOURCES)
    assert {source.family for source in SOURCES.values()} == set(FAMILIES)


def test_the_documentation_names_every_family_of_names():
    text = (SHIPPED.parent / "docs" / "problem_set.md").read_text(encoding="utf-8")
    for name in sequence_names():
        stem = name.rsplit("-", 1)[0]
        assert stem in text or stem.split("-")[0] + "-" in text, name


def test_some_of_every_sequence_is_shipped_in_little_room(shipped):
    assert set(shipped) == set(sequence_names())
    assert all(len(sequence) == COUNT for sequence in shipped.values())
    assert sum(path.stat().st_size for path in SHIPPED.iterdir()) < LARGEST


def test_what_is_shipped_says_what_its_source_says(shipped):
    for name, sequence in shipped.items():
        source = SOURCES[name]
        assert (sequence.name, sequence.family) == (source.name, source.family)
        assert (sequence.description, sequence.consecutive) == (
            source.description,
            source.consecutive,
        )


def test_what_is_shipped_is_what_is_made_now(shipped):
    for name in ("ik-planar-5", "random-drift-one", "random-contradiction"):
        made = make_sequence(name, COUNT)
        for one, other in zip(shipped[name].problems, made.problems, strict=True):
            for key in FLOATS:
                # Another machine's factorisations round in another way.
                np.testing.assert_allclose(getattr(one, key), getattr(other, key), atol=1e-9)


def test_the_solver_finds_all_that_is_shipped(shipped):
    found = Counter[str]()
    for sequence in shipped.values():
        solver = LexicographicSolver()
        for problem in sequence.problems:
            if not sequence.consecutive:
                solver.reset()
            found[solver.solve(problem).status.value] += 1
    assert found == {"optimal": COUNT * len(SOURCES)}


def test_recorded_problems_move_from_tick_to_tick(shipped):
    for name, sequence in shipped.items():
        if sequence.consecutive:
            one, other = sequence.problems[:2]
            assert not np.array_equal(one.lower, other.lower), name


def test_reaching_beyond_and_being_pushed_make_more_than_the_posture_give_way(shipped):
    for name in ("reach-beyond-humanoid33", "push-humanoid33", "walk-pushed-landing-humanoid33"):
        sequence = shipped[name]
        last = len(sequence.problems[0].levels) - (1 if name.startswith("reach") else 2)
        solution = LexicographicSolver().solve(sequence.problems[-1])
        assert solution.relative_residuals[last] > 0.01, name


def test_a_recording_is_the_same_twice_and_tells_its_progress(tmp_path):
    told = []
    one = make_sequence("stand-humanoid33", 2, lambda done, total: told.append((done, total)))
    other = make_sequence("stand-humanoid33", 3)
    assert [view.name for view in one.problems[0].levels][:2] == ["dynamics", "contacts"]
    assert_same(one, load_sequence(save_sequence(one, tmp_path)))
    for a, b in zip(one.problems, other.problems, strict=False):
        assert a.A.tobytes() == b.A.tobytes()
        assert a.lower.tobytes() == b.lower.tobytes()
    assert told
    assert all(0 < done <= total for done, total in told)


def test_a_window_begins_with_a_contact_phase_and_ends_with_it(tmp_path):
    path = tmp_path / "foot_up.yaml"
    path.write_text(FOOT_UP)
    window = Window(scenario=str(path), robot="biped20", at=0.005, begins=1)
    problems = list(record_window(window, 100))
    assert 5 < len(problems) < 40
    assert {p.shape for p in problems} == {problems[0].shape}
    assert problems[0].n == 26 + 6  # one foot
    assert len({p.lower.tobytes() for p in problems}) == len(problems)


def test_an_unknown_sequence_is_refused():
    with pytest.raises(UnknownNameError, match="choices: .*random-rank"):
        make_sequence("random-ranks", 1)


def test_a_sequence_of_nothing_is_refused():
    with pytest.raises(ConfigurationError, match="wanted count >= 1"):
        make_sequence("random-rank", 0)


def test_all_sequences_are_saved_one_after_the_other(tmp_path, monkeypatch):
    few = {name: SOURCES[name] for name in ("ik-planar-3", "random-rank")}
    monkeypatch.setattr("benchmarks.hqp.problem_sources.SOURCES", few)
    told = []
    paths = save_all(tmp_path, 2, lambda done, total: told.append((done, total)))
    assert [path.name for path in paths] == ["ik-planar-3.npz", "random-rank.npz"]
    assert all(len(load_sequence(path)) == 2 for path in paths)
    assert told == [(1, 2), (2, 2)]
