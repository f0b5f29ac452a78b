"""Prioritised differential inverse kinematics: joint velocities for robots that take them."""

from poise.control.differential_ik.closed_form import VelocityLevel, solve_levels
from poise.control.differential_ik.controller import METHODS, DifferentialIK
from poise.control.differential_ik.joint_weights import limit_weights
from poise.control.differential_ik.row_weights import ROW_WEIGHT, RowWeights
from poise.control.differential_ik.stance import base_from_joints, constrained
from poise.control.differential_ik.within_bounds import solve_within_bounds

__all__ = [
    "METHODS",
    "ROW_WEIGHT",
    "DifferentialIK",
    "RowWeights",
    "VelocityLevel",
    "base_from_joints",
    "constrained",
    "limit_weights",
    "solve_levels",
    "solve_within_bounds",
]
