"""`HapticArm`: what a driver of a device with force feedback has to have.

`SimulatedArm`: one in a simulated hand.
"""

from collections.abc import Callable
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float64

from poise._checks import checked_number

# Where the end of an arm is, forward, left and up from anywhere [m], and whether it leads
Reading = tuple[Float64[np.ndarray, "3"], bool]


@runtime_checkable
class HapticArm(Protocol):
    """A device of three degrees of freedom that one hand holds, such as a Novint Falcon.

    Neither call may wait: both are made once a period of the device, a thousand times a second.
    """

    def read(self) -> Reading | None:
        """Where the hand is and whether its clutch is closed; None when the arm is gone.

        So it is, too, for a place that is not finite, where either call raises, and for what is no
        reading. A place may be a list or of float32 as well.
        """
        ...

    def write(self, force: Float64[np.ndarray, "3"]) -> None:
        """Pushes the hand until the next call.

        Args:
            force: forward, left and up [N].
        """
        ...


class SimulatedArm:
    """An arm in a hand that holds it like a spring and goes where a person wants it to.

    m x'' = f + k (x_hand - x) - d x' with the force f of the device; each `read` is a period later.

    Args:
        hand: where the person wants the hand at a time [s], and whether the clutch is closed.
        dt: period [s].
        mass: of arm and hand m [kg].
        stiffness: of a relaxed hand k [N/m].
        damping: of hand and arm d [N s/m].

    Attributes:
        force: of the device on the hand now [N].
        connected: whether it can be read; a test may pull it out.
    """

    def __init__(
        self,
        hand: Callable[[float], Reading],
        *,
        dt: float = 1e-3,
        mass: float = 0.4,
        stiffness: float = 250.0,
        damping: float = 12.0,
    ) -> None:
        self._dt = checked_number(dt, "period of the arm [s]", above=0.0)
        self._mass = checked_number(mass, "mass of the arm [kg]", above=0.0)
        self._stiffness = checked_number(stiffness, "stiffness of the hand [N/m]", above=0.0)
        self._damping = checked_number(damping, "damping of the hand [N s/m]", above=0.0)
        self._hand, self._periods = hand, 0
        self._position = hand(0.0)[0].copy()
        self._velocity = np.zeros(3)
        self.force: Float64[np.ndarray, "3"] = np.zeros(3)
        self.connected = True

    def read(self) -> Reading | None:
        """Where the hand is, a period after the last call."""
        wanted, clutch = self._hand(self._periods * self._dt)
        pull = self._stiffness * (wanted - self._position) - self._damping * self._velocity
        # The velocity first: with the old one the spring would gain energy.
        self._velocity = self._velocity + self._dt / self._mass * (self.force + pull)
        self._position = self._position + self._dt * self._velocity
        self._periods += 1
        return (self._position.copy(), clutch) if self.connected else None

    def write(self, force: Float64[np.ndarray, "3"]) -> None:
        """Pushes the hand until the next call [N]."""
        self.force = force.copy()
