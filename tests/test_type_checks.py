"""What `type_checks` checks: the first calls of each test."""

import jaxtyping
import numpy as np
import pytest
import type_checks

from poise.locomotion import signed_margin

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


@pytest.mark.parametrize("time", ["first", "second"])
def test_wrong_shapes_are_errors_until_enough_calls_of_a_test_were_checked(time):
    with pytest.raises(jaxtyping.TypeCheckError, match="signed_margin"):
        signed_margin(np.zeros((2, 3)), SQUARE)
    inside = np.full((1, 2), 0.5)
    for _ in range(type_checks.CHECKED):
        signed_margin(inside, SQUARE)
    assert jaxtyping.config.jaxtyping_disable
