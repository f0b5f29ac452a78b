"""What may not be exceeded; each limit gives bounds and knows no solver."""

from poise.limits.joint import JointLimit
from poise.limits.torque import TorqueLimit

__all__ = ["JointLimit", "TorqueLimit"]
