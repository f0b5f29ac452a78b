"""Every sequence can be made by its name, and a few problems of each are shipped."""

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from benchmarks.hqp.problem_set import FLOATS, load_sequence
from benchmarks.hqp.problem_sources import SOURCES, make_sequence, sequence_names
from benchmarks.hqp.recorded import Window, record_window
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


def test_some_of_every_sequence_is_shipped_in_little_room(shipped):
    assert set(shipped) == set(sequence_names())
    assert all(len(sequence) == COUNT for sequence in shipped.values())
    assert sum(path.stat().st_size for path in SHIPPED.iterdir()) < LARGEST


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


def test_a_window_begins_with_a_contact_phase_and_ends_with_it(tmp_path):
    path = tmp_path / "foot_up.yaml"
    path.write_text(FOOT_UP)
    window = Window(scenario=str(path), robot="biped20", at=0.005, begins=1)
    problems = list(record_window(window, 100))
    assert 5 < len(problems) < 40
    assert {p.shape for p in problems} == {problems[0].shape}
    assert problems[0].n == 26 + 6  # one foot
    assert len({p.lower.tobytes() for p in problems}) == len(problems)
