"""The operational space formulation: prioritised torques in closed form."""

from poise.control.osf.controller import OperationalSpaceController
from poise.control.osf.rank import RankTreatment
from poise.control.osf.recursion import BIAS_FORMULAS, DERIVATIVES

__all__ = ["BIAS_FORMULAS", "DERIVATIVES", "OperationalSpaceController", "RankTreatment"]
