"""`limit_weights`: joints near a limit move less, by Chan and Dubey's weights."""

import numpy as np
from jaxtyping import Float64

LARGEST_WEIGHT = 1e4
"""Weight of a joint at or beyond a limit that moves outwards: it moves a hundredth as far as it
would, and the weight is still a number that one can divide by."""


def limit_weights(
    q: Float64[np.ndarray, " n"],
    rate: Float64[np.ndarray, " n"],
    q_min: Float64[np.ndarray, " n"],
    q_max: Float64[np.ndarray, " n"],
) -> Float64[np.ndarray, " n"]:
    """Diagonal of W_B: one, and more for a joint that moves towards its nearer limit.

    Equation (23) of Zhang and Kikuuwe, after Chan and Dubey 1995,

        W_B = (q_max - q_min)^2 / (4 (q_max - q) (q - q_min))    moving away from the middle
        W_B = 1                                                  moving towards it, or at rest

    which goes to infinity at the limit and says nothing beyond it. Here it ends at
    `LARGEST_WEIGHT`, which also holds beyond a limit for a joint that moves further out.

    Args:
        q: joint positions [rad].
        rate: joint velocities [rad/s].
        q_min: lower limits [rad].
        q_max: upper limits [rad].
    """
    above, below, span = q - q_min, q_max - q, q_max - q_min
    square, room = span * span, 4.0 * above * below
    inside = room * LARGEST_WEIGHT > square
    weight = np.full(len(q), LARGEST_WEIGHT)
    np.divide(square, room, out=weight, where=inside)
    weight[(above - below) * rate <= 0.0] = 1.0
    return weight
