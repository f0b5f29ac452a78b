"""Robots: what a robot is, how one is loaded, and the catalog of names."""

from poise.robots.catalog import CatalogEntry, catalog
from poise.robots.loader import description_template, load_robot
from poise.robots.robot import FrameRole, ModelSource, Robot, Sole

__all__ = [
    "CatalogEntry",
    "FrameRole",
    "ModelSource",
    "Robot",
    "Sole",
    "catalog",
    "description_template",
    "load_robot",
]
