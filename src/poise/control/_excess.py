"""`excess`: how far a solution is outside its bounds."""

import numpy as np
from jaxtyping import Float64

from poise._compiled import compiled


@compiled
def excess(
    x: Float64[np.ndarray, " n"],
    first: int,
    lower: Float64[np.ndarray, " m"],
    upper: Float64[np.ndarray, " m"],
) -> float:
    """Largest excess of some coordinates over their bounds, zero for none; NaN stays NaN."""
    worst = 0.0
    for i in range(len(lower)):
        value = x[first + i]
        outside = max(value - upper[i], lower[i] - value)
        if outside > worst or np.isnan(outside):
            worst = outside
    return worst
