"""`PreviewDriver`: the COM by preview control, as the baseline of the COM shifter."""

from collections import deque

import numpy as np
from jaxtyping import Float64

from poise.locomotion import PreviewControl


class PreviewDriver:
    """A `poise.locomotion.ComDriver`: the reference goes through a buffer of N ticks first.

    What the controller takes for the present is the reference of N ticks ago; the buffer holds
    what comes after it. So a reference that jumps acts N T later, and the ZMP begins to move
    earlier.

    Args:
        height: of the COM [m].
        dt: length of a tick [s].
        length: N.
    """

    def __init__(self, height: float, dt: float, length: int) -> None:
        self.control = PreviewControl(height, dt, length)
        self.omega = self.control.omega
        self._buffer: deque[Float64[np.ndarray, "2"]] = deque(maxlen=length)
        self._acceleration = np.zeros(2)

    def drive(
        self,
        reference: Float64[np.ndarray, "2"],
        position: Float64[np.ndarray, "2"],
        velocity: Float64[np.ndarray, "2"],
        dt: float,
    ) -> tuple[Float64[np.ndarray, "2"], Float64[np.ndarray, "2"]]:
        """One tick, with the position fed back."""
        del dt
        missing = self.control.length - len(self._buffer)
        self._buffer.extend([reference.copy()] * max(missing, 1))
        # The newest reference is N ticks ahead: until then nothing is to be seen of it.
        state = np.stack((position, velocity, self._acceleration))
        jerk = self.control.jerk(state, np.stack(self._buffer))
        _, velocity, self._acceleration = self.control.advance(state, jerk)
        return velocity, self._acceleration

    def restart(
        self, commanded: Float64[np.ndarray, "2"], measured: Float64[np.ndarray, "2"]
    ) -> Float64[np.ndarray, "2"]:
        """The commanded velocity: the pattern goes on across modes."""
        del measured
        return commanded
