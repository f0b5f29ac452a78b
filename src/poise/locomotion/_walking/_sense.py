"""`WalkSense`: what a walker needs to know of the robot's state, and how feet meet the ground.

`expect_step`: where a step will catch the robot, for the balance limit of its stack.
"""

import math
from collections.abc import Sequence

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise.dynamics import LoadedModel, Payload, RobotState
from poise.locomotion._support import Point, SolePart, SupportPolygon, both_soles, sole_rectangle
from poise.locomotion._walking._footsteps import Stand
from poise.locomotion._walking._ground import Placement
from poise.locomotion._walking._settings import WalkSettings
from poise.locomotion._walking._swing import SwingFoot
from poise.robots import Robot
from poise.stack import BalanceLimit

ENGAGE, RELEASE = 0.4, 0.5
"""Ratios of the double support in which the landed foot is loaded and the next one unloaded."""

LONGEST_TICK = 0.05
"""A clock that jumps farther than this moves a walk on no farther [s]."""


class WalkSense:
    """Centre of mass and soles of a state; a fifth of what a controller computes.

    Attributes:
        com: centre of mass [m].
        com_velocity: its velocity [m/s].
        weight: of the robot as it is described [N].
    """

    def __init__(self, robot: Robot, soles: tuple[str, str]) -> None:
        self._robot, self._model, self._data = robot, robot.model, robot.model.createData()
        self._payload: Payload | None = None
        self._loaded: LoadedModel | None = None
        self._soles, self.weight = soles, robot.weight
        self._ids = [robot.frame_id(name) for name in soles]
        found = [robot.soles[name] for name in soles]
        self._edges = [0.5 * sole.width if sole.leans else 0.0 for sole in found]
        self._state: RobotState | None = None
        self._wrenches: list[Float64[np.ndarray, "6"] | None] = [None, None]
        self.com: Float64[np.ndarray, "3"] = self._data.com[0]
        self.com_velocity: Float64[np.ndarray, "3"] = self._data.vcom[0]

    def update(self, state: RobotState) -> None:
        """Takes a state in."""
        if state.payload is not self._payload:
            self._carry(state.payload)
        pin.centerOfMass(self._model, self._data, state.q, state.v, False)
        self._state, self._wrenches = state, [state.wrench(sole) for sole in self._soles]

    def _wrench(self, state: RobotState, foot: int) -> Float64[np.ndarray, "6"] | None:
        """Wrench on a sole, read once for the state of the tick."""
        return self._wrenches[foot] if state is self._state else state.wrench(self._soles[foot])

    def _carry(self, payload: Payload | None) -> None:
        """Where the COM is with a payload."""
        if self._loaded is None:
            self._loaded = LoadedModel(self._robot)
            self._model = self._loaded.model
        self._loaded.carry(payload)
        self._payload = payload

    def sole(self, foot: int) -> tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3 3"]]:
        """Position [m] and rotation of a sole in the world."""
        placement = pin.updateFramePlacement(self._model, self._data, self._ids[foot])
        return placement.translation, placement.rotation

    def lower_edge(self, foot: int) -> tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3 3"]]:
        """Position [m] and rotation of a sole, but as high as the lower edge of one that leans."""
        position, rotation = self.sole(foot)
        return position - np.array([0.0, 0.0, self.edge_drop(foot)[0]]), rotation

    def edge_drop(self, foot: int) -> tuple[float, float]:
        """How far the lower edge of a sole that leans is below its middle [m], with rate [m/s]."""
        half = self._edges[foot]
        if half == 0.0:
            return 0.0, 0.0
        tilt = float(self.sole(foot)[1][2, 1])
        turning = pin.getFrameVelocity(self._model, self._data, self._ids[foot]).angular
        return half * abs(tilt), math.copysign(half, tilt) * float(turning[0])

    def lower_edge_velocity(self, foot: int) -> Float64[np.ndarray, "3"]:
        """Velocity of what `lower_edge` gives the position of, along the world's axes [m/s]."""
        frame, axes = self._ids[foot], pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        velocity = pin.getFrameVelocity(self._model, self._data, frame, axes).linear
        return velocity - np.array([0.0, 0.0, self.edge_drop(foot)[1]])

    def sole_velocity(self, foot: int) -> Float64[np.ndarray, "3"]:
        """Of a sole's centre, along its own axes [m/s]."""
        frame, axes = self._ids[foot], pin.ReferenceFrame.LOCAL
        return pin.getFrameVelocity(self._model, self._data, frame, axes).linear

    def sole_turning(self, foot: int) -> Point:
        """Angular velocity of a sole about its own x and y [rad/s]."""
        frame, axes = self._ids[foot], pin.ReferenceFrame.LOCAL
        x, y, _ = pin.getFrameVelocity(self._model, self._data, frame, axes).angular.tolist()
        return x, y

    def placement(self, foot: int) -> Placement:
        """Where a sole lies."""
        position, rotation = self.lower_edge(foot)
        x, y, z = position.tolist()
        yaw = math.atan2(float(rotation[1, 0]), float(rotation[0, 0]))
        return Placement(position=(x, y, z), yaw=yaw)

    def corners(
        self, feet: tuple[int, ...], sizes: tuple[tuple[float, float], tuple[float, float]]
    ) -> list[Point]:
        """Corners of soles, seen from above [m]."""
        corners: list[Point] = []
        for foot in feet:
            corners += sole_rectangle(*self.sole(foot), sizes[foot])
        return corners

    def support(
        self,
        feet: tuple[int, ...],
        stand: Stand,
        margin: float,
        parts: Sequence[SolePart | None] = (None, None),
    ) -> SupportPolygon:
        """Return the support polygon."""
        foot, *others = feet
        if not others:
            bears = SolePart(*stand.bearings[foot])
            return SupportPolygon(bears.corners(*self.sole(foot), margin), 0.0)
        return both_soles([self.sole(f) for f in (0, 1)], stand.sizes, margin, parts)

    def load(self, state: RobotState, foot: int, *, stands: bool = True) -> float:
        """What a foot carries of the weight; where nothing is measured, all of it if it stands."""
        wrench = self._wrench(state, foot)
        return float(stands) if wrench is None else float(wrench[2]) / self.weight

    def felt(self, state: RobotState, foot: int) -> Float64[np.ndarray, "3"]:
        """Force on a sole, in the world, over the weight; none where none is measured."""
        wrench = self._wrench(state, foot)
        if wrench is None:
            return np.zeros(3)
        return self.sole(foot)[1] @ wrench[:3] / self.weight

    def is_down(
        self, swing: SwingFoot, state: RobotState, foot: int, settings: WalkSettings
    ) -> bool:
        """Whether a foot in the air has come to the ground."""
        wrench = self._wrench(state, foot)
        if wrench is None:
            # Nothing is measured: the foot is down when it should be.
            return swing.phase >= 1.0
        loaded = bool(wrench[2] >= settings.touchdown_force * self.weight)
        return loaded and (swing.phase >= settings.early or swing.searching)


def expect_step(
    limit: BalanceLimit,
    position: tuple[float, float, float],
    yaw: float,
    size: tuple[float, float],
    adjust: float,
) -> None:
    """Tells a balance limit where a step will catch the robot."""
    length, width = (side + 2.0 * adjust for side in size)
    rotation = pin.utils.rotate("z", yaw)
    limit.expect_step(sole_rectangle(np.array(position), rotation, (length, width)))
