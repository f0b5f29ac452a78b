"""Prioritised differential inverse kinematics: joint velocities for robots that take them."""

from poise.control._differential_ik._bounds import limit_weights
from poise.control._differential_ik._closed_form import VelocityLevel, solve_levels
from poise.control._differential_ik._controller import DifferentialIK
from poise.control._differential_ik._rows import (
    RowWeights,
    base_from_joints,
    constrained,
)
from poise.control._differential_ik._strategy import STRATEGIES

__all__ = [
    "STRATEGIES",
    "DifferentialIK",
    "RowWeights",
    "VelocityLevel",
    "base_from_joints",
    "constrained",
    "limit_weights",
    "solve_levels",
]
