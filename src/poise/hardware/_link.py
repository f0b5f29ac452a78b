"""`Link`: the contract between a controller and a robot, with its states and commands."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from enum import Enum
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float64

from poise._checks import Numbers, checked_number
from poise.errors import ConfigurationError, UnknownNameError

Joints = Float64[np.ndarray, " nj"]  # a number for each joint, in the order of the link's joints
Gains = Numbers | Mapping[str, float]
"""Gains of joints: one for all, one each in their order, or by name with zero for the others."""


@dataclass(frozen=True, kw_only=True, eq=False)
class MotorState:
    """Measurements of motors and inertial unit at one time.

    Attributes:
        time: stamp of the measurement by the robot's clock [s].
        arrived: time of arrival by `Link.clock` [s].
        q: joint positions [rad].
        dq: joint velocities [rad/s].
        tau: joint torques, NaN where not measured [N m].
        temperature: of the motors, NaN where not measured [deg C].
        quaternion: world_R_base of the inertial unit, (x, y, z, w).
        gyro: angular velocity of the base along its axes [rad/s].
        acceleration: specific force along the same axes: upwards at rest [m/s^2].
        wrenches: [force; moment] on the robot by sole, in the order of `LinkInfo.soles`, in the
            sole's frame at its centre [N, N m].
    """

    time: float
    arrived: float
    q: Joints
    dq: Joints
    tau: Joints
    temperature: Joints
    quaternion: Float64[np.ndarray, "4"]
    gyro: Float64[np.ndarray, "3"]
    acceleration: Float64[np.ndarray, "3"]
    wrenches: Float64[np.ndarray, "soles 6"]


@dataclass(frozen=True, kw_only=True, eq=False)
class MotorCommand:
    """Set-points of the drives' own loops until the next command.

    Each drive applies tau + kp (q - q_measured) + kd (dq - dq_measured), at its own rate.

    Attributes:
        q: position targets [rad].
        dq: velocity targets [rad/s].
        kp: stiffness [N m/rad].
        kd: damping [N m s/rad].
        tau: feed-forward torques [N m].
    """

    q: Joints
    dq: Joints
    kp: Joints
    kd: Joints
    tau: Joints

    @staticmethod
    def damping(kd: Joints) -> "MotorCommand":
        """Return the command that only damps the joints.

        Args:
            kd: damping [N m s/rad].
        """
        still = np.zeros(len(kd))
        still.flags.writeable = False
        return MotorCommand(q=still, dq=still, kp=still, kd=kd, tau=still)

    def torque(self, q: Joints, dq: Joints) -> Joints:
        """Return the torque of ideal drives [N m].

        Args:
            q: present joint positions [rad].
            dq: present joint velocities [rad/s].
        """
        return self.tau + self.kp * (self.q - q) + self.kd * (self.dq - dq)


@dataclass(frozen=True, kw_only=True)
class LinkInfo:
    """The far end of a link.

    Attributes:
        name: robot and transport, for people.
        rate: states and commands in a second [1/s].
        joints: names of the joints, in the order of all arrays: `Robot.joint_names`.
        soles: names of the soles whose wrenches are measured.

    Raises:
        ConfigurationError: the rate is not positive, or a joint is listed twice.
    """

    name: str
    rate: float
    joints: tuple[str, ...]
    soles: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        checked_number(self.rate, "rate of the link [1/s]", above=0.0)
        if len(set(self.joints)) < len(self.joints):
            raise ConfigurationError("a joint is listed twice", got=self.joints)


class LinkStatus(Enum):
    """State of the connection."""

    IDLE = "idle"  # nothing has been sent yet
    OK = "ok"  # the last command went out as given
    REFUSED = "refused"  # the last command failed the last check: damping went out
    DAMPING = "damping"  # no fresh command: the link sends damping by itself
    LOST = "lost"  # nothing reaches the robot any more


@runtime_checkable
class Link(Protocol):
    """Connection to a robot; after it is made none of its methods raises."""

    @property
    def info(self) -> LinkInfo:
        """The far end."""
        ...

    @property
    def status(self) -> LinkStatus:
        """State of the connection."""
        ...

    @property
    def refused(self) -> int:
        """Number of commands that failed the last check."""
        ...

    @property
    def reason(self) -> str:
        """Fault of the last refused command, or of the connection; "" for none."""
        ...

    def clock(self) -> float:
        """Return the time now, for deadlines and ages; monotonic [s]."""
        ...

    def read(self) -> MotorState:
        """Return the newest state, without waiting; the same one until another arrives."""
        ...

    def write(self, command: MotorCommand) -> None:
        """Send a command.

        Args:
            command: set-points of all joints.
        """
        ...

    def close(self) -> None:
        """Send damping and disconnect."""
        ...


COMMAND_FIELDS = tuple(f.name for f in fields(MotorCommand))
STATE_FIELDS = tuple(f.name for f in fields(MotorState))


def per_joint(values: Gains, joints: Sequence[str], what: str) -> Joints:
    """Return a number >= 0 for each joint, or raise."""
    if isinstance(values, Mapping):
        unknown = [name for name in values if name not in joints]
        if unknown:
            raise UnknownNameError(f"{what}: no such joint", got=unknown[0], choices=joints)
        values = [float(values.get(name, 0.0)) for name in joints]
    numbers = np.asarray(values, dtype=np.float64)
    good = (numbers >= 0.0) & (numbers < np.inf)
    if numbers.shape not in ((), (len(joints),)) or not np.all(good):
        wanted = f"a finite number >= 0, or {len(joints)} of them, or a mapping by joint"
        raise ConfigurationError(f"{what} is out of range", got=values, wanted=wanted)
    return np.array(np.broadcast_to(numbers, (len(joints),)))
