"""`Dynamics`: everything about one state of a robot, computed once a tick.

`RobotState`: input of a controller each tick.
`SensorReadings`: further readings, for estimators.
`FrameKinematics`: pose, velocity and acceleration of one frame.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._checks import Numbers, all_finite, is_array
from poise.dynamics._motion import (
    BIAS,
    KINEMATICS,
    ROTATION,
    VELOCITY,
    FrameMemory,
    StateNumbers,
    evaluate_centroid,
    evaluate_frame,
    frames_of,
    motion_of,
)
from poise.dynamics._payload import LoadedModel, PayloadEstimate
from poise.robots import Robot

_NUMBER = np.dtype(np.float64)

LARGEST = 1e6
"""Larger positions and speeds are no robot's [m, rad, m/s, rad/s]; far beyond, squares overflow."""


class SensorReadings(NamedTuple):
    """Readings of a robot's sensors besides its joints and soles, for an estimator.

    Attributes:
        angular_velocity: of the inertial unit, along its own axes [rad/s].
        specific_force: acceleration less gravity, along the same axes: upwards where it stands
            still; a mean since the last reading is better than a sample [m/s^2].
        torque: of the joints' motors, empty where it is not measured [N m].
    """

    angular_velocity: Float64[np.ndarray, "3"]
    specific_force: Float64[np.ndarray, "3"]
    torque: Float64[np.ndarray, " nj"]


@dataclass(frozen=True, slots=True, init=False)
class RobotState:
    """Configuration and velocity of a robot, measured or estimated.

    Lists, float32 and whole numbers become arrays of float64; arrays of float64 are not copied. Not
    validated when made, because it is made every tick: other values are kept, and a controller
    checks them all and returns a status.

    Attributes:
        q: configuration as Pinocchio orders it: base position in the world [m], base quaternion
            (x, y, z, w), joints [rad]; joints alone for a fixed base.
        v: velocity: base linear [m/s] and angular [rad/s] in the base frame, joints [rad/s].
        contacts: measured wrench [force; moment] on the robot by sole name, in the sole's frame at
            the sole's centre [N, N m]; empty where nothing is measured.
        time: time of the measurement [s].
        readings: of sensors that only an estimator needs; None where there are none.
        payload: deviation of mass and centre of mass from the description; None for none. The same
            object is assumed to be unchanged.
    """

    q: Float64[np.ndarray, " nq"]
    v: Float64[np.ndarray, " nv"]
    contacts: Mapping[str, Float64[np.ndarray, "6"]] = field(default_factory=dict)
    time: float = 0.0
    readings: SensorReadings | None = None
    payload: PayloadEstimate | None = None

    def __init__(
        self,
        q: Numbers,
        v: Numbers,
        contacts: Mapping[str, Float64[np.ndarray, "6"]] | None = None,
        time: float | np.generic = 0.0,
        readings: SensorReadings | None = None,
        payload: PayloadEstimate | None = None,
    ) -> None:
        take = object.__setattr__
        take(self, "q", q if type(q) is np.ndarray and q.dtype == _NUMBER else _as_numbers(q))
        take(self, "v", v if type(v) is np.ndarray and v.dtype == _NUMBER else _as_numbers(v))
        take(self, "contacts", {} if contacts is None else contacts)
        take(self, "time", time.item() if isinstance(time, np.generic) else time)
        take(self, "readings", readings)
        take(self, "payload", payload)

    def wrench(self, sole: str) -> Float64[np.ndarray, "6"] | None:
        """Return the measured wrench of a sole; None without one of six finite numbers.

        Args:
            sole: its name.
        """
        contacts = self.contacts
        if type(contacts) is CheckedWrenches:
            return contacts.usable.get(sole)
        found = contacts.get(sole)
        return None if found is None else _usable_wrench(found)


class CheckedWrenches(dict[str, Float64[np.ndarray, "6"]]):
    """Wrenches for `RobotState.contacts`, checked once; `usable` are six finite numbers each."""

    __slots__ = ("usable",)

    def __init__(self, contacts: Mapping[str, Float64[np.ndarray, "6"]]) -> None:
        super().__init__(contacts)
        # Those of the same kind were checked already.
        known = contacts.usable if type(contacts) is CheckedWrenches else {}
        found = known or {name: _usable_wrench(wrench) for name, wrench in contacts.items()}
        self.usable = {name: wrench for name, wrench in found.items() if wrench is not None}


def _usable_wrench(found: Numbers) -> Float64[np.ndarray, "6"] | None:
    """Return six finite numbers, or None."""
    if type(found) is not np.ndarray or found.dtype != _NUMBER:
        found = _as_numbers(found)
    return found if is_array(found, 6) and all_finite(found) else None


def _as_numbers(value: Numbers) -> Numbers:
    """Convert to an array of float64 where that is possible."""
    # Subclasses of arrays, as one that counts operations, are kept.
    if type(value) not in (np.ndarray, list, tuple):
        return value
    try:
        # NumPy would convert text, too.
        found = np.asarray(value)
        return found.astype(np.float64) if found.dtype.kind in "fiu" else value
    except (TypeError, ValueError, OverflowError):
        return value


class FrameKinematics(NamedTuple):
    """Kinematics of one frame at one state.

    Spatial vectors put the linear part first and are expressed along the world's axes at the
    frame's origin (`LOCAL_WORLD_ALIGNED`). The bias is classical, so that
    `acceleration = jacobian @ dv + bias`.

    Attributes:
        position: origin of the frame in the world [m].
        rotation: world_R_frame.
        jacobian: maps `v` to the frame's velocity.
        velocity: linear [m/s] and angular [rad/s] velocity.
        bias: classical acceleration at zero `dv` [m/s^2, rad/s^2].
    """

    position: Float64[np.ndarray, "3"]
    rotation: Float64[np.ndarray, "3 3"]
    jacobian: Float64[np.ndarray, "6 nv"]
    velocity: Float64[np.ndarray, "6"]
    bias: Float64[np.ndarray, "6"]


Placement = tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3 3"]]
"""Origin of a frame in the world [m], and world_R_frame."""


class Dynamics:
    """Mass matrix, nonlinear effects, frames, CoM and centroidal momentum of one state.

    `update` runs Pinocchio's recursions once; frames and momentum are evaluated at their first use
    and kept until the next `update`, so that two tasks on one frame cost one evaluation. The next
    `update` overwrites `M`, `h` and `momentum_matrix` in place; other results are copies.

    The equation of motion is

        M dv + h = S^T tau + sum_i J_i^T F_i

    with `F_i` the wrench on the robot at contact i.

    Args:
        robot: the robot; its Pinocchio model is shared and not changed. A state with a payload is
            computed on a copy, made at the first one.

    Attributes:
        robot: the robot.
        state: the state of the last `update`.
        M: mass matrix, both triangles, rotor inertias included [kg, kg m, kg m^2].
        h: nonlinear effects: Coriolis, centrifugal and gravity forces [N, N m].
        momentum_matrix: centroidal momentum matrix A_G, maps `v` to `momentum`.
        motion: the same memory for compiled code.
        q: configuration of the last `update`, for compiled code.
        v: velocity.
        numbers: all of it for compiled code.
    """

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.state: RobotState = RobotState(robot.q_home, np.zeros(robot.nv))
        self._model, self._data = robot.model, robot.model.createData()
        self._payload: PayloadEstimate | None = None
        self._loaded: LoadedModel | None = None
        # `M` and `h` are its own arrays; `M` gets both triangles, and its transpose is row-major.
        data = self._data
        self._frames: dict[int, FrameKinematics] = {}
        self._places: dict[int, Placement] = {}
        # Pinocchio's own memory of frames, to be copied.
        self._seen: dict[int, Placement] = {}
        self._frame_memory: dict[int, FrameMemory] = {}
        self._com: Float64[np.ndarray, "3"] | None = None
        self._com_velocity: Float64[np.ndarray, "3"] | None = None
        self._has_momenta = False
        self.M: Float64[np.ndarray, "nv nv"] = data.M.T
        self.h: Float64[np.ndarray, " nv"] = data.nle
        self.motion = motion_of(robot.model, data)
        self.momentum_matrix: Float64[np.ndarray, "6 nv"] = self.motion.momentum.T
        self.q: Float64[np.ndarray, " nq"] = np.zeros(robot.nq)
        self.v: Float64[np.ndarray, " nv"] = np.zeros(robot.nv)
        self.numbers = StateNumbers(
            q=self.q, v=self.v, M=self.M, h=self.h, motion=self.motion, centroid=np.zeros(12)
        )
        self.update(self.state)
        # What is compiled is compiled now, not in the first tick.
        self.frame(0)
        self._momenta()

    def update(self, state: RobotState) -> None:
        """Compute everything for a state.

        Args:
            state: configuration and velocity; must be finite and of the robot's size, which the
                controllers check.
        """
        self.state = state
        self._frames.clear()
        self._places.clear()
        self._com = self._com_velocity = None
        self._has_momenta = False
        self.q[:], self.v[:] = state.q, state.v
        if state.payload is not self._payload:
            self._carry(state.payload)
        # In the world's convention CRBA leaves the joints' Jacobians and A_G behind, too.
        pin.crba(self._model, self._data, self.q, pin.Convention.WORLD)
        pin.nonLinearEffects(self._model, self._data, self.q, self.v)

    def _carry(self, payload: PayloadEstimate | None) -> None:
        """Replace the payload."""
        if self._loaded is None:
            self._loaded = LoadedModel(self.robot)
            self._model = self._loaded.model
        self._loaded.carry(payload)
        self._payload = payload
        self.motion.mass[0] = pin.computeTotalMass(self._model)

    @property
    def com(self) -> Float64[np.ndarray, "3"]:
        """Centre of mass in the world [m]; the same array until the next `update`."""
        com = self._com
        if com is None:
            com = self._com = self.motion.com.copy()
        return com

    @property
    def com_velocity(self) -> Float64[np.ndarray, "3"]:
        """Velocity of the CoM [m/s]; the same array until the next `update`."""
        velocity = self._com_velocity
        if velocity is None:
            velocity = self._com_velocity = self._momenta()[:3] / self.motion.mass[0]
        return velocity

    @property
    def com_jacobian(self) -> Float64[np.ndarray, "3 nv"]:
        """Maps `v` to the CoM's velocity."""
        return self.momentum_matrix[:3] / self.motion.mass[0]

    @property
    def com_bias(self) -> Float64[np.ndarray, "3"]:
        """Acceleration of the CoM at zero `dv` [m/s^2]."""
        return self._momenta()[6:9] / self.motion.mass[0]

    @property
    def momentum(self) -> Float64[np.ndarray, "6"]:
        """Centroidal momentum, linear [kg m/s] then angular about the CoM [kg m^2/s]."""
        return self._momenta()[:6].copy()

    @property
    def momentum_bias(self) -> Float64[np.ndarray, "6"]:
        """Rate of `momentum` at zero `dv` [N, N m]."""
        return self._momenta()[6:].copy()

    def frame(self, frame_id: int) -> FrameKinematics:
        """Return the kinematics of a frame, evaluated once a tick.

        Args:
            frame_id: index from `Robot.frame_id`.

        Returns:
            The frame's kinematics; valid until the next `update`.
        """
        kinematics = self._frames.get(frame_id)
        if kinematics is not None:
            return kinematics
        memory = self._frame_memory.get(frame_id)
        if memory is None:
            memory = self._frame_memory[frame_id] = FrameMemory(
                motion=self.motion,
                frames=frames_of(self.robot.model, [frame_id]),
                out=np.zeros(KINEMATICS),
                jacobian=np.zeros((6, self.robot.nv)),
            )
        evaluate_frame(memory.address)
        out, jacobian = memory.out.copy(), memory.jacobian.copy()
        rotation, velocity = out[ROTATION:VELOCITY].reshape(3, 3), out[VELOCITY:BIAS]
        found = FrameKinematics(out[:ROTATION], rotation, jacobian, velocity, out[BIAS:])
        return self._frames.setdefault(frame_id, found)

    def placement(self, frame_id: int) -> Placement:
        """Return position and rotation of a frame, in a fifth of the time of `frame`.

        Args:
            frame_id: index from `Robot.frame_id`.

        Returns:
            Its origin in the world [m], and world_R_frame.
        """
        placement = self._places.get(frame_id)
        if placement is None:
            pin.updateFramePlacement(self.robot.model, self._data, frame_id)
            seen = self._seen.get(frame_id)
            if seen is None:
                found = self._data.oMf[frame_id]
                seen = self._seen[frame_id] = found.translation, found.rotation
            placement = self._places[frame_id] = seen[0].copy(), seen[1].copy()
        return placement

    @property
    def moving_numbers(self) -> tuple[Float64[np.ndarray, " _"], ...]:
        """Results of `update` for compiled code, as flat views, to be copied to other memory."""
        constant = "gravity", "roots"
        moving = [x for name, x in self.motion.arrays().items() if name not in constant]
        return tuple(x.ravel(order="K") for x in (self.q, self.v, self.M, self.h, *moving))

    def joint_position(self, joint_id: int) -> Float64[np.ndarray, "3"]:
        """Return the origin of a joint in the world [m].

        Args:
            joint_id: Pinocchio's index of the joint.
        """
        return self.motion.placements[joint_id, 9:].copy()

    def joint_rotation(self, joint_id: int) -> Float64[np.ndarray, "3 3"]:
        """Return world_R_joint.

        Args:
            joint_id: Pinocchio's index of the joint.
        """
        return self.motion.placements[joint_id, :9].reshape(3, 3).T.copy()

    def _momenta(self) -> Float64[np.ndarray, "12"]:
        """Evaluate centroidal momentum and its rate at zero `dv`, once a tick."""
        numbers = self.numbers
        if not self._has_momenta:
            evaluate_centroid(numbers.address)
            self._has_momenta = True
        return numbers.centroid
