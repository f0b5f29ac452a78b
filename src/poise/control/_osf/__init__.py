"""The operational space formulation: prioritised torques in closed form."""

from poise.control._osf._controller import OperationalSpaceController
from poise.control._osf._rank import RankTreatment
from poise.control._osf._recursion import BIAS_FORMULAS, DERIVATIVES

__all__ = ["BIAS_FORMULAS", "DERIVATIVES", "OperationalSpaceController", "RankTreatment"]
