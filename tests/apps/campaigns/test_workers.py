"""Workers: everything is done once, whoever dies; what cannot be done is said."""

import os
import signal
import threading
import time
from collections import Counter
from contextlib import contextmanager
from multiprocessing import active_children

import pytest

pytest.importorskip("mujoco")
pytest.importorskip("pyarrow")

import episodes

from poise.apps.campaigns import LocalWorkers, WorkerLostError
from poise.errors import PoiseError


def numbers(found):
    return sorted(job.number for job, _ in found)


def test_each_gives_every_item_with_its_result_once(two):
    assert dict(two.each(abs, [-3, 1, 2, -5])) == {-3: 3, 1: 1, 2: 2, -5: 5}


@contextmanager
def one_worker():
    """A single one, and a function that waits for its process to be started."""
    others = {child.pid for child in active_children()}

    def begun():
        while not (own := {child.pid for child in active_children()} - others):
            time.sleep(0.001)
        return own.pop()

    with LocalWorkers(1) as one:
        yield one, begun


@pytest.mark.parametrize("late", [0.0, 0.05, 0.3])
def test_a_worker_that_is_killed_while_it_starts_loses_nothing(late):
    with one_worker() as (one, begun):

        def kill():
            first = begun()
            time.sleep(late)
            os.kill(first, signal.SIGKILL)

        killer = threading.Thread(target=kill)
        killer.start()
        found = dict(one.each(abs, [-1, -2, -3]))
        killer.join()
        assert found == {-1: 1, -2: 2, -3: 3}


def test_items_are_asked_for_when_a_worker_is_free(two):
    asked = []

    def items():
        for i in range(20):
            asked.append(i)
            yield i

    found = two.each(abs, items())
    next(found)
    assert len(asked) == 2
    assert len([*found]) == 19


def test_one_that_takes_its_worker_along_every_time_is_a_result_and_no_end(two):
    found = list(two.each(episodes.ending_third, episodes.jobs(6)))
    assert numbers(found) == [0, 1, 2, 3, 4, 5]
    lost = {job.number: str(r) for job, r in found if isinstance(r, WorkerLostError)}
    assert lost == {3: "its process ended by SIGSEGV"}


def test_a_worker_that_dies_loses_its_own_episode_alone_which_another_runs(two, tmp_path):
    notes = tmp_path / "notes"
    jobs = episodes.jobs(8, notes=str(notes), marker=str(tmp_path / "marker"))
    found = list(two.each(episodes.ending_once, jobs))
    assert numbers(found) == list(range(8))
    assert not [r for _, r in found if isinstance(r, WorkerLostError)]
    ran = [line.split() for line in notes.read_text().splitlines()]
    assert Counter(number for number, _ in ran) == dict.fromkeys("01234567", 1)
    assert len({pid for _, pid in ran}) == 3


@pytest.mark.parametrize(
    ("function", "words"),
    [(episodes.refusing, "not this one; got 0"), (episodes.failing, "IndexError")],
)
def test_an_error_of_the_function_is_raised_here(two, function, words):
    with pytest.raises(PoiseError, match=words):
        list(two.each(function, episodes.jobs(1)))
    assert dict(two.each(abs, [-2])) == {-2: 2}
