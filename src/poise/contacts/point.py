"""`PointContact`: a point that can push but not twist."""

import numpy as np
from jaxtyping import Float64

from poise.contacts.contact import Contact
from poise.robots.robot import Robot


class PointContact(Contact):
    """A point contact: three forces in a friction pyramid, no moment.

    With f along the contact's axes: |f_x| <= friction f_z, |f_y| <= friction f_z. Only the linear
    acceleration of the frame is held.

    Args:
        frame: the frame in contact; its z axis is the contact normal.
        friction: Coulomb coefficient of the pyramid.
        damping: how fast a residual velocity dies out [1/s].
        min_load: least normal force while loaded, as a share of the robot's weight.
        name: what reports call it; the frame when None.
    """

    def __init__(
        self,
        frame: str,
        *,
        friction: float = 0.7,
        damping: float = 20.0,
        min_load: float = 0.02,
        name: str | None = None,
    ) -> None:
        super().__init__(
            frame, friction=friction, damping=damping, min_load=min_load, dim=3, name=name
        )

    def _make_cone(self, robot: Robot) -> Float64[np.ndarray, "rows dim"]:  # noqa: ARG002
        mu = self.friction
        return np.array([[1.0, 0.0, -mu], [-1.0, 0.0, -mu], [0.0, 1.0, -mu], [0.0, -1.0, -mu]])
