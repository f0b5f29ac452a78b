"""Row weights by task: what is set is read back, and what cannot be a weight is refused."""

import numpy as np
import pytest

from poise.control._differential_ik import ROW_WEIGHT
from poise.control._differential_ik._rows import RowWeights
from poise.errors import ConfigurationError
from poise.stack import ComTask, PostureTask, Stack


@pytest.fixture
def stack(get_robot):
    stack = Stack([], [[ComTask(weight=[1.0, 2.0, 0.5])], [PostureTask()]])
    stack.bind(get_robot("biped20"))
    return stack


def test_a_rows_weight_is_that_of_the_task_squared(stack):
    weights = RowWeights(stack)
    np.testing.assert_allclose(weights["com"], ROW_WEIGHT * np.array([1.0, 4.0, 0.25]))
    weights["com"] = [1.0, 100.0, 4e4]
    np.testing.assert_allclose(weights["com"], [1.0, 100.0, 4e4])
    np.testing.assert_allclose(stack.task("com").weight, [0.01, 0.1, 2.0])
    weights[stack.task("com")] = 9e4
    np.testing.assert_allclose(stack.task("com").weight, 3.0)
    assert (list(weights), len(weights)) == (["com", "posture"], 2)


@pytest.mark.parametrize("weight", [0.0, -1.0, [1.0, 0.0, 1.0], [1.0, 1.0], np.nan])
def test_weights_that_are_not_positive_are_refused_and_change_nothing(stack, weight):
    weights = RowWeights(stack)
    before = weights["com"]
    with pytest.raises(ConfigurationError, match="row weight of task 'com'"):
        weights["com"] = weight
    np.testing.assert_array_equal(weights["com"], before)
