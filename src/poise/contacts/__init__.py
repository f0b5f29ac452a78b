"""Where the robot touches the world; each contact gives rows and knows no solver."""

from poise.contacts.contact import Contact
from poise.contacts.point import PointContact
from poise.contacts.surface import SurfaceContact

__all__ = ["Contact", "PointContact", "SurfaceContact"]
