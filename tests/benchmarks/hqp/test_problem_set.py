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
    load_folder,
    load_sequence,
    save_sequence,
)
from poise.errors import ConfigurationError, PoiseError, ProblemError, UnknownNameError
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


def rewrite(path, **changes):
    """Writes a file anew with other arrays; None leaves one out."""
    with np.load(path) as file:
        arrays = {key: file[key] for key in file.files} | changes
    np.savez(path, **{key: array for key, array in arrays.items() if array is not None})


def test_a_file_gives_back_every_bit(tmp_path):
    sequence = make_sequence([make_problem(0), make_problem(1, (2,), 3), make_problem(2)])
    back = load_sequence(save_sequence(sequence, tmp_path / "new" / "folder"))
    assert replace(back, problems=sequence.problems) == sequence
    for one, other in zip(sequence.problems, back.problems, strict=True):
        assert_same(one, other)


def test_views_of_a_loaded_problem_look_into_its_storage(tmp_path):
    path = save_sequence(make_sequence([make_problem(0)]), tmp_path)
    (problem,) = load_sequence(path).problems
    problem.level(2).A[:] = 7.0
    problem.x_lower[:] = -8.0
    assert (problem.A[-4:] == 7.0).all()
    assert (problem.lower[:5] == -8.0).all()


def test_a_copy_is_the_same_and_shares_nothing():
    problem = make_problem(3)
    copy = copy_problem(problem)
    assert_same(problem, copy)
    copy.level(0).A[:] = 7.0
    copy.x_upper[:] = 8.0
    assert (copy.A[:3] == 7.0).all()
    assert (copy.upper[:5] == 8.0).all()
    assert_same(problem, make_problem(3))


def test_what_repeats_is_stored_once(tmp_path):
    problems = [make_problem(0) for _ in range(10)]
    for i, problem in enumerate(problems):
        problem.lower[-1] -= i
    path = save_sequence(make_sequence(problems, consecutive=True), tmp_path)
    with np.load(path) as file:
        assert file["A"].size == problems[0].A.size
        assert file["lower"].size == 10 * problems[0].lower.size
        assert len(file["label_names"]) == len(problems[0].labels)


def test_two_saves_give_equal_bytes(tmp_path):
    one, other = (save_sequence(make_sequence([make_problem(0)]), tmp_path / name) for name in "ab")
    assert one.read_bytes() == other.read_bytes()


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


def test_a_folder_is_read_in_the_order_of_names(tmp_path):
    for name in ("b", "a-2", "a"):
        save_sequence(make_sequence([make_problem(0)], name=name), tmp_path)
    assert [sequence.name for sequence in load_folder(tmp_path)] == ["a-2", "a", "b"]


def test_a_folder_without_problems_is_an_error(tmp_path):
    with pytest.raises(PoiseError, match=r"wanted a folder with \.npz files"):
        load_folder(tmp_path)


@pytest.mark.parametrize("kind", ["missing", "text", "npy", "cut short", "damaged", "folder"])
def test_what_is_no_npz_is_refused(tmp_path, kind):
    path = save_sequence(make_sequence([make_problem(0)]), tmp_path)
    content = path.read_bytes()
    if kind == "missing":
        path = tmp_path / "nowhere.npz"
    elif kind == "text":
        path.write_text("not a zip")
    elif kind == "npy":
        with path.open("wb") as file:
            np.save(file, np.zeros(3))
    elif kind == "cut short":
        path.write_bytes(content[: len(content) // 2])
    elif kind == "damaged":
        middle = len(content) // 3
        path.write_bytes(content[:middle] + bytes(64) + content[middle + 64 :])
    else:
        path = tmp_path
    with pytest.raises(ProblemError) as caught:
        load_sequence(path)
    assert str(path) in str(caught.value)
    assert "wanted" in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"format": None}, "got None; wanted format 1"),
        ({"format": np.array(2)}, "got 2; wanted format 1"),
        ({"format": np.array("one")}, "got 'one'; wanted format 1"),
        ({"description": None}, "no usable 'description'"),
        ({"consecutive": np.array(1)}, "no usable 'consecutive'"),
        ({"n": None}, "no usable 'n'"),
        ({"n": np.array([5.0])}, "no usable 'n'.*got 'float64"),
        ({"n": np.array([[5]])}, "no usable 'n'.*2 dimensions"),
        ({"n": np.array([6])}, "not all there"),
        ({"n": np.array([0])}, "not a problem's size"),
        ({"n": np.array([5, 5])}, "wrong length; got 1; wanted 2, as 'n'"),
        ({"n": np.array([], dtype=np.int64)}, "wrong length"),
        ({"levels": np.array([-1])}, "not all there"),
        ({"rows": np.array([3, 0, 5])}, "not all there"),
        ({"rows": np.array([3, -1, 4])}, "not a problem's size"),
        ({"A": None}, "no usable 'A'; got None"),
        ({"A": np.zeros(34)}, "'A' of problem 0 is not all there; got '34 entries'"),
        ({"A": np.zeros((7, 5))}, "no usable 'A'.*2 dimensions"),
        ({"A": np.zeros(35, dtype=np.float32)}, "no usable 'A'.*float32"),
        ({"A": np.full(35, np.nan)}, "not finite"),
        ({"A_start": np.array([1])}, "not all there"),
        ({"A_start": np.array([-1])}, "not all there"),
        ({"lower": np.full(12, 99.0)}, "cross"),
        ({"weights": np.zeros(12)}, "weight"),
        ({"H": -np.eye(5).ravel()}, "positive semidefinite"),
        ({"bounds_level": np.array([3])}, "bounds_level is not a level"),
        ({"label_rows": np.array([5, 3, 0, 5])}, "do not add up"),
        ({"label_names": np.array(["a"])}, "not all there"),
        ({"level_names": np.array([1, 2, 3])}, "no usable 'level_names'"),
        ({"name": np.array("No Name")}, "not a name"),
        ({"family": np.array("others")}, "unknown family"),
    ],
)
def test_a_file_that_cannot_be_right_says_why(tmp_path, changes, message):
    path = save_sequence(make_sequence([make_problem(0)]), tmp_path)
    rewrite(path, **changes)
    with pytest.raises(ProblemError, match=message) as caught:
        load_sequence(path)
    assert str(path) in str(caught.value)


def test_pickles_are_refused(tmp_path):
    path = save_sequence(make_sequence([make_problem(0)]), tmp_path)
    rewrite(path, A=np.array([{}, None]))
    with pytest.raises(ProblemError, match="allow_pickle"):
        load_sequence(path)


def test_a_file_of_the_first_format_that_says_consecutive_is_checked_for_it(tmp_path):
    path = save_sequence(make_sequence([make_problem(0), make_problem(1, (2, 2))]), tmp_path)
    rewrite(path, consecutive=np.array(True))
    with pytest.raises(ProblemError, match="differ in shape"):
        load_sequence(path)


@pytest.mark.parametrize("name", ["", "Walk", "a b", "a--b", "-a", "a/b", "a.npz"])
def test_a_name_that_is_no_file_name_is_refused(name):
    with pytest.raises(ConfigurationError, match="small letters"):
        make_sequence([make_problem(0)], name=name)


def test_a_sequence_without_problems_is_refused():
    with pytest.raises(ConfigurationError, match="has no problems"):
        make_sequence([])


def test_an_unknown_family_is_refused():
    with pytest.raises(UnknownNameError, match="choices: .*recorded"):
        replace(make_sequence([make_problem(0)]), family="recordings")
