"""`Odometry`: offset of the world that is estimated against the one that is drawn."""

import numpy as np
from jaxtyping import Float64


class Odometry:
    """Shift points between the world that is estimated and the simulator's, which is drawn."""

    def __init__(self) -> None:
        self.offset: Float64[np.ndarray, "3"] = np.zeros(3)

    def measure(self, true: Float64[np.ndarray, "3"], estimated: Float64[np.ndarray, "3"]) -> None:
        """Take one point in both worlds [m]."""
        self.offset = true - estimated

    def drawn(self, place: Float64[np.ndarray, "... k"]) -> Float64[np.ndarray, "... k"]:
        """Shift estimated points of two or three coordinates into the drawn world [m]."""
        return place + self.offset[: place.shape[-1]]

    def estimated(self, place: Float64[np.ndarray, "3"]) -> Float64[np.ndarray, "3"]:
        """Shift a drawn point into the estimated world [m]."""
        return place - self.offset
