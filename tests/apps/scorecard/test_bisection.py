"""The search for where something ceases to hold."""

import pytest

from poise.apps.scorecard._bisection import Bisection


def searched(holds, looks=8):
    search, seen = Bisection(looks), []
    while (level := search.level) is not None:
        seen.append(level)
        search.tell(holds(level))
    return search, seen


@pytest.mark.parametrize("threshold", [0.01, 0.2, 0.5, 0.77, 0.99])
def test_a_threshold_is_found_to_the_last_look(threshold):
    search, seen = searched(lambda level: level <= threshold)
    assert len(seen) == len(set(seen)) == 8
    assert search.held <= threshold < search.failed
    assert search.failed - search.held <= 2**-7


def test_the_looks_are_the_same_every_time():
    _, one = searched(lambda level: level < 0.3)
    _, other = searched(lambda level: level < 0.3)
    assert one == other
    assert one[:3] == [0.5, 0.25, 0.375]


def test_where_nothing_fails_the_last_look_is_at_the_hard_end():
    search, seen = searched(lambda level: True, looks=4)
    assert seen == [0.5, 0.75, 0.875, 1.0]
    assert (search.held, search.failed) == (1.0, None)


def test_where_only_the_hard_end_fails_that_is_known():
    search, _ = searched(lambda level: level < 1.0, looks=4)
    assert (search.held, search.failed) == (0.875, 1.0)


def test_where_nothing_holds_the_last_look_is_at_the_easy_end():
    search, seen = searched(lambda level: False, looks=4)
    assert seen == [0.5, 0.25, 0.125, 0.0]
    assert (search.held, search.failed) == (None, 0.0)


def test_where_only_the_easy_end_holds_that_is_known():
    search, _ = searched(lambda level: level == 0.0, looks=4)
    assert (search.held, search.failed) == (0.0, 0.125)


def test_something_that_is_not_monotone_ends_between_one_that_held_and_one_that_failed():
    """It holds below 0.2 and from 0.45 to 0.7."""

    def holds(level):
        return level < 0.2 or 0.45 < level < 0.7

    search, _ = searched(holds)
    assert holds(search.held)
    assert not holds(search.failed)
    assert 0.0 < search.failed - search.held <= 2**-7
    assert search.held == pytest.approx(0.7, abs=2**-7)


def test_what_is_told_after_the_last_look_changes_nothing():
    search, _ = searched(lambda level: level < 0.3, looks=3)
    before = (search.held, search.failed, search.done)
    search.tell(True)
    assert (search.held, search.failed, search.done) == before
