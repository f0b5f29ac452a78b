"""The plant that step teleoperation is simulated on."""

from dataclasses import asdict, replace
from typing import Any

import numpy as np

from poise.sim import Block, LinkError, Payload, PlantConfig, SensorConfig, ServoConfig

TELEOP_PLANT = PlantConfig(
    actuation="velocity",
    control_dt=5e-3,
    physics_dt=1e-3,
    servo=ServoConfig(stiffness=70.0, damping=2.5),
)
"""Velocity servos with position feedback; physics 1 ms, control 5 ms, as Zhang and Kikuuwe have it.

The servos are stiff enough that the commanded velocity is the velocity: with those of a standing
robot that is commanded torques the ZMP lags by what the joints sag."""

REAL_SENSORS = SensorConfig(
    encoder_resolution=2.0 * np.pi / 2**17,
    joint_velocity_noise=0.01,
    base_orientation_noise=1e-3,
    gyro_noise=5e-3,
    force_noise=2.0,
    moment_noise=0.3,
)
"""Encoders of 17 bits, an inertial unit and load cells as one buys them; white noise."""


def noisy(plant: PlantConfig = TELEOP_PLANT) -> PlantConfig:
    """The plant with `REAL_SENSORS`."""
    return replace(plant, sensors=REAL_SENSORS)


def plant_to_json(config: PlantConfig) -> dict[str, Any]:
    """A plant as plain numbers and texts, for a recording."""
    return asdict(config)


def plant_from_json(data: dict[str, Any]) -> PlantConfig:
    """The plant that `plant_to_json` wrote.

    Raises:
        ConfigurationError: a value cannot be.
        TypeError: a key is unknown.
    """
    values = dict(data)
    values["servo"] = ServoConfig(**values["servo"])
    values["sensors"] = SensorConfig(**values["sensors"])
    values["floor_slope"] = tuple(values["floor_slope"])
    values["blocks"] = tuple(
        Block(center=tuple(b["center"]), size=tuple(b["size"]), yaw=b["yaw"])
        for b in values["blocks"]
    )
    values["link_errors"] = tuple(
        LinkError(**(e | {"com_offset": tuple(e["com_offset"])})) for e in values["link_errors"]
    )
    values["payloads"] = tuple(
        Payload(**(p | {"offset": tuple(p["offset"])})) for p in values["payloads"]
    )
    return PlantConfig(**values)
