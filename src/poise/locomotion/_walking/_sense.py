"""`WalkSense`: centre of mass, soles, loads and ZMP of a state, read once a tick."""

import math
from collections.abc import Sequence

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._compiled import MemoryBlock, allocate, compiled, view
from poise.dynamics import (
    BIAS,
    KINEMATICS,
    ROTATION,
    VELOCITY,
    Dynamics,
    Frames,
    LoadedModel,
    Motion,
    PayloadEstimate,
    RobotState,
    frames_of,
    motion_of,
    place_frame,
)
from poise.locomotion._support import Point, Rotation, Vector2, Vector3
from poise.locomotion._walking._ground import Placement, yaw_of
from poise.robots import Robot
from poise.stack import FrameTask

LOADING = 0.4
"""Part of the double support in which the landed foot is loaded, and the next one unloaded."""

UNLOADED, LOADED = 0.02, 0.1
"""Parts of the weight below which a sole carries nothing, and from which it lies on the ground."""

IDLE = 0.01
"""Part of the weight below which a stance foot, or one that has landed, does not stand."""

LONGEST_TICK = 0.05
"""A clock that jumps farther than this moves a walk on no farther [s]."""

_Pose = tuple[Vector3, Rotation]


class _SoleMemory(MemoryBlock):
    motion: Motion
    frames: Frames  # the soles
    seen: Float64[np.ndarray, "soles room"]  # of each, as `place_frame` fills it


class WalkSense:
    """Centre of mass, soles, loads and ZMP of the last state.

    The ZMP, (-m_y, m_x) / f_z of both soles, is smoothed by a gain a tick, and the last one while
    no sole presses; without a gain it is not computed.
    """

    def __init__(
        self,
        robot: Robot,
        soles: tuple[str, str],
        dynamics: Dynamics | None = None,
        *,
        gain: float | None = None,
    ) -> None:
        self._robot, self._model, self._dynamics = robot, robot.model, dynamics
        self._data = data = robot.model.createData()
        self._payload: PayloadEstimate | None = None
        self._loaded: LoadedModel | None = None
        self._soles, self.weight = soles, robot.weight
        found = [robot.soles[name] for name in soles]
        self._edges = [0.5 * sole.width if sole.leans else 0.0 for sole in found]
        self._gain = gain
        self.reset()
        motion = motion_of(robot.model, data) if dynamics is None else dynamics.motion
        self._memory = memory = allocate(
            _SoleMemory,
            {"soles": 2, "room": KINEMATICS},
            motion=motion,
            frames=frames_of(robot.model, [robot.frame_id(name) for name in soles]),
        )
        self._seen, self._com, self._com_velocity = memory.seen, data.com[0], data.vcom[0]
        # Compiled now, not in the first tick.
        self._look(self._com, self._com_velocity)

    def reset(self) -> None:
        """Nothing has been measured."""
        self.state: RobotState | None = None  # the last one
        self.wrenches: list[list[float] | None] = [None, None]
        self.loads: Vector2 = np.zeros(2)  # normal forces, left and right [N]
        # Centre of pressure of a sole that presses, in its own axes [m].
        self.centres: list[Point | None] = [None, None]
        self.zmp: Vector2 = np.zeros(2)  # x and y [m]
        self._fresh = True

    def update(self, state: RobotState) -> None:
        """Take a state in."""
        if self._dynamics is not None:
            if state is self.state:
                return
            self._look(self._dynamics.com, self._dynamics.com_velocity)
        else:
            if state.payload is not self._payload:
                self._loaded = self._loaded or LoadedModel(self._robot)
                self._loaded.carry(state.payload)
                self._model, self._payload = self._loaded.model, state.payload
            pin.centerOfMass(self._model, self._data, state.q, state.v, False)
            self._look(self._com, self._com_velocity)
        self.state = state
        found = [state.wrench(sole) for sole in self._soles]
        self.wrenches = [None if wrench is None else wrench.tolist() for wrench in found]
        if self._gain is not None:
            self._press(self._gain)

    def _press(self, gain: float) -> None:
        """Smooth the ZMP by the centres of pressure of the soles."""
        pressed_x = pressed_y = total = 0.0
        for i, wrench in enumerate(self.wrenches):
            _, _, load, mx, my, _ = wrench or (0.0,) * 6
            self.loads[i] = load = load if load > 0.0 else 0.0
            presses = load > UNLOADED * self.weight
            self.centres[i] = (-my / load, mx / load) if presses else None
            if presses:
                (x, y, _), R = self.positions[i], self.rotations[i]
                pressed_x += load * x - R[0] * my + R[1] * mx
                pressed_y += load * y - R[3] * my + R[4] * mx
                total += load
        if total <= 0.0:
            return
        x, y = pressed_x / total, pressed_y / total
        if not self._fresh:
            before_x, before_y = self.zmp.tolist()
            x, y = before_x + gain * (x - before_x), before_y + gain * (y - before_y)
        self.zmp, self._fresh = np.array([x, y]), False

    def _look(self, com: Vector3, com_velocity: Vector3) -> None:
        """Copy what is evaluated, as plain numbers."""
        _see(self._memory.address)
        self._rows = self._seen.copy()
        self._poses: dict[int, _Pose] = {}
        left, right = self._rows.tolist()
        self.positions = left[:ROTATION], right[:ROTATION]  # of the left and the right sole [m]
        # World_R_sole row by row; linear then angular along the sole's own axes [m/s, rad/s].
        self.rotations = left[ROTATION:VELOCITY], right[ROTATION:VELOCITY]
        self.velocities = left[VELOCITY:BIAS], right[VELOCITY:BIAS]
        self.com, self.com_velocity = com.tolist(), com_velocity.tolist()

    def sole(self, foot: int) -> _Pose:
        """Return position [m] and rotation of a sole in the world."""
        pose = self._poses.get(foot)
        if pose is None:
            row = self._rows[foot]
            pose = self._poses[foot] = row[:ROTATION], row[ROTATION:VELOCITY].reshape(3, 3)
        return pose

    def frames(self, tasks: Sequence[FrameTask]) -> list[pin.SE3]:
        """Return the poses of the frames of tasks in the last state."""
        data = self._model.createData()
        assert self.state is not None
        pin.framesForwardKinematics(self._model, data, self.state.q)
        return [data.oMf[self._robot.frame_id(task.frame)].copy() for task in tasks]

    def lower_edge(self, foot: int) -> _Pose:
        """Return `sole`, but as high as the lower edge of one that leans."""
        position, rotation = self.sole(foot)
        return position - np.array([0.0, 0.0, self.edge_drop(foot)[0]]), rotation

    def edge_drop(self, foot: int) -> tuple[float, float]:
        """Return the depth of a leaning sole's lower edge below its middle, with rate [m, m/s]."""
        half = self._edges[foot]
        if half == 0.0:
            return 0.0, 0.0
        tilt = self.rotations[foot][7]
        return half * abs(tilt), math.copysign(half, tilt) * self.velocities[foot][3]

    def lower_edge_velocity(self, foot: int) -> tuple[float, float, float]:
        """Return the velocity of `lower_edge` in the world [m/s]."""
        x, y, z = self._in_world(foot, self.velocities[foot])
        return x, y, z - self.edge_drop(foot)[1]

    def _in_world(self, foot: int, vector: list[float]) -> tuple[float, float, float]:
        """Return a vector along a sole's axes along those of the world."""
        (x, y, z, *_), R = vector, self.rotations[foot]
        return (
            R[0] * x + R[1] * y + R[2] * z,
            R[3] * x + R[4] * y + R[5] * z,
            R[6] * x + R[7] * y + R[8] * z,
        )

    def placement(self, foot: int) -> Placement:
        """Return where a sole lies."""
        position, rotation = self.lower_edge(foot)
        x, y, z = position.tolist()
        return Placement(position=(x, y, z), yaw=yaw_of(rotation))

    def load(self, foot: int, *, stands: bool = True) -> float:
        """Return a foot's part of the weight; where nothing is measured, all of it if it stands."""
        wrench = self.wrenches[foot]
        return float(stands) if wrench is None else wrench[2] / self.weight

    def relative_force(self, foot: int) -> tuple[float, float, float]:
        """Return the force on a sole, in the world, over the weight; zero without a measurement."""
        wrench = self.wrenches[foot]
        if wrench is None:
            return 0.0, 0.0, 0.0
        x, y, z = self._in_world(foot, wrench)
        return x / self.weight, y / self.weight, z / self.weight


@compiled
def _see(address: int) -> None:
    """Evaluate both soles."""
    m = view(_SoleMemory, address)
    for sole in range(len(m.seen)):
        place_frame(m.motion, m.frames, sole, m.seen[sole], 0)
