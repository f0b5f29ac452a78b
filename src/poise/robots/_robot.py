"""`Robot`: immutable description of a robot, without its state."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, wraps
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, TypeVar
from weakref import WeakKeyDictionary

import numpy as np
import pinocchio as pin
from jaxtyping import Float64

from poise._checks import Numbers, checked_kind, checked_number
from poise.errors import ConfigurationError, UnknownNameError


@dataclass(frozen=True, kw_only=True)
class ModelSource:
    """The text a robot was built from, so that a simulator can build its own, independent model."""

    kind: Literal["urdf", "mjcf"]  # the format of `text`
    text: str = field(repr=False)  # the whole URDF or MJCF document
    # where relative mesh paths start, None for a document that names no files
    directory: Path | None = None
    package_dirs: tuple[Path, ...] = ()  # folders in which `package://name/...` is looked up
    # joints of the document that are welded at zero in the robot
    locked_joints: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class FrameRole:
    """A frame that has a part to play (a sole, a hand, the pelvis), fixed to a link."""

    name: str  # the role's name, such as "left_sole"; tasks and contacts use it
    link: str  # the link of the document that carries the frame
    position: Float64[np.ndarray, "3"]  # origin of the frame in the link [m]
    rotation: Float64[np.ndarray, "3 3"]  # orientation of the frame in the link, link_R_frame


@dataclass(frozen=True, kw_only=True)
class Sole:
    """A rectangular foot sole: its frame lies at the sole's centre, x forward, z up."""

    name: str  # the frame role it belongs to
    length: float  # along the frame's x [m]
    width: float  # along the frame's y [m]
    # components of its motion that its leg decides, along the frame's own axes: 0 to 2 for where it
    # is, 3 to 5 for how it is turned. All, unless the leg lacks a joint
    controlled: tuple[int, ...] = (0, 1, 2, 3, 4, 5)

    @property
    def leans(self) -> bool:
        """True where it tilts sideways as its leg leans, and so stands on one of its long edges."""
        return 3 not in self.controlled

    @property
    def turns(self) -> bool:
        """True where its leg can turn it about its normal."""
        return 5 in self.controlled


_FRAME_KINDS = (
    pin.FrameType.BODY,
    pin.FrameType.OP_FRAME,
    pin.FrameType.JOINT,
    pin.FrameType.FIXED_JOINT,
)  # Kinds of frames, in the order in which a name is looked up; roles are named like none else

GRAVITY = 9.81
"""On Earth, as robots' models have it [m/s^2]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Robot:
    """A robot: Pinocchio model, actuated joints, limits, frames with a part to play, home posture.

    Joints are in the order of Pinocchio's velocity vector. Arrays are read-only, and the Pinocchio
    model is shared: never change it.

    Attributes:
        name: name in the catalog, or the file's stem.
        model: Pinocchio model; its `armature` holds the reflected rotor inertias [kg m^2].
        floating_base: whether the first six velocities are an unactuated base.
        joint_names: the actuated joints.
        q_min: lower joint position limits [rad].
        q_max: upper joint position limits [rad].
        v_max: joint velocity limits [rad/s].
        tau_max: joint torque limits [N m].
        soles: soles by name, left first.
        hands: names of the hand frames, left first.
        pelvis: name of the pelvis frame.
        torso: name of the torso frame.
        roles: all frames with a part to play, by name.
        q_home: home configuration, soles on the ground z = 0 [m, rad].
        licence: SPDX identifier or short text of the model's licence.
        source: the document the model was built from.
    """

    name: str
    model: pin.Model = field(repr=False)
    floating_base: bool
    joint_names: tuple[str, ...]
    q_min: Float64[np.ndarray, "nj"] = field(repr=False)
    q_max: Float64[np.ndarray, "nj"] = field(repr=False)
    v_max: Float64[np.ndarray, "nj"] = field(repr=False)
    tau_max: Float64[np.ndarray, "nj"] = field(repr=False)
    soles: Mapping[str, Sole]
    hands: tuple[str, ...]
    pelvis: str
    torso: str
    roles: Mapping[str, FrameRole] = field(repr=False)
    q_home: Float64[np.ndarray, "nq"] = field(repr=False)
    licence: str
    source: ModelSource = field(repr=False)

    def __getstate__(self) -> dict[str, Any]:
        return vars(self) | {"soles": dict(self.soles), "roles": dict(self.roles)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        mappings = {name: MappingProxyType(state[name]) for name in ("soles", "roles")}
        vars(self).update(state | mappings)
        places = (x for role in self.roles.values() for x in (role.position, role.rotation))
        for array in (self.q_min, self.q_max, self.v_max, self.tau_max, self.q_home, *places):
            array.flags.writeable = False

    def __deepcopy__(self, memo: object) -> "Robot":
        return self  # It never changes, and what is bound to it stays so.

    def __repr__(self) -> str:
        parts = [f"{self.nj} joints", f"{self.mass:.1f} kg", *self.soles, *self.hands]
        return f"Robot({self.name!r}: {', '.join(parts)})"

    def show(self, q: Numbers | None = None) -> Any:
        """A figure of the robot as lines, with its soles, hands and centre of mass.

        Args:
            q: configuration [m, rad]; the home posture when None.

        Returns:
            A `matplotlib.figure.Figure`, which a notebook shows and `savefig` writes.

        Raises:
            ConfigurationError: `q` is no configuration of this robot.
            MissingExtraError: matplotlib is not installed.
        """
        from poise.robots._figure import draw_robot

        at = self.q_home if q is None else _checked_numbers(q, "configuration [m, rad]", self.nq)
        return draw_robot(self, at)

    def carrying(self, frame: str, mass: float, offset: Numbers = (0.0, 0.0, 0.0)) -> "Robot":
        """Return the robot with a load rigidly attached, for its controller's model.

        A simulated plant is built from the document and has payloads of its own.

        Args:
            frame: that holds it, such as "right_hand".
            mass: of the load, as a point [kg].
            offset: its centre of mass in the frame [m].

        Returns:
            A new robot.

        Raises:
            UnknownNameError: no such frame.
            ConfigurationError: a frame, a mass or an offset that cannot be.
        """
        checked_number(mass, "mass of the load [kg]", above=0.0)
        center = _checked_numbers(offset, "offset of the load [m]", 3)
        held = self.model.frames[self.frame_id(frame)]
        model = self.model.copy()
        load = pin.Inertia(float(mass), np.zeros(3), np.zeros((3, 3)))
        place = held.placement * pin.SE3(np.eye(3), center)
        model.appendBodyToJoint(held.parentJoint, load, place)
        return replace(self, model=model)

    @cached_property
    def nq(self) -> int:
        """Length of the configuration vector."""
        return self.model.nq

    @cached_property
    def nv(self) -> int:
        """Length of the velocity vector."""
        return self.model.nv

    @property
    def nj(self) -> int:
        """Number of actuated joints."""
        return len(self.joint_names)

    @property
    def base_dofs(self) -> int:
        """Six for a floating base, zero for a fixed one: where the joints start in `v`."""
        return 6 if self.floating_base else 0

    @property
    def mass(self) -> float:
        """Total mass [kg]."""
        return float(pin.computeTotalMass(self.model))

    @property
    def weight(self) -> float:
        """Total weight on Earth [N]."""
        return self.mass * GRAVITY

    def frame_id(self, name: str) -> int:
        """Pinocchio's index of a frame, by role or by the document's own link or frame name.

        Where a link and a joint have one name, it means the link.

        Raises:
            UnknownNameError: no such frame; the message lists those that exist.
            ConfigurationError: the name is no text.
        """
        checked_kind(name, str, "name of a frame")
        for kind in _FRAME_KINDS:
            if self.model.existFrame(name, kind):
                return int(self.model.getFrameId(name, kind))
        raise UnknownNameError(
            f"unknown frame of robot {self.name!r}", got=name, choices=self.frame_names()
        )

    def joints_above(self, frame: str) -> list[int]:
        """Pinocchio's indices of the joints that move a frame, from the base on, which counts.

        Args:
            frame: by role or by the document's own name.

        Raises:
            UnknownNameError: no such frame.
        """
        parent = self.model.frames[self.frame_id(frame)].parentJoint
        # Joint 0 is the world.
        return [int(j) for j in self.model.supports[parent] if j > 0]

    def leg_joints(self, sole: str) -> list[int]:
        """Pinocchio's indices of a leg's joints, from the hip on.

        They are those that move the sole and no other one: a waist that carries both is no part.

        Args:
            sole: at the end of the leg.

        Raises:
            UnknownNameError: no such frame.
        """
        shared = {int(self.base_dofs > 0)}
        for other in self.soles:
            if other != sole:
                shared.update(self.joints_above(other))
        return [j for j in self.joints_above(sole) if j not in shared]

    def frame_names(self) -> tuple[str, ...]:
        """All frames that tasks and contacts may name, those with a part to play first."""
        others = (f.name for f in self.model.frames if f.name != "universe")
        return tuple(dict.fromkeys((*self.roles, *others)))

    def joint_index(self, name: str) -> int:
        """Index of an actuated joint in `joint_names`.

        Raises:
            UnknownNameError: no such joint; the message lists those that exist.
        """
        try:
            return self.joint_names.index(name)
        except ValueError:
            raise UnknownNameError(
                f"unknown joint of robot {self.name!r}", got=name, choices=self.joint_names
            ) from None


def _checked_numbers(value: Numbers, what: str, count: int) -> Float64[np.ndarray, " n"]:
    """A copy of what a user gave as a list of numbers."""
    try:
        numbers = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        numbers = np.empty(0)
    if numbers.shape != (count,) or not np.isfinite(numbers).all():
        raise ConfigurationError(what, got=value, wanted=f"{count} finite numbers")
    return numbers


Made = TypeVar("Made")


def once_a_robot(make: Callable[[Robot], Made]) -> Callable[[Robot], Made]:
    """Cache a function's result, which must not refer to the robot, for the robot's lifetime."""
    made: WeakKeyDictionary[Robot, Made] = WeakKeyDictionary()

    @wraps(make)
    def find(robot: Robot) -> Made:
        if robot not in made:
            made[robot] = make(robot)
        return made[robot]

    return find
