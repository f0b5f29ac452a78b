"""`ComDriver`: what moves the COM so that the ZMP gets to its reference; two of them."""

from collections import deque
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float64

from poise.balance import ComShifter, PreviewControl, natural_frequency


@runtime_checkable
class ComDriver(Protocol):
    """From ZMP references to velocities of the COM.

    Attributes:
        omega: sqrt(g / H) [1/s].
    """

    omega: float

    def drive(
        self,
        reference: Float64[np.ndarray, "2"],
        position: Float64[np.ndarray, "2"],
        velocity: Float64[np.ndarray, "2"],
        dt: float,
    ) -> tuple[Float64[np.ndarray, "2"], Float64[np.ndarray, "2"]]:
        """One tick.

        Args:
            reference: of the ZMP; may jump [m].
            position: of the COM, estimated [m].
            velocity: of the COM, commanded in the last tick [m/s].
            dt: length of a tick [s].

        Returns:
            The next velocity [m/s] and its acceleration [m/s^2].
        """
        ...

    def restart(
        self, commanded: Float64[np.ndarray, "2"], measured: Float64[np.ndarray, "2"]
    ) -> Float64[np.ndarray, "2"]:
        """The velocity to go on from when the mode has changed, of the two there are [m/s]."""
        ...


class ShifterDriver:
    """The COM shifter (37), its acceleration integrated.

    Args:
        shifter: the feedback.
    """

    def __init__(self, shifter: ComShifter) -> None:
        self.shifter, self.omega = shifter, shifter.omega

    def drive(
        self,
        reference: Float64[np.ndarray, "2"],
        position: Float64[np.ndarray, "2"],
        velocity: Float64[np.ndarray, "2"],
        dt: float,
    ) -> tuple[Float64[np.ndarray, "2"], Float64[np.ndarray, "2"]]:
        """One tick of (37)."""
        acceleration = self.shifter.acceleration(reference, position, velocity)
        return velocity + dt * acceleration, acceleration

    def restart(
        self, commanded: Float64[np.ndarray, "2"], measured: Float64[np.ndarray, "2"]
    ) -> Float64[np.ndarray, "2"]:
        """The measured velocity: an integrator that starts to act starts from what is."""
        del commanded
        return measured


class PreviewDriver:
    """Preview control as a baseline: the reference goes through a buffer of N ticks first.

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
        self.omega = natural_frequency(height)
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
