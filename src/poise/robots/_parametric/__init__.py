"""Robots made in code: their URDF text, by the name a description asks for."""

from poise.robots._parametric._generators import generate
from poise.robots._parametric._proportions import MAX_JOINTS, MIN_JOINTS
from poise.robots._parametric._solids import Shape, rod, sphere
from poise.robots._parametric._tree import PALETTE, add_shape

__all__ = ["MAX_JOINTS", "MIN_JOINTS", "PALETTE", "Shape", "add_shape", "generate", "rod", "sphere"]
