"""`ZmpSensor`: the ZMP from the load cells of the soles."""

import numpy as np
from jaxtyping import Float64

from poise.dynamics.dynamics import Dynamics
from poise.dynamics.state import RobotState

_LEAST_LOAD = 0.02
"""Share of the weight below which the soles say nothing about the ZMP."""


class ZmpSensor:
    """Centre of pressure of both soles, smoothed.

    A wrench [f; m] at a sole's centre presses at (-m_y, m_x) / f_z in the sole's plane, which is
    what cells at its four corners measure. While nothing presses, the last value holds.

    Args:
        frames: frames of the left and the right sole.
        names: their names in the measured contacts.
        weight: of the robot [N].
        time_constant: of the smoothing [s].
        dt: length of a tick [s].

    Attributes:
        zmp: x and y [m].
        loads: normal forces, left and right [N].
    """

    def __init__(
        self,
        frames: tuple[int, int],
        names: tuple[str, str],
        weight: float,
        time_constant: float,
        dt: float,
    ) -> None:
        self._frames, self._names, self._least = frames, names, _LEAST_LOAD * weight
        self._share = dt / (time_constant + dt)
        self.zmp: Float64[np.ndarray, "2"] = np.zeros(2)
        self.loads: Float64[np.ndarray, "2"] = np.zeros(2)
        self._fresh = True

    def update(self, state: RobotState, dynamics: Dynamics) -> None:
        """Reads one measurement.

        Args:
            state: with the soles' wrenches.
            dynamics: of the estimated state, which says where the soles are.
        """
        pressure, nothing = np.zeros(3), np.zeros(6)
        for i, (frame_id, name) in enumerate(zip(self._frames, self._names, strict=True)):
            wrench = state.contacts.get(name, nothing)
            load = float(wrench[2])
            self.loads[i] = load = load if load > 0.0 else 0.0
            if load > self._least:
                frame = dynamics.frame(frame_id)
                offset = np.array([-wrench[4] / load, wrench[3] / load, 0.0])
                pressure += load * (frame.position + frame.rotation @ offset)
        total = float(sum(load for load in self.loads if load > self._least))
        if total <= 0.0:
            return
        centre = pressure[:2] / total
        self.zmp = centre if self._fresh else self.zmp + self._share * (centre - self.zmp)
        self._fresh = False
