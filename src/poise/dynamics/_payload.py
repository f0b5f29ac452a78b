"""`Payload`: how far a robot is from its description in mass and centre of mass.

`LoadedModel`: a robot's model with that in it.
"""

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.errors import ConfigurationError
from poise.robots import Robot

LEAST_MASS = 0.2
"""A robot keeps at least this part of its description's mass, whatever it is said to have lost."""


@dataclass(frozen=True, slots=True, eq=False)
class Payload:
    """What a robot carries, or is, beside its description, as the ground feels it.

    Attributes:
        mass: beyond the description's [kg]; negative for a robot that is lighter.
        offset: how far the centre of mass is from the description's, along the axes of the torso's
            frame [m].

    Raises:
        ConfigurationError: numbers that are not finite, or not three of them.
    """

    mass: float
    offset: Float64[np.ndarray, "3"]

    def __post_init__(self) -> None:
        offset = np.asarray(self.offset, dtype=np.float64)
        if not (math.isfinite(self.mass) and offset.shape == (3,) and np.isfinite(offset).all()):
            raise ConfigurationError(
                "payload of a robot",
                got=(self.mass, self.offset),
                wanted="a finite mass [kg] and three finite numbers [m]",
            )
        object.__setattr__(self, "offset", offset)


class LoadedModel:
    """A copy of a robot's Pinocchio model whose inertias are changed in place by a payload.

    The ground tells mass and centre of mass, not where a load is. So all links become heavier in
    the same ratio s = 1 + mass / m, and the torso's own centre moves by m offset / m_torso: every
    link stays a body that can be, and the mass matrix positive definite, for lighter robots too.

    Args:
        robot: whose model; it is not changed.

    Attributes:
        model: the copy; its data's layout is that of the robot's own model.
    """

    def __init__(self, robot: Robot) -> None:
        self.model = robot.model.copy()
        self._mass = robot.mass
        self._bare = [pin.Inertia(inertia) for inertia in robot.model.inertias]
        torso = robot.model.frames[robot.frame_id(robot.torso)]
        self._torso = _first_with_mass(robot, torso.parentJoint)
        data = robot.model.createData()
        pin.forwardKinematics(robot.model, data, pin.neutral(robot.model))
        turn = data.oMi[self._torso].rotation.T @ data.oMi[torso.parentJoint].rotation
        self._link_R_torso = turn @ torso.placement.rotation

    def carry(self, payload: Payload | None) -> None:
        """Takes a payload in place of the last one.

        Args:
            payload: None for the description as it is.
        """
        mass, offset = (0.0, np.zeros(3)) if payload is None else (payload.mass, payload.offset)
        ratio = max(1.0 + mass / self._mass, LEAST_MASS)
        for joint, bare in enumerate(self._bare):
            self.model.inertias[joint] = pin.Inertia(
                ratio * bare.mass, bare.lever, ratio * bare.inertia
            )
        bare = self._bare[self._torso]
        moved = bare.lever + self._link_R_torso @ offset * (self._mass / bare.mass)
        self.model.inertias[self._torso] = pin.Inertia(
            ratio * bare.mass, moved, ratio * bare.inertia
        )


def _first_with_mass(robot: Robot, joint: int) -> int:
    """The joint, or the nearest before it whose link has a mass."""
    model = robot.model
    while joint > 1 and model.inertias[joint].mass <= 0.0:
        joint = model.parents[joint]
    return int(joint)
