"""`saturate`: shortens a vector without turning it."""

import math

import numpy as np
from jaxtyping import Float64


def saturate(limit: float, value: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " n"]:
    """Eq. (18) of Zhang and Kikuuwe: limit value / max(limit, |value|).

    Args:
        limit: largest norm of the answer, positive [unit of `value`].
        value: the vector.
    """
    return value * (limit / max(limit, math.sqrt(float(value.dot(value)))))
