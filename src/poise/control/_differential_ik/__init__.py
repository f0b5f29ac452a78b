"""Prioritised differential inverse kinematics: joint velocities for robots that take them."""

from poise.control._differential_ik._controller import DifferentialIK
from poise.control._differential_ik._strategy import STRATEGIES

__all__ = ["STRATEGIES", "DifferentialIK"]
