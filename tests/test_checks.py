"""What counts as one number where a user passes one."""

import inspect
from fractions import Fraction

import numpy as np
import pytest

from poise import _checks
from poise.errors import ConfigurationError

# Without the checks of types that tests have: they would answer first.
checked_number = inspect.unwrap(_checks.checked_number)

NUMBERS = [2, 2.0, np.float32(2.0), np.int64(2), np.array(2.0), Fraction(2)]
NONE = [True, np.True_, "2", b"2", np.array("2"), None, [2.0], np.array([2.0]), [[1], [1, 2]], 2j]


@pytest.mark.parametrize("value", NUMBERS, ids=repr)
def test_a_number_of_any_kind_becomes_a_float(value):
    found = checked_number(value, "the length")
    assert type(found) is float
    assert found == 2.0


@pytest.mark.parametrize("value", NONE, ids=repr)
def test_what_only_converts_to_a_number_is_none(value):
    with pytest.raises(ConfigurationError, match="the length is not a number"):
        checked_number(value, "the length")


@pytest.mark.parametrize("value", [-1.0, float("nan"), float("inf")], ids=repr)
def test_a_number_out_of_range_is_refused(value):
    with pytest.raises(ConfigurationError, match="the length is out of range"):
        checked_number(value, "the length")


def test_a_bound_is_itself_outside():
    assert checked_number(0.2, "the length", above=0.1) == 0.2
    with pytest.raises(ConfigurationError, match=r"out of range; got 0\.1; wanted .* > 0\.1"):
        checked_number(0.1, "the length", above=0.1)
