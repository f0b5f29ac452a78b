"""The search for where something ceases to hold."""

import pytest

from poise.apps.scorecard._bisection import Bisection


def searched(holds, looks=8, guess=None):
    search, seen = Bisection(looks, guess), []
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


def test_the_edge_that_another_search_has_found_is_confirmed_by_two_looks():
    guess, _ = searched(lambda level: level <= 0.3)
    search, seen = searched(lambda level: level <= 0.3, guess=guess)
    assert seen == [guess.held, guess.failed]
    assert (search.held, search.failed) == (guess.held, guess.failed)


@pytest.mark.parametrize("guessed", [0.001, 0.02, 0.3, 0.6, 0.97, 2.0])
@pytest.mark.parametrize("threshold", [0.001, 0.01, 0.29, 0.31, 0.5, 0.95, 0.999])
def test_whatever_the_guess_the_edge_is_found_as_finely(guessed, threshold):
    guess, _ = searched(lambda level: level <= guessed)
    search, seen = searched(lambda level: level <= threshold, guess=guess)
    # The steps out to the edge, and the halving of the last of them.
    assert len(seen) == len(set(seen)) <= 2 * 8 + 1
    assert search.held <= threshold < search.failed
    assert search.failed - search.held <= 2**-7


@pytest.mark.parametrize("guessed", [-1.0, 0.0, 0.4, 2.0])
def test_ends_are_found_from_any_guess(guessed):
    guess, _ = searched(lambda level: level <= guessed)
    best, _ = searched(lambda level: True, guess=guess)
    assert (best.held, best.failed) == (1.0, None)
    none, _ = searched(lambda level: False, guess=guess)
    assert (none.held, none.failed) == (None, 0.0)


def test_an_end_that_another_search_has_found_is_confirmed_by_one_look():
    best, _ = searched(lambda level: True)
    assert searched(lambda level: True, guess=best)[1] == [1.0]
    none, _ = searched(lambda level: False)
    assert searched(lambda level: False, guess=none)[1] == [0.0]


def test_how_many_looks_are_expected_is_how_many_there_were_in_the_end():
    guess = Bisection(8)
    assert (guess.expected, Bisection(8, guess).expected) == (8, 2)
    guess, seen = searched(lambda level: level <= 0.3)
    assert guess.expected == len(seen)
    search, seen = searched(lambda level: level <= 0.6, guess=guess)
    assert search.expected == len(seen) > 2
