"""Feet that an operator leads, and the levels that turn them into a stack's targets."""

from poise.locomotion._stepping._feet._foot import FootTarget, FootVelocity
from poise.locomotion._stepping._feet._foot_devices import FOOT_TURNS, DeviceEvents, FootDevices
from poise.locomotion._stepping._feet._level import Level, LevelTick, OperatorTick

__all__ = [
    "FOOT_TURNS",
    "DeviceEvents",
    "FootDevices",
    "FootTarget",
    "FootVelocity",
    "Level",
    "LevelTick",
    "OperatorTick",
]
