"""`JointOrder`: joints as one program orders them, and arrays taken from one order to another."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float64, Int64

from poise._checks import Numbers, checked_kind
from poise.errors import ConfigurationError, UnknownNameError
from poise.robots._mjcf_compile import mujoco_module
from poise.robots._robot import Robot

_LEG = "hip_pitch hip_roll hip_yaw knee ankle_pitch ankle_roll"
_YAW_LEG = "hip_yaw hip_pitch hip_roll knee ankle_pitch ankle_roll"
_ARM = "shoulder_pitch shoulder_roll shoulder_yaw elbow wrist_roll wrist_pitch wrist_yaw"
_UNITREE = {"g1": (_LEG, "waist_yaw waist_roll waist_pitch"), "h1_2": (_YAW_LEG, "torso")}
"""A leg and the trunk by the names of unitree_ros, as `G1JointIndex` and `H1_2_JointIndex` of
unitree_sdk2_python order them: legs, trunk, arms, left before right."""


class JointOrder:
    """The joints of a robot in the order of some program, by name.

        to_isaac = JointOrder.of(robot).to(JointOrder(articulation.joint_names))

    Args:
        names: of the joints, as the program lists them; kept as an attribute.

    Raises:
        ConfigurationError: a name stands there twice.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self.names = tuple(names)
        if len(set(self.names)) < len(self.names):
            raise ConfigurationError("a joint stands twice in an order", got=self.names)

    @staticmethod
    def of(robot: Robot) -> "JointOrder":
        """The order of `robot.joint_names`, which is Poise's everywhere."""
        return JointOrder(checked_kind(robot, Robot, "robot of an order").joint_names)

    @staticmethod
    def from_mujoco(model: Any, *, prefix: str = "", actuators: bool = False) -> "JointOrder":
        """The order of the hinges and slides in `qpos` and `qvel` of a `mujoco.MjModel`.

        Args:
            model: the model.
            prefix: of the names of one robot's joints; joints without it are left out.
            actuators: True for the order of `ctrl`, by the joint that each actuator moves.
        """
        mujoco = mujoco_module("a MuJoCo model")
        kinds = int(mujoco.mjtJoint.mjJNT_SLIDE), int(mujoco.mjtJoint.mjJNT_HINGE)
        joints = [j for j in range(model.njnt) if model.jnt_type[j] in kinds]
        if actuators:
            on_joints = int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)
            joints = model.actuator_trnid[np.isin(model.actuator_trntype, on_joints), 0]
        names = [str(model.joint(j).name) for j in joints]
        return JointOrder([n.removeprefix(prefix) for n in names if n.startswith(prefix)])

    @staticmethod
    def breadth_first(robot: Robot) -> "JointOrder":
        """The order of PhysX and Isaac Lab: by depth, within it as the parents stand, then by name.

        Fixed and locked joints count as merged. What made the USD file decides which joint of a
        link comes first; importers of URDF go by name. `articulation.joint_names` is certain.
        """
        model, names, found = robot.model, list(robot.model.names), [int(robot.floating_base)]
        for parent in found:  # It grows meanwhile.
            found += sorted(map(int, model.children[parent]), key=lambda j: names[j])
        return JointOrder([names[j] for j in found[1:]])

    @staticmethod
    def unitree_dds(robot: str) -> "JointOrder":
        """The order of `motor_state` and `motor_cmd` in Unitree's `unitree_hg` messages.

        Args:
            robot: "g1", with 29 motors, of which one with 23 joints leaves six unused, or "h1_2".

        Raises:
            UnknownNameError: the order of another robot is not known.
        """
        if robot not in _UNITREE:
            raise UnknownNameError("no such robot of Unitree's", got=robot, choices=_UNITREE)
        leg, trunk = _UNITREE[robot]
        parts = [("left_", leg), ("right_", leg), ("", trunk), ("left_", _ARM), ("right_", _ARM)]
        return JointOrder([f"{side}{n}_joint" for side, part in parts for n in part.split()])

    def index(self, other: "JointOrder") -> Int64[np.ndarray, " n"]:
        """Places in this order of another one's joints: `values[..., index]` are in the other.

        Raises:
            UnknownNameError: the other order has joints that this one lacks.
        """
        lacking = [name for name in other.names if name not in self.names]
        if lacking:
            raise UnknownNameError(
                "an order lacks joints of the other",
                got=lacking,
                wanted="the same names in both, or `fill` for their values",
                choices=self.names,
            )
        return np.array([self.names.index(name) for name in other.names], dtype=np.int64)

    def to(
        self, other: "JointOrder", *, fill: float | None = None
    ) -> Callable[[Numbers], Float64[np.ndarray, "*shape"]]:
        """A function that takes arrays from this order to another, along their last axis.

        Args:
            other: the order of the result; joints that it lacks are left out.
            fill: value of joints that this order lacks.

        Raises:
            UnknownNameError: there are such joints, and `fill` is None.
        """
        known = [n for n in other.names if fill is None or n in self.names]
        index, count, size = self.index(JointOrder(known)), len(self.names), len(other.names)
        places = other.index(JointOrder(known))

        def take(values: Numbers) -> Float64[np.ndarray, "*shape"]:
            given = np.asarray(values, dtype=np.float64)
            if given.shape[-1:] != (count,):
                raise ConfigurationError("values", got=given.shape, wanted=f"(..., {count})")
            taken = np.full((*given.shape[:-1], size), np.nan if fill is None else fill)
            taken[..., places] = given[..., index]
            return taken

        return take
