"""What `type_checks` checks: the first calls of each function in each test, and some later ones."""

import inspect

import jaxtyping
import numpy as np
import pytest
import type_checks
from beartype import beartype
from type_checks import EVERY, FIRST

from poise.apps.report import BaseErrors
from poise.locomotion import signed_margin
from poise.stack import ComTask

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def is_checked():
    """Whether this call is: a column of numbers is no points, and gets some margin."""
    try:
        signed_margin(np.zeros((2, 1)), SQUARE)
    except jaxtyping.TypeCheckError:
        return True
    return False


def annotated(calls: int):
    """One that counts its calls."""


@pytest.mark.parametrize("time", ["first", "second"])
def test_wrong_shapes_are_errors_in_the_first_calls_of_each_test_and_in_some_after_them(time):
    counting = type_checks.counting(annotated, beartype)
    checked = [is_checked() for _ in range(2 * FIRST)]
    assert checked == [True] * FIRST + [False] * FIRST
    for _ in range(3):
        for k in range(EVERY + FIRST + 1):
            counting(k)
        assert [is_checked() for _ in range(2 * FIRST)].count(True) == 1


def test_one_that_counts_is_checked_as_often():
    counting = type_checks.counting(annotated, beartype)
    checked = []
    for _ in range(FIRST + 2 * EVERY):
        try:
            counting("no number")
        except jaxtyping.TypeCheckError:
            checked.append(True)
        else:
            checked.append(False)
    assert checked[:FIRST] == [True] * FIRST
    assert checked.count(True) == FIRST + 1
    assert checked[FIRST + EVERY]


def test_one_that_is_not_checked_is_as_it_was_written():
    """With its defaults, its name and what it closes over."""
    assert signed_margin.__code__ is not inspect.unwrap(signed_margin).__code__
    for _ in range(2 * FIRST):
        is_checked()
    assert signed_margin.__code__ is inspect.unwrap(signed_margin).__code__
    for _ in range(2 * FIRST):
        assert ComTask().name == "com"


def test_a_function_that_is_called_late_is_checked():
    for _ in range(2 * FIRST):
        is_checked()
    with pytest.raises(jaxtyping.TypeCheckError, match="name"):
        ComTask(name=1)


def test_what_a_dataclass_is_made_of_is_checked():
    with pytest.raises(jaxtyping.TypeCheckError, match="tilt"):
        BaseErrors(drift=np.zeros(3), tilt=np.zeros(2), speed=np.zeros(3))


def test_a_call_that_is_checked_and_fails_can_be_looked_into():
    """As pytest does with each frame; the checked function has something that it closes over."""
    most = 3

    def up(x: int) -> int:
        if x > most:
            raise ValueError(x)
        return x

    checked = type_checks._Freed(up, beartype).outer
    assert checked(3) == 3
    with pytest.raises(ValueError, match="4") as caught:
        checked(4)
    frames = [entry.frame.f_locals for entry in caught.traceback]
    assert frames[1]["arguments"] == (4,)
    assert frames[-1] == {"x": 4, "most": 3}
