"""`PlantConfig`: everything about the simulated robot and its world that can be chosen.

`Push`: a force on it while it runs.
"""

import math
from dataclasses import dataclass, field, fields, replace
from typing import Annotated, ClassVar, Literal

import numpy as np
import pinocchio as pin

from poise._schema import Bounds, Duration, Number, Ratio, Seconds, Text, Truth, Vector, checked
from poise.errors import ConfigurationError

Actuation = Literal["torque", "position", "velocity"]
"""Kind of control of the joints' motors."""

_FARTHEST = 1e2  # of places and angles [m, rad]: MuJoCo loses its accuracy there
_STEEPEST = 0.7  # nothing stands on steeper ground [rad] with the friction of a floor
_MOST_ASKEW = 0.5  # an inertial unit that is mounted more askew is in its description [rad]
_NO_OVERLAP = 1e-6  # part of a physics step that is a rounding of its ends

Offset = Annotated[tuple[float, float, float], Vector(3, Bounds(most=_FARTHEST, unit="m"))]
Tilt = Annotated[tuple[float, float], Vector(2, Bounds(most=_STEEPEST, unit="rad"))]
Factor = Annotated[float, Bounds(positive=True, most=1e6)]
Deviation = Annotated[float, Bounds(least=0.0, most=1e6)]
"""A standard deviation or a resolution, in the unit of what is measured."""


@checked()
@dataclass(frozen=True, kw_only=True)
class Push:
    """A constant force on a body for a while.

    Attributes:
        body: a frame with a part to play (the force acts at its origin) or a link of the document
            (the force acts at the link's centre of mass).
        force: force in the world [N].
        start: when the push begins [s].
        duration: how long it lasts [s].
    """

    body: str
    force: Annotated[tuple[float, float, float], Vector(3, Bounds(unit="N"))]
    start: Seconds
    duration: Duration

    @property
    def end(self) -> float:
        """Time at which it ends [s]."""
        return self.start + self.duration

    def fraction(self, begin: float, end: float) -> float:
        """Fraction of the interval [begin, end] in which the push is active.

        A push that starts or ends inside a physics step acts with this fraction of its force, so
        that its impulse is force x duration whatever the step. It does not act in a step that
        touches it by rounding alone: a push that was scheduled moves the robot as one that is given
        when its time has come, to the last bit.
        """
        overlap = min(end, self.end) - max(begin, self.start)
        fraction = overlap / (end - begin)
        return fraction if fraction > _NO_OVERLAP else 0.0


@checked()
@dataclass(frozen=True, kw_only=True)
class Payload:
    """A ball rigidly attached to a frame, which the controller does not know of.

    Attributes:
        frame: a frame with a part to play, or a link of the document.
        mass: its mass [kg].
        offset: centre of the ball in the frame [m].
        radius: its radius, for its inertia and its picture [m].
    """

    frame: Text
    mass: Annotated[float, Bounds(positive=True, most=1e6, unit="kg")]
    offset: Offset = (0.0, 0.0, 0.0)
    radius: Annotated[float, Bounds(positive=True, most=1e6, unit="m")] = 0.06

    @property
    def inertia(self) -> float:
        """Moment of inertia of a solid ball about its centre, 2/5 m r^2 [kg m^2]."""
        return 0.4 * self.mass * self.radius**2


@checked()
@dataclass(frozen=True, kw_only=True)
class LinkError:
    """Difference of one link of the plant from the description that the controller uses.

    Attributes:
        link: the link's name in the document.
        mass_scale: factor on its mass; its inertia scales alike, as with another density.
        inertia_scale: a further factor on its inertia.
        com_offset: shift of its centre of mass, in the link's frame [m].
    """

    link: Text
    mass_scale: Factor = 1.0
    inertia_scale: Factor = 1.0
    com_offset: Offset = (0.0, 0.0, 0.0)


@checked()
@dataclass(frozen=True, kw_only=True)
class Block:
    """A box on the floor, for uneven ground; a tilted one is a ramp.

    Attributes:
        center: centre of its top, seen from above, in the world [m].
        size: its length along x, width along y and height [m].
        yaw: its rotation about z [rad].
        tilt: its rotation about its own x and y axes, before yaw, about the centre of its top
            [rad].
        top: height of the centre of its top over the floor [m]; its own height when None.
        told: whether a planner of footsteps knows it; never one that is tilted or sunk in, since
            platforms are boxes that lie on the floor.
    """

    center: Annotated[tuple[float, float], Vector(2, Bounds(most=_FARTHEST, unit="m"))]
    size: Annotated[
        tuple[float, float, float], Vector(3, Bounds(positive=True, most=_FARTHEST, unit="m"))
    ]
    yaw: Number = 0.0
    tilt: Tilt = (0.0, 0.0)
    top: Annotated[float, Bounds(most=_FARTHEST, unit="m")] | None = None
    told: Truth = True

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
    distribution, once a run.

    Attributes:
        encoder_resolution: smallest step of the joint encoders [rad].
        joint_position_noise: noise of the joint positions, before quantisation [rad].
        joint_position_bias: constant error of the joint positions, as of joints that were zeroed
            badly, drawn once a joint with this deviation [rad].
        joint_velocity_noise: noise of the joint velocities [rad/s].
        base_position_noise: noise of the base position [m].
        base_orientation_noise: noise of the base orientation, as a rotation vector [rad].
        base_orientation_error: constant error of the base orientation, as a rotation about the
            base's own x and y axes, which a unit mounted askew has [rad].
        base_velocity_noise: noise of the base linear velocity [m/s].
        gyro_noise: noise of the base angular velocity [rad/s].
        force_noise: noise of the sole forces [N].
        force_bias: constant error of the sole forces, drawn once a sole and axis with this
            deviation [N].
        moment_noise: noise of the sole moments [N m].
        moment_bias: constant error of the sole moments, drawn alike [N m].
        accelerometer_noise: noise of the specific force that an estimator reads [m/s^2].
        accelerometer_bias: its constant error, drawn alike once an axis [m/s^2].
        gyro_bias: constant error of the angular velocity that an estimator reads, drawn alike;
            `v` is without it, as a unit that knows its own bias gives it [rad/s].
        torque_noise: noise of the motors' torques that an estimator reads [N m].
        delay: age of everything measured [s], a multiple of the control period.
    """

    encoder_resolution: Deviation = 0.0
    joint_position_noise: Deviation = 0.0
    joint_position_bias: Deviation = 0.0
    joint_velocity_noise: Deviation = 0.0
    base_position_noise: Deviation = 0.0
    base_orientation_noise: Deviation = 0.0
    base_orientation_error: Annotated[tuple[float, float], Vector(2, Bounds(most=_MOST_ASKEW))] = (
        0.0,
        0.0,
    )
    base_velocity_noise: Deviation = 0.0
    gyro_noise: Deviation = 0.0
    force_noise: Deviation = 0.0
    force_bias: Deviation = 0.0
    moment_noise: Deviation = 0.0
    moment_bias: Deviation = 0.0
    accelerometer_noise: Deviation = 0.0
    accelerometer_bias: Deviation = 0.0
    gyro_bias: Deviation = 0.0
    torque_noise: Deviation = 0.0
    delay: Seconds = 0.0

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

    Both are relative to the joint's torque limit, so that one pair serves hips and wrists. With
    less damping (0.4) a biped whose velocities are commanded sways ever more and falls.

    Attributes:
        stiffness: torque at 1 rad of error, over the torque limit [1/rad].
        damping: torque at 1 rad/s of error, over the torque limit [s/rad].
    """

    stiffness: Annotated[float, Bounds(positive=True, most=1e6, unit="1/rad")] = 20.0
    damping: Annotated[float, Bounds(least=0.0, most=1e6, unit="s/rad")] = 1.0


_LinkError = LinkError  # the names of the configuration's own
_Payload = Payload


@checked()
@dataclass(frozen=True, kw_only=True)
class PlantConfig:
    """The plant and its world, checked when made.

    Attributes:
        actuation: "torque", "position" (a stiff PD servo a joint, which is sent a commanded torque
            as the position at which it pulls with it) or "velocity" (the same servo, following the
            integral of the commanded velocity).
        control_dt: time from one command to the next [s].
        physics_dt: time step of the physics [s]; `control_dt` is a multiple of it.
        servo: gains for position and velocity actuation, a `PlantConfig.Servo`.
        sensors: what the state is measured with.
        friction: sliding friction of the floor.
        contact_time_constant: how fast a contact gives back penetration [s]; at least twice
            `physics_dt`, which is MuJoCo's condition for stability.
        floor_slope: rotation of the floor about the world's x and y axes through the origin [rad].
        blocks: boxes on the floor.
        self_contact: whether the robot's links touch one another, by their collision geometry, or
            where a link has none, the convex hulls of its pictures; links that touch in the home
            posture, or have two joints or fewer between them, never do. Without it they pass
            through one another, and those without collision geometry through floor and blocks.
        mass_scale: factor on the mass and inertia of every link.
        inertia_scale: a further factor on the inertia of every link.
        link_errors: links that differ from their description by themselves, each a
            `PlantConfig.LinkError`.
        payloads: masses attached to frames, each a `PlantConfig.Payload`.
        joint_damping: viscous friction of every joint [N m s/rad].
        joint_friction: dry friction of every joint [N m].
        torque_bandwidth: cut-off frequency f of the motors' torque [Hz], which follows what is
            commanded by dtau/dt = 2 pi f (tau_commanded - tau); at once when None. Torque actuation
            alone.
        fall_height_ratio: the robot has fallen when its pelvis is below this fraction of its home
            height.
    """

    Servo: ClassVar = ServoConfig
    LinkError: ClassVar = _LinkError
    Payload: ClassVar = _Payload

    actuation: Actuation = "torque"
    control_dt: Duration = 1e-3
    physics_dt: Duration = 1e-3
    servo: ServoConfig = field(default_factory=ServoConfig)
    sensors: SensorConfig = field(default_factory=SensorConfig)
    friction: Factor = 1.0
    contact_time_constant: Duration = 5e-3
    floor_slope: Tilt = (0.0, 0.0)
    blocks: tuple[Block, ...] = ()
    self_contact: bool = False
    mass_scale: Factor = 1.0
    inertia_scale: Factor = 1.0
    link_errors: tuple[_LinkError, ...] = ()
    payloads: tuple[_Payload, ...] = ()
    joint_damping: Annotated[float, Bounds(least=0.0, most=1e6, unit="N m s/rad")] = 0.0
    joint_friction: Annotated[float, Bounds(least=0.0, most=1e6, unit="N m")] = 0.0
    torque_bandwidth: Annotated[float, Bounds(positive=True, most=1e6, unit="Hz")] | None = None
    fall_height_ratio: Ratio = 0.6

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
        if self.torque_bandwidth is not None and self.actuation != "torque":
            raise ConfigurationError(
                f"torque_bandwidth does not go with {self.actuation} actuation",
                got=self.torque_bandwidth,
                wanted="no torque_bandwidth, or actuation torque",
            )


def _multiple(name: str, value: float, unit_name: str, unit: float) -> int:
    """Number of times that `unit` goes into `value`; refuse one that is not whole."""
    times = round(value / unit)
    # Decimal fractions such as 0.001 are not exact in binary: allow their rounding, no more.
    if abs(times * unit - value) > 1e-9 * max(abs(value), unit):
        wrong = f"{name} must be a multiple of {unit_name}"
        raise ConfigurationError(wrong, got=value, wanted=f"a whole number times {unit}")
    return times
