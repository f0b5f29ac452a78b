"""`connect_g1`, `simulate_g1`: both ends of a Unitree G1's bus."""

from functools import partial
from typing import NamedTuple

from poise.errors import UnknownNameError
from poise.hardware import (
    MODE_MACHINES,
    G1Link,
    G1Robot,
    LastCheck,
    Link,
    ProcessLink,
    TorqueSplit,
)
from poise.robots import JointOrder, Robot

_KP = {"hip": 60.0, "knee": 100.0, "waist_yaw": 60.0, "": 40.0}
_KD = {"knee": 2.0, "": 1.0}
"""Gains of Unitree's own example (unitree_sdk2_python, g1_low_level_example.py), by part of a name
[N m/rad, N m s/rad]."""

_KD_MAX = 8.0
"""Largest damping of the drives [N m s/rad], that of a damping command of unitree_rl_gym."""

_ROTOR = {"knee": 0.0251, "hip_roll": 0.0251, "hip": 0.0102, "waist_yaw": 0.0102,
          "wrist_pitch": 0.00425, "wrist_yaw": 0.00425, "ankle": 0.0072, "waist": 0.0072,
          "": 0.0036}  # fmt: skip
"""Inertia of the rotors at their joint by part of its name (unitree_rl_lab, unitree_actuators.py);
two motors share the ankles and the waist's roll and pitch [kg m^2]."""

_BLIND = 0.004
"""Time within which the computer cannot react: two periods of state and command [s]. The drives'
damping beside torques takes a rotor's velocity within it: kd = I / t."""


class G1Gains(NamedTuple):
    """Last check, torque split, and gains of position control of a G1."""

    check: LastCheck
    split: TorqueSplit
    kp: dict[str, float]  # [N m/rad]
    kd: dict[str, float]  # [N m s/rad]


def g1_gains(robot: Robot) -> G1Gains:
    """Return limits and gains of the drives of a G1.

    Args:
        robot: a model of it.
    """

    def by_joint(gains: dict[str, float], scale: float = 1.0) -> dict[str, float]:
        names = robot.joint_names
        return {n: scale * next(g for part, g in gains.items() if part in n) for n in names}

    kp, kd = by_joint(_KP), by_joint(_KD)
    check = LastCheck(robot, kp_max=kp, kd_max=_KD_MAX)
    split = TorqueSplit(check, kp=0.0, kd=by_joint(_ROTOR, 1.0 / _BLIND))
    return G1Gains(check, split, kp, kd)


def mode_machine(robot: Robot, model: str | None) -> int:
    """Return the number by which a G1 names its model."""
    name = f"g1_{robot.nj}dof_rev_1_0" if model is None else model
    if name not in MODE_MACHINES:
        raise UnknownNameError("no such model of a G1", got=name, choices=MODE_MACHINES)
    return MODE_MACHINES[name]


def connect_g1(
    robot: Robot,
    check: LastCheck,
    *,
    interface: str,
    model: str | None = None,
    tag: str = "",
    release: bool = False,
    priority: int | None = None,
) -> Link:
    """Connect to a G1, in a process of its own.

    Args:
        robot: the robot's model.
        check: the last check.
        interface: network interface; "lo" for a simulated robot.
        model: its name in unitree_ros; by default revision 1.0 with as many joints.
        tag: that of the simulated robot.
        release: release the motion mode of the robot.
        priority: of the link's process, as of `ProcessLink`.

    Raises:
        PoiseError: as of `G1Link` and `ProcessLink`.
    """
    motors = JointOrder.unitree_dds("g1").names
    make = partial(
        G1Link,
        robot.joint_names,
        motors,
        mode_machines=(mode_machine(robot, model),),
        interface=interface,
        tag=tag,
        release=release,
    )
    return ProcessLink(make, check, priority=priority)


def simulate_g1(robot: Robot, *, model: str | None = None, tag: str = "") -> G1Robot:
    """Return the robot's end of a G1's bus on the loopback interface.

    Args:
        robot: the robot's model.
        model: its name in unitree_ros; by default revision 1.0 with as many joints.
        tag: that of the link.
    """
    motors = JointOrder.unitree_dds("g1").names
    return G1Robot(robot.joint_names, motors, mode_machine=mode_machine(robot, model), tag=tag)
