"""Robots: what a robot is, how one is loaded, and the catalog of names."""

from poise.robots._catalog import CatalogEntry, catalog
from poise.robots._inverse_kinematics import frame_error, inverse_kinematics
from poise.robots._loader import description_template, load_robot
from poise.robots._meshes import mesh_path
from poise.robots._posture import standing_posture
from poise.robots._robot import GRAVITY, FrameRole, ModelSource, Robot, Sole

__all__ = [
    "GRAVITY",
    "CatalogEntry",
    "FrameRole",
    "ModelSource",
    "Robot",
    "Sole",
    "catalog",
    "description_template",
    "frame_error",
    "inverse_kinematics",
    "load_robot",
    "mesh_path",
    "standing_posture",
]
