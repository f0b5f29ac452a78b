"""Workers: everything is done once, whoever dies; what cannot be done is said."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from contextlib import contextmanager
from multiprocessing import active_children

import pytest

pytest.importorskip("mujoco")
pytest.importorskip("pyarrow")

import episodes

from poise.apps.campaigns import LocalWorkers, ThisProcess, WorkerLostError
from poise.errors import ConfigurationError, PoiseError


def numbers(found):
    return sorted(job.number for job, _ in found)


def test_each_gives_every_item_with_its_result_once(two):
    assert dict(two.each(abs, [-3, 1, 2, -5])) == {-3: 3, 1: 1, 2: 2, -5: 5}


def test_this_process_does_the_same():
    with ThisProcess() as here:
        assert dict(here.each(abs, [-3, 1, 2, -5])) == {-3: 3, 1: 1, 2: 2, -5: 5}


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


def test_a_worker_that_is_not_up_yet_hears_no_ctrl_c():
    with one_worker() as (one, begun):
        answer = one.submit(abs, -3)
        for _ in range(20):
            os.kill(begun(), signal.SIGINT)
            time.sleep(0.02)
        assert answer.result() == (False, 3)
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())


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


def test_an_idle_worker_that_was_killed_costs_nothing():
    with one_worker() as (one, begun):
        assert dict(one.each(abs, [-1])) == {-1: 1}
        os.kill(begun(), signal.SIGKILL)
        assert dict(one.each(abs, [-1, -2])) == {-1: 1, -2: 2}


def test_workers_are_gone_at_the_end_whatever_they_do():
    with one_worker() as (one, begun):
        one.submit(time.sleep, 60.0)
        pid = begun()
    assert not alive(pid)


@pytest.mark.parametrize(
    ("function", "words"),
    [(episodes.refusing, "not this one; got 0"), (episodes.failing, "IndexError")],
)
def test_an_error_of_the_function_is_raised_here(two, function, words):
    with pytest.raises(PoiseError, match=words):
        list(two.each(function, episodes.jobs(1)))
    assert dict(two.each(abs, [-2])) == {-2: 2}


def test_what_an_error_leaves_running_is_taken_for_nothing_else(two):
    with pytest.raises(PoiseError, match="not this one"):
        list(two.each(episodes.refusing_first, episodes.jobs(2)))
    assert dict(two.each(abs, range(-4, 0))) == {-4: 4, -3: 3, -2: 2, -1: 1}


def test_workers_have_one_thread_and_the_parent_keeps_its_environment(monkeypatch):
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    with LocalWorkers(1) as workers:
        assert [n for _, n in workers.each(os.getenv, ["OPENBLAS_NUM_THREADS"])] == ["1"]
    assert "OPENBLAS_NUM_THREADS" not in os.environ


def test_no_workers_are_refused():
    with pytest.raises(ConfigurationError, match="got 0"):
        LocalWorkers(0)


def alive(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    with open(f"/proc/{pid}/stat") as stat:
        return stat.read().split()[2] != "Z"


PARENT = """
import time
from multiprocessing import active_children
from poise.apps.campaigns import LocalWorkers
if __name__ == "__main__":
    with LocalWorkers(2) as workers:
        for _ in workers.each(time.sleep, [0.1, 0.1]):
            pass
        workers.submit(time.sleep, 60.0)
        print(*(child.pid for child in active_children()), flush=True)
        time.sleep(60.0)
"""


@pytest.mark.slow
def test_workers_end_with_a_parent_that_is_killed(tmp_path):
    (tmp_path / "parent.py").write_text(PARENT)
    parent = subprocess.Popen(
        [sys.executable, "parent.py"], cwd=tmp_path, stdout=subprocess.PIPE, text=True
    )
    with parent:
        pids = [int(pid) for pid in parent.stdout.readline().split()]
        assert pids
        assert all(alive(pid) for pid in pids)
        parent.kill()
    deadline = time.monotonic() + 10.0
    while any(alive(pid) for pid in pids) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not any(alive(pid) for pid in pids)
