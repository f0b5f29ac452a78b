"""`shed`: lets go of tasks from the bottom up until contacts and torque limits hold."""

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float64

_HALVINGS = 5
"""How finely the share of the last task that stays is found: to 1/32."""


def shed(
    steps: Sequence[Float64[np.ndarray, " nv"]],
    fits: Callable[[Float64[np.ndarray, " nv"]], bool],
) -> Float64[np.ndarray, " nv"]:
    """The acceleration that keeps as many levels as fit, and a share of the next.

    Args:
        steps: accelerations with one more level each time; the last, with all, does not fit.
        fits: whether an acceleration can be brought about; called last with the answer.

    Returns:
        An acceleration that fits, or that of all levels where not even the first step does.
    """
    kept = len(steps) - 2
    while kept >= 0 and not fits(steps[kept]):
        kept -= 1
    if kept < 0:
        # Nothing that is left out would help: what is asked for comes as near as it can.
        fits(steps[-1])
        return steps[-1]
    low, high = 0.0, 1.0
    base, way = steps[kept], steps[kept + 1] - steps[kept]
    for _ in range(_HALVINGS):
        share = 0.5 * (low + high)
        if fits(base + share * way):
            low = share
        else:
            high = share
    answer = base + low * way
    fits(answer)
    return answer
