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
    assert len(seen) == len(set(seen)) == search.expected == 8
    assert search.held <= threshold < search.failed
    assert search.failed - search.held <= 2**-7


@pytest.mark.parametrize(
    ("holds", "looks", "found"),
    [
        (lambda level: True, [0.5, 0.75, 0.875, 1.0], (1.0, None)),
        (lambda level: level < 1.0, [0.5, 0.75, 0.875, 1.0], (0.875, 1.0)),
        (lambda level: False, [0.5, 0.25, 0.125, 0.0], (None, 0.0)),
        (lambda level: level == 0.0, [0.5, 0.25, 0.125, 0.0], (0.0, 0.125)),
    ],
)
def test_the_last_look_is_at_an_end_where_all_others_hold_or_fail(holds, looks, found):
    search, seen = searched(holds, looks=4)
    assert seen == looks
    assert (search.held, search.failed) == found


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
