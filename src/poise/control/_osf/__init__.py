"""The operational space formulation: prioritised torques in closed form."""

from poise.control._osf._controller import OperationalSpaceController
from poise.control._osf._rank import RankTreatment

__all__ = ["OperationalSpaceController", "RankTreatment"]
