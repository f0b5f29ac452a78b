"""What `type_checks` checks: the first calls of each function in each test, and some later ones."""

import jaxtyping
import numpy as np
import pytest
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


@pytest.mark.parametrize("time", ["first", "second"])
def test_wrong_shapes_are_errors_in_the_first_calls_of_each_test_and_in_some_after_them(time):
    checked = [is_checked() for _ in range(2 * EVERY)]
    assert all(checked[:FIRST])
    assert checked.count(True) == FIRST + 1


def test_a_function_that_is_called_late_is_checked():
    for _ in range(2 * FIRST):
        is_checked()
    with pytest.raises(jaxtyping.TypeCheckError, match="name"):
        ComTask(name=1)


def test_what_a_dataclass_is_made_of_is_checked():
    with pytest.raises(jaxtyping.TypeCheckError, match="tilt"):
        BaseErrors(drift=np.zeros(3), tilt=np.zeros(2), speed=np.zeros(3))
