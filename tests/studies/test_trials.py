"""`run_each`: what was computed is on the disk, and not computed again."""

import time
from dataclasses import dataclass
from pathlib import Path

import pytest

from poise.errors import PoiseError
from studies.plan import StudyOptions
from studies.trial_section import run_each


@dataclass(frozen=True)
class Trial:
    """A number, and the folder in which each run of it leaves a file."""

    number: int
    folder: Path


@dataclass(frozen=True)
class Outcome:
    """The number's square."""

    square: int


def square(trial):
    (trial.folder / f"ran-{trial.number}-{time.monotonic_ns()}").touch()
    return Outcome(trial.number**2)


def refuse(trial):
    raise PoiseError(f"no square of {trial.number}")


def ran(folder, number):
    return len(list(folder.glob(f"ran-{number}-*")))


def run(trials, folder, seen=None, function=square):
    def progress(done, total):
        if seen is not None:
            seen.append((done, total))

    return run_each(function, Outcome, trials, progress, StudyOptions(folder=folder), workers=1)


@pytest.fixture
def trials(tmp_path):
    return [Trial(number, tmp_path) for number in range(3)]


def test_a_second_run_computes_what_is_new_alone(trials, tmp_path):
    first, seen = run(trials[:2], tmp_path / "out"), []
    again = run(trials[::-1], tmp_path / "out", seen)
    assert list(again.values()) == [Outcome(4), Outcome(1), Outcome(0)]
    assert list(again) == trials[::-1]
    assert [ran(tmp_path, number) for number in range(3)] == [1, 1, 1]
    assert seen == [(3.0, 3.0)]
    assert first == {trial: Outcome(trial.number**2) for trial in trials[:2]}


@pytest.mark.slow
def test_a_record_that_was_not_finished_is_computed_again_and_later_ones_stay(trials, tmp_path):
    run(trials[:2], tmp_path / "out")
    (kept,) = (tmp_path / "out" / "trials").iterdir()
    whole = kept.read_bytes()
    kept.write_bytes(whole[:-5])
    run(trials, tmp_path / "out")
    run(trials, tmp_path / "out")
    assert [ran(tmp_path, number) for number in range(3)] == [1, 2, 1]


@pytest.mark.slow
def test_what_was_done_before_a_trial_without_outcome_is_kept(trials, tmp_path):
    run(trials[:1], tmp_path / "out")
    with pytest.raises(PoiseError, match="no square of 1"):
        run(trials[1:], tmp_path / "out", function=refuse)
    run(trials[:1], tmp_path / "out")
    assert ran(tmp_path, 0) == 1
