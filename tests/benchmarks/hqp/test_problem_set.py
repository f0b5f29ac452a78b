"""Files of problems: exact, readable with NumPy alone, and clear about what is wrong with them."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.hqp.problem_set import (
    FLOATS,
    ProblemSequence,
    copy_problem,
    load_sequence,
    save_sequence,
)
from poise.errors import ProblemError
from poise.hqp import HierarchicalProblem, Level

PROBLEMS = Path(__file__).parents[3] / "problems"


def make_problem(seed, rows=(3, 0, 4), n=5):
    """Bounds of all kinds, an empty level, weights, labels, a minus zero."""
    rng = np.random.default_rng(seed)
    levels = []
    for i, m in enumerate(rows):
        centre = rng.standard_normal(m)
        lower, upper = centre - rng.integers(0, 2, m), centre + rng.integers(0, 2, m)
        lower[:1] = -np.inf
        weights = 10.0 ** rng.uniform(-2, 2, m)
        A = rng.standard_normal((m, n))
        A[:1, :1] = -0.0
        levels.append(Level(A, lower, upper, weights, f"rows of {i}", name=f"stufe {i} é"))
    H = np.diag(rng.uniform(1, 2, n))
    return HierarchicalProblem(
        levels, H, rng.standard_normal(n), np.full(n, -3.0), np.full(n, np.inf), len(rows) - 1
    )


def make_sequence(problems, consecutive=False, name="some-problems"):
    return ProblemSequence(
        name=name,
        family="random",
        description="Some problems.",
        consecutive=consecutive,
        problems=tuple(problems),
    )


def assert_same(one, other):
    for key in FLOATS:
        assert getattr(one, key).tobytes() == getattr(other, key).tobytes(), key
    assert [v.name for v in one.levels] == [v.name for v in other.levels]
    assert [v.slice for v in one.levels] == [v.slice for v in other.levels]
    assert one.labels == other.labels
    assert one.bounds_level == other.bounds_level
    np.testing.assert_array_equal(one.level_of, other.level_of)


def test_a_file_gives_back_every_bit(tmp_path):
    sequence = make_sequence([make_problem(0), make_problem(1, (2,), 3), make_problem(2)])
    back = load_sequence(save_sequence(sequence, tmp_path / "new" / "folder"))
    assert replace(back, problems=sequence.problems) == sequence
    for one, other in zip(sequence.problems, back.problems, strict=True):
        assert_same(one, other)


def test_a_copy_is_the_same_and_shares_nothing():
    problem = make_problem(3)
    copy = copy_problem(problem)
    assert_same(problem, copy)
    copy.level(0).A[:] = 7.0
    copy.x_upper[:] = 8.0
    assert (copy.A[:3] == 7.0).all()
    assert (copy.upper[:5] == 8.0).all()
    assert_same(problem, make_problem(3))


def test_numpy_alone_reads_a_file(tmp_path):
    problem = make_problem(0)
    path = save_sequence(make_sequence([make_problem(1, (2, 2)), problem]), tmp_path)
    script = (
        "import sys, json; sys.modules['poise'] = None\n"
        f"sys.path.insert(0, {str(PROBLEMS)!r})\n"
        "from read import read\n"
        f"problem = list(read({str(path)!r}))[1]\n"
        "print(json.dumps({k: v.tolist() for k, v in problem.items()}))\n"
        "assert not {'scipy', 'numba', 'pinocchio'} & set(sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", script], capture_output=True, text=True, check=True
    )
    read = json.loads(done.stdout)
    for key in FLOATS:
        np.testing.assert_array_equal(np.array(read[key]), getattr(problem, key))
    assert read["rows"] == [3, 0, 4]
    assert read["bounds_level"] == 2


@pytest.mark.parametrize("content", [b"not a zip", None, 0.5], ids=["text", "folder", "cut short"])
def test_what_is_no_npz_is_refused(tmp_path, content):
    path = save_sequence(make_sequence([make_problem(0)]), tmp_path)
    if content is None:
        path = tmp_path
    else:
        whole = path.read_bytes()
        path.write_bytes(content if isinstance(content, bytes) else whole[: len(whole) // 2])
    with pytest.raises(ProblemError, match="wanted") as caught:
        load_sequence(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"format": np.array(2)}, "got 2; wanted format 1"),
        ({"description": None}, "no usable 'description'"),
        ({"n": np.array([[5]])}, "no usable 'n'.*2 dimensions"),
        ({"n": np.array([5, 5])}, "wrong length; got 1; wanted 2, as 'n'"),
        ({"A": np.zeros(34)}, "'A' of problem 0 is not all there; got '34 entries'"),
        ({"A": np.array([{}, None])}, "allow_pickle"),
        ({"lower": np.full(12, 99.0)}, "cross"),
        ({"H": -np.eye(5).ravel()}, "positive semidefinite"),
        ({"name": np.array("No Name")}, "small letters"),
        ({"family": np.array("others")}, "unknown family"),
    ],
)
def test_a_file_that_cannot_be_right_says_why(tmp_path, changes, message):
    path = save_sequence(make_sequence([make_problem(0)]), tmp_path)
    with np.load(path) as file:
        arrays = {key: file[key] for key in file.files} | changes
    np.savez(path, **{key: array for key, array in arrays.items() if array is not None})
    with pytest.raises(ProblemError, match=message) as caught:
        load_sequence(path)
    assert str(path) in str(caught.value)
