"""`PlantConfig`: everything about the simulated robot and its world that can be chosen."""

from dataclasses import dataclass, field, replace
from typing import Annotated, ClassVar, Literal

from poise._schema import Bounds, Duration, Ratio, Vector, checked
from poise.errors import ConfigurationError
from poise.sim._disturbances import (
    STEEPEST,
    Block,
    Factor,
    LinkError as _LinkError,
    Payload as _Payload,
)
from poise.sim._sensors import SensorConfig

Actuation = Literal["torque", "position", "velocity"]
"""What the joints are told: a torque, a position, or a velocity."""


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
    floor_slope: Annotated[tuple[float, float], Vector(2, Bounds(most=STEEPEST, unit="rad"))] = (
        0.0,
        0.0,
    )
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
        """How many physics steps make one control period."""
        return _multiple("control_dt", self.control_dt, "physics_dt", self.physics_dt)

    @property
    def delay_ticks(self) -> int:
        """How many control periods old the measurements are."""
        return _multiple("the sensors' delay", self.sensors.delay, "control_dt", self.control_dt)

    def __post_init__(self) -> None:
        if self.substeps < 1:
            raise ConfigurationError(
                "control_dt is shorter than physics_dt", got=self.control_dt, wanted=">= physics_dt"
            )
        if self.contact_time_constant < 2.0 * self.physics_dt:
            raise ConfigurationError(
                "contact_time_constant is too short for the physics step",
                got=self.contact_time_constant,
                wanted=f">= {2.0 * self.physics_dt}",
            )
        _ = self.delay_ticks
        if self.torque_bandwidth is not None and self.actuation != "torque":
            raise ConfigurationError(
                f"torque_bandwidth does not go with {self.actuation} actuation",
                got=self.torque_bandwidth,
                wanted="no torque_bandwidth, or actuation torque",
            )


def _multiple(name: str, value: float, unit_name: str, unit: float) -> int:
    """How many times `unit` goes into `value`, refusing what is not a whole number of times."""
    times = round(value / unit)
    # Decimal fractions such as 0.001 are not exact in binary: allow their rounding, no more.
    if abs(times * unit - value) > 1e-9 * max(abs(value), unit):
        raise ConfigurationError(
            f"{name} must be a multiple of {unit_name}",
            got=value,
            wanted=f"a whole number times {unit}",
        )
    return times
