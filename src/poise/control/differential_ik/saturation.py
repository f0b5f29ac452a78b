"""Saturation of a velocity's norm, equation (18)."""

import math

import numpy as np
from jaxtyping import Float64


def saturated(velocity: Float64[np.ndarray, " m"], largest: float) -> Float64[np.ndarray, " m"]:
    """A velocity of the same direction whose norm is at most `largest`.

    sat(x_lim, x) = x_lim x / max(x_lim, |x|), equation (18) of Zhang and Kikuuwe.

    Args:
        velocity: x.
        largest: x_lim, positive, in its unit.
    """
    return velocity * (largest / max(largest, math.sqrt(velocity.dot(velocity))))
