"""`PlantConfig`: everything about the simulated robot and its world that can be chosen.

`Push`: a force on it while it runs.
"""

import math
from dataclasses import dataclass, field, fields, replace
from typing import Annotated, ClassVar, Literal

import numpy as np
import pinocchio as pin

from poise._schema import (
    Bounds,
    Duration,
    Number,
    Ratio,
    Seconds,
    Text,
    Truth,
    Vector,
    checked,
)
from poise.errors import ConfigurationError
from poise.sim._motor_config import PERIOD, MotorConfig

Actuation = Literal["torque", "position", "velocity"]
"""Kind of control of the joints' motors."""

_FARTHEST = 1e2  # of places and angles [m, rad]: MuJoCo loses its accuracy there

Offset = Annotated[tuple[float, float, float], Vector(3, Bounds(most=_FARTHEST, unit="m"))]
Tilt = Annotated[tuple[float, float], Vector(2, Bounds(most=0.7, unit="rad"))]
"""Nothing stands on steeper ground with the friction of a floor."""
Factor = Annotated[float, Bounds(positive=True, most=1e6)]
Deviation = Annotated[float, Bounds(least=0.0, most=1e6)]
"""A standard deviation or a resolution, in the unit of the measurement."""


@checked()
@dataclass(frozen=True, kw_only=True)
class Push:
    """A constant force on a body for a while.

    It acts at the origin of a frame with a part to play, or at the centre of mass of a link.
    """

    body: str  # name of the frame or link
    force: Annotated[tuple[float, float, float], Vector(3, Bounds(unit="N"))]  # in the world [N]
    start: Seconds  # [s]
    duration: Duration  # [s]

    @property
    def end(self) -> float:
        """Time at which it ends [s]."""
        return self.start + self.duration

    def fraction(self, begin: float, end: float) -> float:
        """Fraction of a physics step in which the push is active: it keeps force x duration."""
        overlap = min(end, self.end) - max(begin, self.start)
        fraction = overlap / (end - begin)
        # A scheduled push moves the robot as one given when its time has come, to the last bit.
        return fraction if fraction > 1e-6 else 0.0


@checked()
@dataclass(frozen=True, kw_only=True)
class Payload:
    """A ball rigidly attached to a frame and missing from the controller's model."""

    frame: Text  # a frame with a part to play, or a link of the document
    mass: Annotated[float, Bounds(positive=True, most=1e6, unit="kg")]  # [kg]
    offset: Offset = (0.0, 0.0, 0.0)  # of the ball's centre in the frame [m]
    radius: Annotated[float, Bounds(positive=True, most=1e6, unit="m")] = 0.06  # [m]

    @property
    def inertia(self) -> float:
        """Moment of inertia of a solid ball about its centre, 2/5 m r^2 [kg m^2]."""
        return 0.4 * self.mass * self.radius**2


@checked()
@dataclass(frozen=True, kw_only=True)
class LinkError:
    """Difference of one link of the plant from the description that the controller uses."""

    link: Text  # its name in the document
    mass_scale: Factor = 1.0  # of its mass and inertia, as with another density
    inertia_scale: Factor = 1.0  # a further factor on its inertia
    com_offset: Offset = (0.0, 0.0, 0.0)  # of its centre of mass, in the link's frame [m]


@checked()
@dataclass(frozen=True, kw_only=True)
class Block:
    """A box on the floor, for uneven ground; a tilted one is a ramp."""

    # Centre of its top, seen from above, in the world [m]
    center: Annotated[tuple[float, float], Vector(2, Bounds(most=_FARTHEST, unit="m"))]
    # Length along x, width along y and height [m]
    size: Annotated[
        tuple[float, float, float], Vector(3, Bounds(positive=True, most=_FARTHEST, unit="m"))
    ]
    yaw: Number = 0.0  # rotation about z [rad]
    tilt: Tilt = (0.0, 0.0)  # about its own x and y, before yaw, about the centre of its top [rad]
    # Height of the centre of its top over the floor [m]; its own height when None
    top: Annotated[float, Bounds(most=_FARTHEST, unit="m")] | None = None
    told: Truth = True  # known to a planner of footsteps; never one that is tilted or sunk in

    def __post_init__(self) -> None:
        if self.told and (any(self.tilt) or self.top is not None):
            wrong = "no footsteps are planned on a block that is tilted or sunk in"
            raise ConfigurationError(wrong, got="told: true", wanted="told: false")

    @property
    def pose(self) -> pin.SE3:
        """Of its centre, in the world."""
        about_x, about_y = self.tilt
        tilted = pin.exp3(np.array([about_x, about_y, 0.0]))
        rotation = pin.utils.rotate("z", self.yaw) @ tilted
        height = self.size[2] if self.top is None else self.top
        return pin.SE3(
            rotation, np.array([*self.center, height]) - 0.5 * self.size[2] * rotation[:, 2]
        )


@checked()
@dataclass(frozen=True, kw_only=True)
class SensorConfig:
    """Resolution, noise and delay of the measurements; all zero means the true state.

    Noise is white and normal; each value is its standard deviation. A bias is drawn from a normal
    distribution with this deviation, once a run, for each joint or axis.
    """

    encoder_resolution: Deviation = 0.0  # smallest step of the joint encoders [rad]
    joint_position_noise: Deviation = 0.0  # before quantisation [rad]
    joint_position_bias: Deviation = 0.0  # as of joints that were zeroed badly [rad]
    joint_velocity_noise: Deviation = 0.0  # [rad/s]
    base_position_noise: Deviation = 0.0  # [m]
    base_orientation_noise: Deviation = 0.0  # as a rotation vector [rad]
    # Rotation about the base's x and y that a unit mounted askew has; more is in its description
    # [rad]
    base_orientation_error: Annotated[tuple[float, float], Vector(2, Bounds(most=0.5))] = (
        0.0,
        0.0,
    )
    base_velocity_noise: Deviation = 0.0  # linear [m/s]
    gyro_noise: Deviation = 0.0  # of the base's angular velocity [rad/s]
    force_noise: Deviation = 0.0  # of the soles [N]
    force_bias: Deviation = 0.0  # of the soles [N]
    moment_noise: Deviation = 0.0  # of the soles [N m]
    moment_bias: Deviation = 0.0  # of the soles [N m]
    accelerometer_noise: Deviation = 0.0  # of the specific force that an estimator reads [m/s^2]
    accelerometer_bias: Deviation = 0.0  # of the same [m/s^2]
    # Of the angular velocity that an estimator reads [rad/s]; `v` is without it, as a unit that
    # knows its own bias gives it
    gyro_bias: Deviation = 0.0
    torque_noise: Deviation = 0.0  # of the motors' torques that an estimator reads [N m]
    delay: Seconds = 0.0  # age of everything measured [s], a multiple of the control period

    @classmethod
    def typical(cls) -> "SensorConfig":
        """Encoders of 17 bits, an inertial unit and load cells as they are sold."""
        return cls(
            encoder_resolution=2.0 * math.pi / 2**17,
            joint_velocity_noise=0.01,
            base_orientation_noise=1e-3,
            gyro_noise=5e-3,
            force_noise=2.0,
            moment_noise=0.3,
            accelerometer_noise=0.05,
            accelerometer_bias=0.03,
            gyro_bias=2e-3,
        )

    @property
    def ideal(self) -> bool:
        """True where the measured state is the true one."""
        return all(not np.any(getattr(self, f.name)) for f in fields(self))


@checked()
@dataclass(frozen=True, kw_only=True)
class ServoConfig:
    """Gains of the joint servos that position and velocity actuation use.

    Both are relative to the joint's torque limit, so that one pair serves hips and wrists.
    """

    # Torque at an error of 1 rad, over the torque limit [1/rad]
    stiffness: Annotated[float, Bounds(positive=True, most=1e6, unit="1/rad")] = 20.0
    # Torque at an error of 1 rad/s, over the torque limit [s/rad]; with 0.4 a biped whose
    # velocities are commanded sways ever more and falls
    damping: Annotated[float, Bounds(least=0.0, most=1e6, unit="s/rad")] = 1.0


_LinkError = LinkError  # the names of the configuration's own
_Payload = Payload


@checked()
@dataclass(frozen=True, kw_only=True)
class PlantConfig:
    """The plant and its world, checked when made.

    Actuation is by "torque", by "position" (a stiff PD servo a joint, which is sent a commanded
    torque as the position at which it pulls with it) or by "velocity" (the same servo, following
    the integral of the commanded velocity).

    With `self_contact` links touch one another by their collision geometry, or the
    convex hulls of their pictures; those never do that touch in the home posture, or have two
    joints or fewer between them. Without it links pass through one another, and those without
    collision geometry through floor and blocks.
    """

    Servo: ClassVar = ServoConfig
    LinkError: ClassVar = _LinkError
    Payload: ClassVar = _Payload

    actuation: Actuation = "torque"
    control_dt: Duration = 1e-3  # time from one command to the next [s]
    physics_dt: Duration = 1e-3  # time step of the physics [s], which divides `control_dt`
    servo: ServoConfig = field(default_factory=ServoConfig)  # of position and velocity actuation
    sensors: SensorConfig = field(default_factory=SensorConfig)
    friction: Factor = 1.0  # sliding friction of the floor
    # Time constant of penetration into the ground [s]; MuJoCo needs 2 `physics_dt` or more
    contact_time_constant: Duration = 5e-3
    floor_slope: Tilt = (0.0, 0.0)  # about the world's x and y through the origin [rad]
    blocks: tuple[Block, ...] = ()  # on the floor
    self_contact: bool = False
    mass_scale: Factor = 1.0  # of the mass and inertia of every link
    inertia_scale: Factor = 1.0  # a further factor on the inertia of every link
    link_errors: tuple[_LinkError, ...] = ()
    payloads: tuple[_Payload, ...] = ()
    # Viscous [N m s/rad] and dry [N m] friction of every joint
    joint_damping: Annotated[float, Bounds(least=0.0, most=1e6, unit="N m s/rad")] = 0.0
    joint_friction: Annotated[float, Bounds(least=0.0, most=1e6, unit="N m")] = 0.0
    # Cut-off frequency f of the motors' torque [Hz], by torque actuation alone:
    # dtau/dt = 2 pi f (tau_commanded - tau); without delay when None
    torque_bandwidth: Annotated[float, Bounds(positive=True, most=1e6, unit="Hz")] | None = None
    # Drives with loops of their own, by torque actuation alone; ideal ones when None
    motors: MotorConfig | None = None
    fall_height_ratio: Ratio = 0.6  # a pelvis below this fraction of its home height has fallen

    def with_noise(self) -> "PlantConfig":
        """The same plant, measured by `SensorConfig.typical()`."""
        return replace(self, sensors=SensorConfig.typical())

    @property
    def commanded(self) -> Literal["torque", "velocity"]:
        """Kind of command that a controller of the plant gives."""
        return "velocity" if self.actuation == "velocity" else "torque"

    @property
    def substeps(self) -> int:
        """Number of physics steps in one control period."""
        return _multiple("control_dt", self.control_dt, "physics_dt", self.physics_dt)

    @property
    def drive_ticks(self) -> int:
        """Number of periods of the drives' loops in one physics step."""
        return _multiple("physics_dt", self.physics_dt, "the period of the drives", PERIOD)

    @property
    def delay_ticks(self) -> int:
        """Age of the measurements in control periods."""
        return _multiple("the sensors' delay", self.sensors.delay, "control_dt", self.control_dt)

    def __post_init__(self) -> None:
        least, _ = 2.0 * self.physics_dt, self.delay_ticks
        if self.substeps < 1:
            wrong = "control_dt is shorter than physics_dt"
            raise ConfigurationError(wrong, got=self.control_dt, wanted=">= physics_dt")
        if self.contact_time_constant < least:
            wrong = "contact_time_constant is too short for the physics step"
            raise ConfigurationError(wrong, got=self.contact_time_constant, wanted=f">= {least}")
        for name in ("torque_bandwidth", "motors"):
            if getattr(self, name) is not None and self.actuation != "torque":
                raise ConfigurationError(
                    f"{name} does not go with {self.actuation} actuation",
                    got=getattr(self, name),
                    wanted=f"no {name}, or actuation torque",
                )
        if self.motors is not None:
            _ = self.drive_ticks


def _multiple(name: str, value: float, unit_name: str, unit: float) -> int:
    """Number of times that `unit` goes into `value`; refuse one that is not whole."""
    times = round(value / unit)
    # Decimal fractions such as 0.001 are not exact in binary: allow their rounding, no more.
    if abs(times * unit - value) > 1e-9 * max(abs(value), unit):
        wrong = f"{name} must be a multiple of {unit_name}"
        raise ConfigurationError(wrong, got=value, wanted=f"a whole number times {unit}")
    return times
