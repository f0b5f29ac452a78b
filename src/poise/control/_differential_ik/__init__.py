"""Prioritised differential inverse kinematics: joint velocities for robots that take them."""

from poise.control._differential_ik._controller import STRATEGIES, DifferentialIK

__all__ = ["STRATEGIES", "DifferentialIK"]
