"""The operational space formulation: prioritised torques in closed form."""

from poise.control._osf._controller import OperationalSpaceController

__all__ = ["OperationalSpaceController"]
