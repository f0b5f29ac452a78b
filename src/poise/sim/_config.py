"""`PlantConfig`: everything about the simulated robot and its world that can be chosen."""

from dataclasses import dataclass, field
from typing import Literal, get_args

from poise.errors import ConfigurationError
from poise.sim._checks import (
    require_finite,
    require_multiple,
    require_not_negative,
    require_positive,
)
from poise.sim._disturbances import Block, LinkError, Payload
from poise.sim._sensors import SensorConfig

Actuation = Literal["torque", "position", "velocity"]
"""What the joints are told: a torque, a position, or a velocity."""

_MAX_SLOPE = 0.7
"""Steeper than this [rad] nothing stands with the friction of a floor."""


@dataclass(frozen=True, kw_only=True)
class ServoConfig:
    """Gains of the joint servos that position and velocity actuation use.

    Both are relative to the joint's torque limit, so that one pair serves hips and wrists. With
    less damping (0.4) a biped whose velocities are commanded sways ever more and falls.

    Attributes:
        stiffness: torque at 1 rad of error, over the torque limit [1/rad].
        damping: torque at 1 rad/s of error, over the torque limit [s/rad].
    """

    stiffness: float = 20.0
    damping: float = 1.0

    def __post_init__(self) -> None:
        require_positive("the stiffness of the servos", self.stiffness)
        require_not_negative("the damping of the servos", self.damping)


@dataclass(frozen=True, kw_only=True)
class PlantConfig:
    """The plant and its world, checked when made.

    Attributes:
        actuation: "torque", "position" (a stiff PD servo a joint) or "velocity" (the same servo,
            following the integral of the commanded velocity).
        control_dt: time from one command to the next [s].
        physics_dt: time step of the physics [s]; `control_dt` is a multiple of it.
        servo: gains for position and velocity actuation.
        sensors: what the state is measured with.
        friction: sliding friction of the floor.
        contact_time_constant: how fast a contact gives back penetration [s]; at least twice
            `physics_dt`, which is MuJoCo's condition for stability.
        floor_slope: rotation of the floor about the world's x and y axes through the origin [rad].
        blocks: boxes on the floor.
        mass_scale: factor on the mass and inertia of every link.
        inertia_scale: a further factor on the inertia of every link.
        link_errors: links that differ from their description by themselves.
        payloads: masses attached to frames.
        joint_damping: viscous friction of every joint [N m s/rad].
        joint_friction: dry friction of every joint [N m].
        fall_height_ratio: the robot has fallen when its pelvis is below this fraction of its home
            height.
    """

    actuation: Actuation = "torque"
    control_dt: float = 1e-3
    physics_dt: float = 1e-3
    servo: ServoConfig = field(default_factory=ServoConfig)
    sensors: SensorConfig = field(default_factory=SensorConfig)
    friction: float = 1.0
    contact_time_constant: float = 5e-3
    floor_slope: tuple[float, float] = (0.0, 0.0)
    blocks: tuple[Block, ...] = ()
    mass_scale: float = 1.0
    inertia_scale: float = 1.0
    link_errors: tuple[LinkError, ...] = ()
    payloads: tuple[Payload, ...] = ()
    joint_damping: float = 0.0
    joint_friction: float = 0.0
    fall_height_ratio: float = 0.6

    def __post_init__(self) -> None:
        if self.actuation not in get_args(Actuation):
            raise ConfigurationError(
                "unknown actuation", got=self.actuation, choices=get_args(Actuation)
            )
        for name in ("control_dt", "physics_dt", "friction", "mass_scale", "inertia_scale"):
            require_positive(name, getattr(self, name))
        for name in ("joint_damping", "joint_friction"):
            require_not_negative(name, getattr(self, name))
        self._check_times()
        self._check_floor()

    @property
    def substeps(self) -> int:
        """How many physics steps make one control period."""
        return require_multiple("control_dt", self.control_dt, "physics_dt", self.physics_dt)

    def _check_times(self) -> None:
        if self.substeps < 1:
            raise ConfigurationError(
                "control_dt is shorter than physics_dt", got=self.control_dt, wanted=">= physics_dt"
            )
        require_positive("contact_time_constant", self.contact_time_constant)
        if self.contact_time_constant < 2.0 * self.physics_dt:
            raise ConfigurationError(
                "contact_time_constant is too short for the physics step",
                got=self.contact_time_constant,
                wanted=f">= {2.0 * self.physics_dt}",
            )
        require_multiple("the sensors' delay", self.sensors.delay, "control_dt", self.control_dt)

    def _check_floor(self) -> None:
        for angle in self.floor_slope:
            require_finite("floor_slope", angle)
            if abs(angle) > _MAX_SLOPE:
                raise ConfigurationError(
                    "floor_slope is too steep", got=angle, wanted=f"at most {_MAX_SLOPE} rad"
                )
        require_positive("fall_height_ratio", self.fall_height_ratio)
        if self.fall_height_ratio >= 1.0:
            raise ConfigurationError(
                "fall_height_ratio must be below one",
                got=self.fall_height_ratio,
                wanted="in (0, 1)",
            )
