"""`PayloadEstimate`: deviation of a robot's mass and centre of mass from its description.

`LoadedModel`: a robot's model with a payload.
"""

import math
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._checks import all_finite
from poise.errors import ConfigurationError
from poise.robots import Robot

LEAST_MASS = 0.2
"""Least mass of a robot, by that of its description."""


@dataclass(frozen=True, slots=True, eq=False)
class PayloadEstimate:
    """Deviation of a robot from its description in mass, centre of mass and loads of hands.

    Attributes:
        mass: beyond the description's, without loads of hands [kg]; negative for a lighter robot.
        offset: of the centre of mass without loads of hands from the description's, along the axes
            of the torso's frame [m].
        held: masses at the hands' frames, in the order of `Robot.hands`; empty for none [kg].

    Raises:
        ConfigurationError: numbers that are not finite, not three of them, or a negative mass in a
            hand.
    """

    mass: float
    offset: Float64[np.ndarray, "3"]
    held: Float64[np.ndarray, " h"] = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        try:
            # The caller may write over its arrays.
            offset = np.array(self.offset, dtype=np.float64)
            held = np.array(self.held, dtype=np.float64)
            finite = math.isfinite(self.mass) and all_finite(offset)
        except (TypeError, ValueError):
            offset, held, finite = np.zeros(3), np.zeros(0), False
        # Written so that NaN fails.
        fits = finite and offset.shape == (3,) and held.ndim == 1
        if not (fits and all(0.0 <= load < math.inf for load in held.tolist())):
            raise ConfigurationError(
                "payload of a robot",
                got=(self.mass, self.offset, self.held),
                wanted="a finite mass [kg], three finite numbers [m], and no negative mass in a "
                "hand [kg]",
            )
        offset.flags.writeable = held.flags.writeable = False
        object.__setattr__(self, "offset", offset)
        object.__setattr__(self, "held", held)


class LoadedModel:
    """A copy of a robot's Pinocchio model whose inertias are changed in place by a payload.

    Ground forces show mass and centre of mass, not the place of a load. So all links become heavier
    in the same ratio s = 1 + mass / m, and the torso's own centre moves by m offset / m_torso:
    inertias stay consistent, and the mass matrix positive definite, for lighter robots too. Loads
    of hands are points at the hands' frames, as in `Robot.carrying`.

    Attributes:
        model: the copy; its data's layout is that of the robot's own model.
    """

    def __init__(self, robot: Robot) -> None:
        self.model = robot.model.copy()
        self._mass = robot.mass
        bare = [pin.Inertia(inertia) for inertia in robot.model.inertias]
        # One array of each kind, scaled in one operation.
        self._masses = np.array([inertia.mass for inertia in bare])
        self._levers = np.array([inertia.lever for inertia in bare])
        self._inertias = np.array([inertia.inertia for inertia in bare])
        # The links as they lie in the copy, whose order never changes.
        self._links = [self.model.inertias[joint] for joint in range(len(bare))]
        torso = robot.model.frames[robot.frame_id(robot.torso)]
        # The joint of the torso, or the nearest before it whose link has a mass.
        self._torso = int(torso.parentJoint)
        while self._torso > 1 and self._masses[self._torso] <= 0.0:
            self._torso = int(robot.model.parents[self._torso])
        frames = (robot.model.frames[robot.frame_id(hand)] for hand in robot.hands)
        self._hands = [(f.parentJoint, f.placement.translation.copy()) for f in frames]
        data = robot.model.createData()
        pin.forwardKinematics(robot.model, data, pin.neutral(robot.model))
        turn = data.oMi[self._torso].rotation.T @ data.oMi[torso.parentJoint].rotation
        self._link_R_torso = turn @ torso.placement.rotation

    def carry(self, payload: PayloadEstimate | None) -> None:
        """Replace the payload."""
        mass, offset = (0.0, np.zeros(3)) if payload is None else (payload.mass, payload.offset)
        ratio = max(1.0 + mass / self._mass, LEAST_MASS)
        masses, inertias = (ratio * self._masses).tolist(), ratio * self._inertias
        for link, link_mass, inertia in zip(self._links, masses, inertias, strict=True):
            # In parts: a new `Inertia` is refused where rounding makes a zero inertia negative.
            link.mass, link.inertia = link_mass, inertia
        for joint, _ in self._hands:
            self._links[joint].lever = self._levers[joint]
        moved = self._link_R_torso @ offset * (self._mass / self._masses[self._torso])
        self._links[self._torso].lever = self._levers[self._torso] + moved
        held = () if payload is None else payload.held.tolist()
        for (joint, place), load in zip(self._hands, held, strict=False):
            if load > 0.0:
                self.model.inertias[joint] += pin.Inertia(load, place, np.zeros((3, 3)))
